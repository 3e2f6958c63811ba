"""Animation of a design that becomes another, with all that its tip reaches, as a GIF."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters import changed, parameters
from softreach.picture.projection import View, project
from softreach.picture.shading import draw_mesh, seen_through, shade, vertex_normals
from softreach.picture.zbuffer import Extent, ZBuffer
from softreach.plot.coloring import COLORMAP
from softreach.plot.path_movie import Pose, gif, over_paper, posed, square_around
from softreach.rod.activation_box import ActivationBox
from softreach.rod.rods import tip_map
from softreach.support.arguments import as_integer
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidInput, SoftreachError
from softreach.support.palette import BODY, bundle_color
from softreach.workspace import ReachableSolid, ReachableSurface, Sheets, reachable_set

__all__ = ["blended_design", "morph_frames", "morph_movie"]

Image = NDArray[np.uint8]

_FRAMES, _PIXELS, _MOST_FRAMES = 41, 480, 400
_ACCURACY = 0.01
_FRAMED = 5  # designs on the way that tell what the picture has to cover
_INK, _DOT, _DOTS = (60, 62, 80), 1.6, 12  # of edges and folds; their width [pixel]; along each
_FADE = 0.3  # of the surface toward white, so that the arm stands out
_TEXT, _LETTER = (40, 42, 52), 26  # letters are this part of the picture high


def morph_movie(
    first: Manipulator,
    last: Manipulator,
    activations: tuple[ArrayLike, ArrayLike] | None = None,
    *,
    frames: int = _FRAMES,
    view: View = "oblique",
    progress: Callable[[float], None] = lambda share: None,
) -> bytes:
    """Animation from a design to another that differs from it in numbers alone.

    Each frame shows the exact surface of the design on the way, in the color of the effort, the arm
    in it and the volume.

    Args:
        first: The design of the first frame.
        last: That of the last.
        activations: Of the arm in these two, each of shape (bundles,); at rest by default.
        frames: How many.
        view: The direction of the camera.
        progress: Told the share of the work done so far; may raise to stop.

    Returns:
        The content of a GIF file.

    Raises:
        InvalidInput: Designs of other parts, or a number of frames that is none.
        InvalidDesign: A design on the way cannot exist.
        MissingExtra: matplotlib, Pillow or scikit-image is not installed.
    """
    return gif(morph_frames(first, last, activations, frames=frames, view=view, progress=progress))


def morph_frames(
    first: Manipulator,
    last: Manipulator,
    activations: tuple[ArrayLike, ArrayLike] | None = None,
    *,
    frames: int = _FRAMES,
    pixels: int = _PIXELS,
    view: View = "oblique",
    progress: Callable[[float], None] = lambda share: None,
) -> list[Image]:
    """The frames of `morph_movie`, RGB, shape (pixels, pixels, 3) each.

    No more than one surface is held at a time.
    """
    frames = as_integer("frames", frames, 2, _MOST_FRAMES)
    way = _Way(a_manipulator("first", first), a_manipulator("last", last), activations)
    tried = np.linspace(0.0, 1.0, min(_FRAMED, frames))
    steps, places = len(tried) + frames, []
    for k, share in enumerate(tried):
        progress(k / steps)
        at = way.at(share)
        places += [at.pose.body.vertices, *([] if at.sheets is None else [at.sheets.vertices])]
    extent, drawn = square_around(places, view), []
    for k, share in enumerate(np.linspace(0.0, 1.0, frames)):
        progress((len(tried) + k) / steps)
        drawn.append(_drawn(way.at(share), extent, pixels, view))
    return drawn


class _Stage(NamedTuple):
    """A design on the way, and what is drawn of it [m]."""

    arm: Manipulator
    box: ActivationBox
    pose: Pose
    sheets: Sheets | None
    volume: float
    """[L³]; NaN without one."""


class _Way:
    """From one design to another."""

    def __init__(
        self,
        first: Manipulator,
        last: Manipulator,
        activations: tuple[ArrayLike, ArrayLike] | None,
    ) -> None:
        self._first, self._numbers = first, _differing_numbers(first, last)
        bundles = tip_map(first, warn=False).box.bundles
        rest = np.zeros(bundles)
        given = (rest, rest) if activations is None else activations
        self._from, self._to = (as_floats("activation", value) for value in given)
        for value in (self._from, self._to):
            if value.shape != (bundles,):
                raise InvalidInput("activation.shape", value.shape, f"({bundles},)")

    def at(self, share: float) -> _Stage:
        """The design at a share of the way."""
        arm = _changed(self._first, self._numbers, share)
        rod = tip_map(arm, warn=False)
        pose = posed(rod, rod.box.clip((1 - share) * self._from + share * self._to))
        exact, sheets, volume = reachable_set(arm, accuracy=_ACCURACY), None, np.nan
        if isinstance(exact, ReachableSolid):
            sheets, volume = exact.sheets(), exact.volume / arm.length**3
        elif isinstance(exact, ReachableSurface):
            sheets = Sheets.of(exact.surface())
        return _Stage(arm, rod.box, pose, sheets, volume)


def blended_design(first: Manipulator, last: Manipulator, share: float) -> Manipulator:
    """The design at a share of the way from one to another: each of its numbers is.

    Numbers of the whole arm, such as the taper, lead those of its parts.

    Raises:
        InvalidInput: Designs of other parts.
        InvalidDesign: It cannot exist.
    """
    return _changed(first, _differing_numbers(first, last), share)


_Numbers = dict[str, tuple[float, float]]


def _changed(first: Manipulator, numbers: _Numbers, share: float) -> Manipulator:
    return changed(first, {name: (1 - share) * a + share * b for name, (a, b) in numbers.items()})


def _differing_numbers(first: Manipulator, last: Manipulator) -> _Numbers:
    """Parameters that make the first design the last one, and their values in both."""
    known, goal = parameters(first), parameters(last)
    chosen: _Numbers = {}
    if list(known) == list(goal):
        near = first
        for name in [*known, *known]:  # some can only change after others
            start, now, end = (known[name].value(arm) for arm in (first, near, last))
            if name in chosen or np.isclose(now, end, rtol=1e-12, atol=0.0, equal_nan=True):
                continue
            trial = {**chosen, name: (start, end)}
            try:
                near = _changed(first, trial, 1.0)
            except SoftreachError:
                continue
            if np.isfinite([start, end]).all():
                chosen = trial
        if all(
            np.isclose(p.value(near), p.value(last), rtol=1e-9, atol=1e-12, equal_nan=True)
            for p in known.values()
        ):
            return chosen
    raise InvalidInput("designs", "of other parts", "two that differ in numbers alone")


def _drawn(stage: _Stage, extent: Extent, pixels: int, view: View) -> Image:
    """Arm, seen through the surface, and the volume."""
    outside, within = (ZBuffer(extent, pixels, oversample=2) for _ in range(2))
    body, skins = stage.pose
    draw_mesh(within, body.vertices, body.faces, BODY, view)
    for k, skin in enumerate(skins):
        draw_mesh(within, skin.vertices, skin.faces, bundle_color(k), view)
    if stage.sheets is not None:
        _draw_sheets(outside, stage.sheets, stage.box, view)
    image = seen_through(outside.rgba(), within.rgba())
    return _labeled(over_paper(image, np.full((*image.shape[:2], 3), 255, np.uint8)), stage.volume)


def _draw_sheets(buffer: ZBuffer, sheets: Sheets, box: ActivationBox, view: View) -> None:
    from matplotlib import colormaps

    points = project(sheets.vertices, view)
    rgb: Array = np.array([0.55, 0.6, 0.8])
    if sheets.activation is not None:
        largest = np.maximum(np.abs(np.array(box.bounds)).max(axis=1), 1e-300)
        effort = (np.abs(sheets.activation) / largest).mean(axis=1)
        rgb = np.asarray(colormaps[COLORMAP](effort))[:, :3]
    colors = shade(vertex_normals(points, sheets.faces), rgb)
    colors += _FADE * (255 - colors)
    buffer.draw_triangles(points[sheets.faces], colors[sheets.faces])
    ends = sheets.vertices[sheets.lines]
    along = np.linspace(0.0, 1.0, _DOTS)[:, None, None]
    dots = ((1 - along) * ends[:, 0] + along * ends[:, 1]).reshape(-1, 3)
    buffer.draw_points(dots, _INK, _DOT, view=view)


def _labeled(image: Image, volume: float) -> Image:
    if np.isnan(volume):
        return image
    from matplotlib.font_manager import findfont
    from PIL import Image as images
    from PIL import ImageDraw, ImageFont

    picture, size = images.fromarray(image), len(image) / _LETTER
    at = (size / 2, size / 2)
    font = ImageFont.truetype(findfont("DejaVu Sans"), size)
    ImageDraw.Draw(picture).text(at, f"volume {volume:.3f} L³", fill=_TEXT, font=font)
    return np.asarray(picture)
