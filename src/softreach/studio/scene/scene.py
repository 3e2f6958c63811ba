"""Scene of a tab: arm, clouds, surfaces and marks as viser's nodes, in units of L."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.body import STRAIGHT
from softreach.arm.manipulator import Manipulator
from softreach.arm.skin import Centerline, arm_surface, bundle_skins, inside, marker_points
from softreach.picture.gltf import ColoredSkin, glb, shaded
from softreach.picture.zbuffer import vertex_normals
from softreach.plot.coloring import UNSTABLE, BundleKey, ScalarKey
from softreach.rod.rods import with_unstable
from softreach.rod.tip_map import TipMap, TipStatus
from softreach.studio.reach import Reach, cloud_points, sample_clearances, shown_samples
from softreach.studio.scene.camera import NumberedBox
from softreach.studio.scene.colors import FAINT, sample_colors, surface_colors
from softreach.studio.scene.solids import solid_surfaces
from softreach.studio.state import Appearance, Slice, StudioState, solvable_rod
from softreach.support.arrays import Array, Mask
from softreach.support.palette import bundle_color, eight_bit
from softreach.workspace.sheets import clipped

if TYPE_CHECKING:
    from viser import SceneApi

Color = tuple[int, int, int]

MOST_BUNDLES = 100  # with more the body alone is drawn: skins of hundreds take a minute

_STATIONS, _SIDES, _ACROSS = 51, 24, np.pi / 12
_LIFT = 0.02  # of the fibers above the body, in R2
_BODY: Color = (158, 153, 148)  # stands out through the surface from a light and from a dark page
_CLEAR = 0.45  # opacity of a body that has something inside
_HIDING = 0.6  # opacity of an arm that is in front of its own tip
_GHOST = 0.35
_SOLID, _AROUND, _TOUCHED = 0.4, (120, 135, 110), (210, 40, 40)
"""Opacity and colors of the surroundings."""
_SHADOWLESS: Any = {"cast_shadow": False, "receive_shadow": False}
_SURFACE, _CLEAR_SURFACE = (90, 140, 200), 0.6  # the boundary, through which the arm is seen
_INK = (60, 62, 80), (190, 192, 200)  # of its lines on a light page, and on a dark one
_BESIDE = {"/free": (FAINT, 0.2), "/reference": ((150, 150, 158), 0.3)}
"""Color and opacity of the reach without loads, and of the one of the kept design."""
MARK: Color = (235, 90, 0)
DARK: Color = (30, 30, 30)
_TOOL = 0.006  # thickness of the line from a section to the point that counts as the tip [L]
MARKER = 0.016  # edge of the dot of a marker [L]
_USUAL, _POINT, _POINTS = 1 << 17, 0.007, (0.003, 0.01)  # points of a cloud, and their edges [L]
_UNSTABLE_SIZE = 2.0  # times that of other points: they are few, and not to be overlooked


class _Arm(NamedTuple):
    """An arm as it is drawn: its meshes, and balls that fill it [L]."""

    arm: Manipulator
    meshes: list[Any]
    centers: Array
    radii: Array


class Scene:
    """One scene and what has been drawn into it."""

    def __init__(self, api: SceneApi) -> None:
        self.api, self.axes = api, NumberedBox(api)
        self.pointing: Array = np.full(3, np.nan)  # direction d3 of the tip of the arm as drawn
        self._arms: dict[str, _Arm] = {}
        self._clouds: dict[str, tuple[Mask, Any]] = {}
        self._solids: list[tuple[object, Any]] = []  # what each was drawn for, and its node
        self._lock = threading.RLock()
        self._ahead: Array | None = None
        self._base = np.zeros(3)

    # Nodes: adding one of the same name replaces it.

    def remove(self, *paths: str) -> None:
        """Take nodes and everything under them out of the scene."""
        for path in paths:
            for known in [k for k in list(self._arms) if k == path or k.startswith(f"{path}/")]:
                self._arms.pop(known, None)  # workers draw at the same time
            self._clouds.pop(path, None)
            self._solids = [] if path == "/surroundings" else self._solids
            if self.api.get_handle_by_name(path) is not None:
                self.api.remove_by_name(path)

    def dots(
        self, path: str, points: Array, color: Any, size: float, shape: str = "circle"
    ) -> None:
        """Dots at places [L], shape (n, 3); in viser's float16 they would be off by 1e-4 L."""
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            self.remove(path)
            return
        look: Any = {"point_size": size, "point_shape": shape, "precision": "float32"}
        self.api.add_point_cloud(path, points.astype(np.float32), color, **look)

    def lines(self, path: str, pieces: Array, color: Color, thickness: float) -> None:
        """Pieces of lines between places [L], shape (n, 2, 3); a piece with NaN is left out."""
        pieces = pieces[np.isfinite(pieces).all(axis=(1, 2))]
        if not len(pieces):
            self.remove(path)
            return
        self.api.add_line_segments(path, pieces.astype(np.float32), color, thickness=thickness)

    def _add_mesh(self, path: str, vertices: ArrayLike, faces: ArrayLike, **look: Any) -> Any:
        corners, triangles = np.asarray(vertices, np.float32), np.asarray(faces, np.uint32)
        look |= {"side": "double", **_SHADOWLESS}
        return self.api.add_mesh_simple(path, corners, triangles, **look)

    def look(self, ahead: Array | None, base: Array) -> None:
        """Cut away the half in front of the base [L], seen as the camera looks along the ground.

        A cloud whose points stay is not sent again.
        """
        self._ahead, self._base = ahead, base
        with self._lock:
            for path, (kept, dots) in list(self._clouds.items()):
                if not np.array_equal(kept, ~self.hidden(dots[0])):
                    self._cut_dots(path, *dots)

    def hidden(self, points: Array) -> Mask:
        """Mask of the points [L], shape (n, 3), that are cut away."""
        if self._ahead is None:
            return np.zeros(len(points), bool)
        return (points - self._base) @ self._ahead < 0.0

    def _cut_dots(self, path: str, points: Array, colors: NDArray[np.uint8], *look: Any) -> None:
        with self._lock:
            kept = ~self.hidden(points)
            self.dots(path, points[kept], colors[kept] if colors.ndim == 2 else colors, *look)
            self._clouds[path] = kept, (points, colors, *look)

    def draw_cloud(self, reach: Reach | None, look: Appearance) -> BundleKey | ScalarKey | None:
        """Points, thinned by prefix and cut by the slice; returns the key to their colors."""
        if reach is None or not shows_cloud(reach, look):
            self.remove("/cloud", "/unstable")
            return None
        points = cloud_points(reach, look.level)
        coloring = sample_colors(reach, look.level, look.color)
        unstable = reach.status[shown_samples(reach, look.level)] == TipStatus.UNSTABLE
        kept = in_slice(points, look.slice)
        if look.free and reach.arm.surroundings:
            kept &= sample_clearances(reach, shown_samples(reach, look.level)) > 0.0
        stable, size = kept & ~unstable, _point_size(len(points))
        self._cut_dots("/cloud", points[stable], coloring.rgb[stable], size)
        marks, color = points[kept & unstable], np.array(UNSTABLE, np.uint8)
        self._cut_dots("/unstable", marks, color, _UNSTABLE_SIZE * size, "diamond")
        return coloring.key

    def draw_surface(self, reach: Reach | None, look: Appearance) -> BundleKey | ScalarKey | None:
        """The exact boundary, if it is shown, slow the first time; the key to its own colors."""
        if reach is None or not (look.surface and reach.has_surface):
            self.remove("/surface")
            return None
        if shows_cloud(reach, look):  # whose colors it would hide
            self._draw_boundary("/surface", reach, look.slice, _SURFACE, 0.35, None)
            return None
        coloring, ink = surface_colors(reach, look.color), _INK[look.dark]
        self._draw_boundary("/surface", reach, look.slice, coloring.rgb, _CLEAR_SURFACE, ink)
        return coloring.key

    def _draw_boundary(
        self, path: str, reach: Reach, cut: Slice, rgb: ArrayLike, opacity: float, ink: Color | None
    ) -> None:
        """What a slice shows of a boundary in RGB of shape (v, 3) or (3,); its lines with ink."""
        faces, vertices = reach.sheets.faces, reach.sheets.vertices / reach.arm.length
        colors = np.broadcast_to(np.asarray(rgb, float), vertices.shape)
        colors = shaded(colors, vertex_normals(vertices, faces)).astype(float)
        skin = sliced(ColoredSkin(vertices, faces, colors), cut)
        self.remove(path)
        if not len(skin.faces):
            return
        lines = vertices[reach.sheets.lines]
        drawn = in_slice(lines.reshape(-1, 3), cut).reshape(-1, 2).all(axis=1) & (ink is not None)
        opened = cut.axis != "none" or reach.exact is None or reach.exact.dimension < 3
        data = glb(skin, opacity, lines[drawn], ink or DARK, both_sides=opened)
        self.api.add_glb(path, data, **_SHADOWLESS)

    def draw_beside(self, path: str, reach: Reach | None, cut: Slice) -> None:
        """The surface of another reach, pale, at "/free" or "/reference", if it has one."""
        color, opacity = _BESIDE[path]
        self.remove(path)
        if reach is not None and reach.has_surface:
            self._draw_boundary(path, reach, cut, color, opacity, None)

    def draw_axes(self, reach: Reach, free: Reach | None = None) -> None:
        """The box with numbers around cloud and arm, and the cloud without loads."""
        around = [cloud_points(each, 14) for each in (reach, free) if each is not None]
        straight = reach.arm.base.to_world(np.array([[0, 0, 0], [0, 0, reach.arm.length]]))
        self.axes.draw(*around, straight / reach.arm.length, arm=reach.arm)

    def draw_surroundings(self, arm: Manipulator, touched: int = -1) -> None:
        """The solids around an arm; one of them, by its number, is touched."""
        keys = [(each, arm.length, arm.base) for each in arm.surroundings]
        if keys != [key for key, _ in self._solids]:
            self.remove("/surroundings")
            surfaces = [(one.vertices / arm.length, one.faces) for one in solid_surfaces(arm)]
            add = partial(self._add_mesh, color=_AROUND, opacity=_SOLID, flat_shading=True)
            nodes = [add(f"/surroundings/{k}", *each) for k, each in enumerate(surfaces)]
            self._solids = list(zip(keys, nodes, strict=True))
        for k, (_, node) in enumerate(self._solids):
            color = _TOUCHED if k == touched else _AROUND
            if tuple(node.color) != color:
                node.color = color

    @property
    def spine(self) -> tuple[Array, Array]:
        """Centers (n, 3) and radii (n,) of balls along the arm [L], as it is drawn."""
        drawn = self._arms.get("/arm")
        return (np.empty((0, 3)), np.empty(0)) if drawn is None else (drawn.centers, drawn.radii)

    def draw_arm(
        self,
        arm: Manipulator,
        activation: Sequence[float],
        path: str = "/arm",
        rod: TipMap | None = None,
    ) -> Array:
        """The body, its fibers and markers; returns the tip [L], shape (3,).

        Without equilibrium nothing is drawn, and the tip is NaN; `rod` is of another posture.
        """
        stations = np.linspace(0.0, arm.length, _STATIONS)
        if arm.pointed is not None:
            stations = np.union1d(stations, arm.pointed.station_at("station", arm.length))
        frames = with_unstable(rod or solvable_rod(arm)).frames([activation], stations)
        line = Centerline(z=stations, position=frames.position[0], directors=frames.directors[0])
        return self._draw_line(arm, line, path)

    def draw_rest(self, state: StudioState) -> None:
        """The straight arm, if it is at rest, and a box around where it may go."""
        arm, look = state.design, state.appearance
        line = Centerline.unactivated(np.linspace(0.0, arm.length, _STATIONS), arm.base)
        bent = np.any(state.activation) or arm.loads is not None or arm.rest != STRAIGHT
        if look.arm and not (bent or arm.drives or arm.markers):
            self._draw_line(arm, line, "/arm")
        around = arm.base.to_world(arm.length * np.array(self.axes.corners)) / arm.length
        self.axes.draw(around, line.position / arm.length, arm=arm)

    def _draw_line(self, arm: Manipulator, line: Centerline, path: str) -> Array:
        length, centers, radii = arm.length, line.position, arm.profile.radius(line.z)
        if np.isnan(centers).any():
            self.remove(path)
            return np.full(3, np.nan)
        markers = marker_points(arm.markers, line) / length
        end, tip = -1, centers[-1] / length
        if arm.pointed is not None:
            end = int(np.searchsorted(line.z, arm.pointed.station_at("station", arm.length)))
            tip = markers[arm.markers.index(arm.pointed)]
        if path == "/arm":
            self.pointing = line.directors[end, 2]
        skins = [arm_surface(arm, line, _SIDES)]
        if arm.bundles <= MOST_BUNDLES:
            skins += bundle_skins(arm, line, lift=_LIFT, step=_ACROSS)
        corners = [(skin.vertices / length).astype(np.float32) for skin in skins]
        known = self._arms.get(path)
        if known is not None and known.arm is arm:
            handles = known.meshes
            for handle, vertices in zip(handles, corners, strict=True):
                handle.vertices = vertices
        else:
            self.remove(path)
            ghost, faces = path.startswith(("/ghosts", "/sample")), [skin.faces for skin in skins]
            clear = [_GHOST] * len(skins) if ghost else _opacities(arm, len(skins))
            colors = [_BODY, *(eight_bit(bundle_color(k)) for k in range(len(skins) - 1))]
            parts = enumerate(zip(corners, faces, colors, clear, strict=True))
            handles = [
                self._add_mesh(f"{path}/{k}", v, f, color=color, opacity=opacity)
                for k, (v, f, color, opacity) in parts
            ]
        self._arms[path] = _Arm(arm, handles, centers / length, radii / length)
        self.dots(f"{path}/markers", markers, DARK, MARKER)
        if arm.pointed is not None:
            self.lines(f"{path}/tool", np.array([[centers[end] / length, tip]]), DARK, _TOOL)
        return tip

    def see_through_arm(self, clear: bool) -> None:
        """Let what is behind the arm be seen through it, or not."""
        if (drawn := self._arms.get("/arm")) is not None:
            usual = _opacities(drawn.arm, len(drawn.meshes))
            for handle, opacity in zip(drawn.meshes, usual, strict=True):
                if handle.opacity != (target := _HIDING if clear else opacity):
                    handle.opacity = target  # which fails for one that is taken away meanwhile


