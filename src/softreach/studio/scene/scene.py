"""Scene of a tab: arm, clouds, surfaces and marks as viser's nodes, in units of L."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from softreach.arm.body import STRAIGHT
from softreach.arm.manipulator import Manipulator
from softreach.arm.skin import arm_surface, bundle_skins, inside, marker_points
from softreach.picture.shading import vertex_normals
from softreach.plot.coloring import UNSTABLE
from softreach.rod.kinematics import configuration, rest_configuration
from softreach.studio.reach import Reach, cloud_points, unstable_samples
from softreach.studio.scene.axes import NumberedBox
from softreach.studio.scene.camera import way_to
from softreach.studio.scene.clouds import (
    FAINT,
    Clouds,
    Dots,
    in_slice,
    lit,
    point_size,
    sample_colors,
    shaded,
)
from softreach.studio.scene.surfaces import Skin, glb, sliced, surface_colors
from softreach.studio.state import Appearance, Slice, StudioState, solvable_rod
from softreach.support.palette import bundle_color
from softreach.workspace import ReachableSolid

if TYPE_CHECKING:
    from viser import SceneApi

    from softreach.plot.coloring import BundleKey, ScalarKey
    from softreach.rod.tip_map import TipMap


Array = NDArray[np.float64]

MOST_BUNDLES = 100
"""With more the body alone is drawn: skins of hundreds take a minute."""

Color = tuple[int, int, int]
Spine = tuple[Array, Array]
"""Centers (n, 3) and radii (n,) of balls along an arm [L]."""

_STATIONS, _SIDES, _ACROSS = 51, 24, np.pi / 12
_LIFT = 0.02  # of the fibers above the body, in R2
_BODY = 0.62, 0.60, 0.58
"""Color of the body: stands out through the surface from a light and from a dark page."""
_CLEAR = 0.45  # opacity of a body that has something inside
_HIDING = 0.6  # opacity of an arm that is in front of its own tip
_GHOST, _REFERENCE, _SURFACE = 0.35, (150, 150, 158), (90, 140, 200)
_CLEAR_SURFACE = 0.6  # opacity of the boundary, through which the arm is seen
_INK = (60, 62, 80), (190, 192, 200)  # of its lines on a light page, and on a dark one
_MARK: Color = (235, 90, 0)
_PALE: Color = (240, 175, 205)  # of a path, where the arm does not follow it
_BLOCKED: Color = (30, 30, 30)
_FREE_LEVEL, _FREE_SIZE = 15, 0.4
_FAINT = 0.2  # opacity of the reach without loads
_TARGET = 0.012  # [L]: less than the ball on the tip, which is grabbed there
_MARKER, _MARKER_SIZE = (30, 30, 30), 0.016
_MEASURED_SIZE = 0.03
_AROUND_TIP = 0.06  # [L], where a click means no ghost: all shapes meet there
_AROUND_ARM = (-0.6, -0.6, -0.4), (0.6, 0.6, 1.0)
"""Corners around most clouds, seen from the base [L]."""
_NOTHING = np.empty((0, 3)), np.empty(0)
_UNSTABLE_SIZE = 2.0  # times that of other points: they are few, and not to be overlooked


class Scene:
    """One scene and what has been drawn into it."""

    def __init__(self, api: SceneApi) -> None:
        self._api = api
        self.clouds = Clouds(api)
        self.axes = NumberedBox(api)
        self.pointing: Array = np.full(3, np.nan)
        """Direction d3 of the tip of the arm, as it is drawn."""
        self._spines: dict[str, Spine] = {}
        self._arms: dict[str, tuple[Manipulator, list[Any]]] = {}

    @property
    def spine(self) -> Spine:
        """Centers and radii along the arm [L], as it is drawn."""
        return self._spines.get("/arm", _NOTHING)

    def ghost_under(self, origin: Array, direction: Array) -> int | None:
        """Number of the ghost that a ray meets before any other and before the arm.

        Near their tips, where all shapes meet, ghosts are not met.
        """
        ghosts = [each for each in list(self._spines.items()) if each[0].startswith("/ghosts")]
        ways = [(way_to(*_without_tip(*s), origin, direction), path) for path, s in ghosts]
        way, nearest = min(ways, default=(np.inf, ""))
        arm = self.spine if "/arm" in self._arms else _NOTHING
        if way < way_to(*arm, origin, direction):
            return int(nearest.rpartition("/")[2])
        return None

    def draw_cloud(self, reach: Reach, look: Appearance) -> BundleKey | ScalarKey | None:
        """Points, thinned by prefix and cut by the slice; returns the key to their colors."""
        if not shows_cloud(reach, look):
            self.remove("/cloud", "/unstable", "/slice")
            return None
        points = cloud_points(reach, look.level)
        coloring = sample_colors(reach, look.level, look.color)
        kept, unstable = in_slice(points, look.slice), unstable_samples(reach, look.level)
        stable = kept & ~unstable
        colors = lit(coloring.rgb, points)
        size = point_size(len(points))
        self._points("/cloud", points[stable], colors[stable], size)
        marks, color = points[kept & unstable], np.array(UNSTABLE, np.uint8)
        self._points("/unstable", marks, color, _UNSTABLE_SIZE * size, shape="diamond")
        self._slab(look.slice, points)
        return coloring.key

    def draw_free(self, reach: Reach | None, cut: Slice) -> None:
        """The reach of the arm without its loads, a faint surface; None takes it away.

        Points, where there is no surface, lie before those of the loaded arm.
        """
        self.remove("/free")
        if reach is None:
            return
        if reach.has_surface:
            self._surface("/free", reach.sheets, reach, cut, FAINT, _FAINT)
            return
        points = cloud_points(reach, _FREE_LEVEL)
        kept = in_slice(points, cut)
        gray = np.array(FAINT, np.uint8)
        self._points("/free", points[kept], gray, _FREE_SIZE * point_size(len(points)))

    def draw_arm(
        self,
        arm: Manipulator,
        activation: Sequence[float],
        path: str = "/arm",
        length: float | None = None,
        rod: TipMap | None = None,
    ) -> Array:
        """The body, its fibers and markers; returns the tip. Redrawn by moving what there is.

        Nothing is drawn of an arm without equilibrium, and the tip is NaN. Lengths are over
        `length` [m], by default that of the arm; `rod` is its tip map in another posture.
        """
        length = length or arm.length
        shape = configuration(rod or solvable_rod(arm), np.asarray(activation), _STATIONS)
        return self._draw_shape(arm, shape, path, length)

    def draw_rest(self, state: StudioState) -> None:
        """The straight arm, if it is at rest, and a box around where it may go."""
        arm, look = state.design, state.appearance
        shape = rest_configuration(arm, _STATIONS)
        bent = np.any(state.activation) or arm.loads is not None or arm.rest != STRAIGHT
        if look.arm and not (bent or arm.drives or arm.markers):
            self._draw_shape(arm, shape, "/arm", arm.length)
        around = arm.base.to_world(arm.length * np.array(_AROUND_ARM)) / arm.length
        straight = shape["position"].values / arm.length
        self.axes.draw(around, straight, arm=arm)

    def _draw_shape(self, arm: Manipulator, shape: Any, path: str, length: float) -> Array:
        if np.isnan(shape["position"].values).any():
            self.remove(path)
            return np.full(3, np.nan)
        centers, radii = shape["position"].values, shape["radius"].values
        self._spines[path] = centers / arm.length, radii / arm.length  # balls that fill the arm
        if path == "/arm":
            self.pointing = shape["directors"].values[-1, 2]
        self.draw_dots(f"{path}/markers", marker_points(arm.markers, shape) / length, _MARKER)
        meshes = _arm_meshes(arm, shape, length)
        known, handles = self._arms.get(path, (None, []))
        if known is arm:
            for handle, (vertices, _, _) in zip(handles, meshes, strict=True):
                handle.vertices = vertices
        else:
            self.remove(path)
            ghost = path.startswith(("/ghosts", "/sample"))
            opacity = [_GHOST] * len(meshes) if ghost else _opacities(arm, len(meshes))
            self._arms[path] = (
                arm,
                [
                    self._mesh(f"{path}/{k}", *mesh, opacity=how)
                    for k, (mesh, how) in enumerate(zip(meshes, opacity, strict=True))
                ],
            )
        return shape["position"].values[-1] / length

    def see_through_arm(self, clear: bool) -> None:
        """Let what is behind the arm be seen through it, or not."""
        arm, handles = self._arms.get("/arm", (None, []))
        usual = _opacities(arm, len(handles)) if arm is not None else []
        for handle, opacity in zip(handles, usual, strict=True):
            target = _HIDING if clear else opacity
            if handle.opacity != target:
                handle.opacity = target

    def draw_ghosts(self, arm: Manipulator, activations: Array) -> None:
        """Many shapes at once, transparent."""
        self.remove("/ghosts")
        for k, activation in enumerate(activations):
            self.draw_arm(arm, activation.tolist(), f"/ghosts/{k}")

    def draw_surface(self, reach: Reach, look: Appearance) -> BundleKey | ScalarKey | None:
        """The exact boundary, if it is shown; slow the first time.

        Returns:
            The key to the colors of the boundary; None where it has none of its own.
        """
        if not (look.surface and reach.has_surface):
            self.remove("/surface")
            return None
        if shows_cloud(reach, look):  # whose colors it would hide
            self.remove("/surface")
            self._surface("/surface", reach.sheets, reach, look.slice, _SURFACE)
            return None
        return self._draw_boundary(reach, look)

    def _draw_boundary(self, reach: Reach, look: Appearance) -> BundleKey | ScalarKey | None:
        coloring, sheets = surface_colors(reach, look.color), reach.sheets
        vertices = sheets.vertices / reach.arm.length
        colors = shaded(coloring.rgb, vertex_normals(vertices, sheets.faces))
        skin = sliced(Skin(vertices, sheets.faces, colors.astype(float)), look.slice)
        lines = _lines_of(reach, look)
        self.remove("/surface")
        if len(skin.faces):
            opened = look.slice.axis != "none" or not isinstance(reach.exact, ReachableSolid)
            data = glb(skin, _CLEAR_SURFACE, lines, _INK[look.dark], both_sides=opened)
            self._api.add_glb("/surface", data, cast_shadow=False, receive_shadow=False)
        return coloring.key

    def draw_axes(self, reach: Reach, free: Reach | None = None) -> None:
        """The box with numbers around cloud and arm, and the cloud without loads."""
        clouds = [reach] if free is None else [reach, free]
        around = (cloud_points(source, 14) for source in clouds)
        straight = reach.arm.base.to_world(np.array([[0, 0, 0], [0, 0, reach.arm.length]]))
        self.axes.draw(*around, straight / reach.arm.length, arm=reach.arm)

    def draw_path(self, points: Array, followed: Array) -> None:
        """A path [L], pale, and as far as the arm can follow it, dark; a ball where that ends."""
        self.remove("/path")
        for path, line, color in (
            ("/path/all", points, _PALE),
            ("/path/followed", followed, _MARK),
        ):
            if len(line) > 1:
                pieces = np.stack([line[:-1], line[1:]], axis=1).astype(np.float32)
                self._api.add_line_segments(path, pieces, color, thickness=0.006)
        if len(followed) and not np.array_equal(followed[-1], points[-1]):
            self._api.add_icosphere("/path/end", 0.014, _BLOCKED, position=followed[-1])

    def draw_target(self, target: Array | None, nearest: Array | None = None) -> None:
        """A mark where the tip should go [L], and a line to the nearest place in reach."""
        self.remove("/target", "/gap")
        if target is None:
            return
        self._api.add_icosphere("/target", _TARGET, _MARK, position=target)
        if nearest is not None:
            gap = np.stack([target, nearest])[None].astype(np.float32)
            self._api.add_line_segments("/gap", gap, _MARK, thickness=0.004)
            self._api.add_icosphere("/gap/nearest", 0.008, (40, 40, 40), position=nearest)

    def draw_sample(self, measured: Array, predicted: Array) -> None:
        """Measured and predicted markers [L], shapes (marker, 3), and lines between them."""
        self.draw_dots("/sample/measured", measured, _MARK, _MEASURED_SIZE)
        self.draw_dots("/sample/predicted", predicted, _MARKER)
        pairs = np.stack([measured, predicted], axis=1)
        pairs = pairs[np.isfinite(pairs).all(axis=(1, 2))].astype(np.float32)
        self.remove("/sample/residuals")
        if len(pairs):
            self._api.add_line_segments("/sample/residuals", pairs, _MARK, thickness=0.005)

    def draw_dots(self, path: str, points: Array, color: Color, size: float = _MARKER_SIZE) -> None:
        """Small dots at the places that are known [L]."""
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            self.remove(path)
            return
        self._api.add_point_cloud(
            path,
            points.astype(np.float32),
            color,
            point_size=size,
            point_shape="circle",
            precision="float32",
        )

    def draw_reference(self, reach: Reach | None, cut: Slice) -> None:
        """The boundary of another design in gray; its points, where it has none."""
        self.remove("/reference")
        if reach is None:
            return
        if isinstance(reach.exact, ReachableSolid):
            self._surface("/reference", reach.sheets, reach, cut, _REFERENCE, 0.3)
        else:
            points = cloud_points(reach, _FREE_LEVEL)
            gray = np.array(_REFERENCE, np.uint8)
            self._points("/reference", points, gray, point_size(len(points)))

    def remove(self, *paths: str) -> None:
        """Take nodes and everything under them out of the scene."""
        for path in paths:
            for known in list(self._arms):  # a copy: workers draw at the same time
                if known == path or known.startswith(f"{path}/"):
                    self._arms.pop(known, None)
                    if known != "/arm":  # which stays framed while it is away
                        self._spines.pop(known, None)
            self.clouds.forget(path)
            if self._api.get_handle_by_name(path) is not None:
                self._api.remove_by_name(path)

    def _points(
        self,
        path: str,
        points: Array,
        colors: NDArray[np.uint8],
        size: float,
        shape: Literal["circle", "diamond"] = "circle",
    ) -> None:
        if not len(points):
            self.remove(path)
            return
        self.clouds.draw(path, Dots(points=points, colors=colors, size=size, shape=shape))

    def _mesh(
        self, path: str, vertices: Array, faces: Any, color: Color, opacity: float | None = None
    ) -> Any:
        return self._api.add_mesh_simple(
            path,
            vertices.astype(np.float32),
            faces.astype(np.uint32),
            color=color,
            opacity=opacity,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

    def _surface(
        self, path: str, surface: Any, reach: Reach, cut: Slice, color: Color, opacity: float = 0.35
    ) -> None:
        """Draw what a slice leaves of a surface with `vertices` [m] and `faces`."""
        vertices = surface.vertices / reach.arm.length
        skin = sliced(Skin(vertices, surface.faces, np.zeros_like(vertices)), cut)
        if len(skin.faces):
            self._mesh(path, skin.vertices, skin.faces, color, opacity)

    def _slab(self, cut: Slice, points: Array) -> None:
        self.remove("/slice")
        if cut.axis == "none" or not len(points):
            return
        axis = "xyz".index(cut.axis)
        low, high = points.min(axis=0), points.max(axis=0)
        corners = np.tile(low, (4, 1))
        corners[:, axis] = cut.center
        for other, side in zip([k for k in range(3) if k != axis], ((1, 2), (2, 3)), strict=True):
            corners[list(side), other] = high[other]
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        self._mesh("/slice", corners, faces, (200, 200, 205), opacity=0.25)


def _lines_of(reach: Reach, look: Appearance) -> Array:
    """Ends [L] of the edges, folds and crossings that a slice leaves, shape (n, 2, 3)."""
    lines = (reach.sheets.vertices / reach.arm.length)[reach.sheets.lines]
    return lines[in_slice(lines.reshape(-1, 3), look.slice).reshape(-1, 2).all(axis=1)]


def shows_cloud(reach: Reach, look: Appearance) -> bool:
    """True if points are shown: also in place of a surface that there is not, or not yet."""
    return look.cloud or (look.surface and not reach.has_surface)


def _without_tip(centers: Array, radii: Array) -> Spine:
    apart = np.linalg.norm(centers - centers[-1], axis=1) > _AROUND_TIP
    return centers[apart], radii[apart]


def _arm_meshes(
    arm: Manipulator, shape: Any, length: float
) -> list[tuple[Array, NDArray[Any], Color]]:
    """Vertices over `length`, faces and color of the body and of every bundle."""
    body = arm_surface(arm, shape, _SIDES)
    meshes = [(body.vertices / length, body.faces, _rgb(_BODY))]
    if arm.bundles > MOST_BUNDLES:
        return meshes
    for k, skin in enumerate(bundle_skins(arm, shape, lift=_LIFT, step=_ACROSS)):
        meshes.append((skin.vertices / length, skin.faces, _rgb(bundle_color(k))))
    return meshes


def _opacities(arm: Manipulator, meshes: int) -> list[float | None]:
    hidden = any(inside(arm)) or arm.markers
    return [_CLEAR if hidden else None, *[None] * (meshes - 1)]


def _rgb(color: Sequence[float]) -> Color:
    r, g, b = (round(255 * c) for c in color)
    return r, g, b