def pieces(line: Array) -> Array:
    """The straight pieces between points in order, shape (n, 3), as shape (n - 1, 2, 3)."""
    return np.stack([line[:-1], line[1:]], axis=1)


def shows_cloud(reach: Reach, look: Appearance) -> bool:
    """True if points are shown: also in place of a surface that there is not, or not yet."""
    return look.cloud or (look.surface and not reach.has_surface)


def _point_size(count: int) -> float:
    """Edge of each of so many points of a cloud [L]: the fewer there are, the larger they are."""
    return float(np.clip(_POINT * (_USUAL / max(count, 1)) ** (1 / 3), *_POINTS))


def _opacities(arm: Manipulator, meshes: int) -> list[float | None]:
    hidden = any(inside(arm)) or arm.markers
    return [_CLEAR if hidden else None, *[None] * (meshes - 1)]


def in_slice(points: Array, cut: Slice) -> Mask:
    """Mask of the points [L], shape (n, 3), that a slice shows."""
    if cut.axis == "none":
        return np.ones(len(points), bool)
    return np.abs(points[:, "xyz".index(cut.axis)] - cut.center) <= cut.thickness / 2


def sliced(skin: ColoredSkin, cut: Slice) -> ColoredSkin:
    """The part of a surface that a slice shows, cut at its planes."""
    if cut.axis == "none":
        return skin
    vertices, faces, colors = skin
    for side in (-1.0, 1.0):
        depth = cut.thickness / 2 - side * (vertices[:, "xyz".index(cut.axis)] - cut.center)
        share = lambda pairs, depth=depth: depth[pairs[:, 0]] / -np.diff(depth[pairs])[:, 0]
        faces, pairs, shares = clipped(faces, depth >= 0.0, share)
        inside, outside, at = *pairs.T, shares[:, None]
        vertices, colors = (
            np.concatenate([values, values[inside] * (1 - at) + values[outside] * at])
            for values in (vertices, colors)
        )
    return ColoredSkin(vertices, faces, colors)
