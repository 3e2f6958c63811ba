"""Animation of an arm that follows a path, as a GIF."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.skin import inside
from softreach.cloud.clouds import design_of
from softreach.geometry.surface import Surface
from softreach.inverse.path import PathStatus
from softreach.picture.projection import View, project
from softreach.picture.shading import draw_mesh, faces_to_eye, seen_through
from softreach.picture.zbuffer import Extent, ZBuffer
from softreach.rod.arm_shape import arm_surface, bundle_skins
from softreach.rod.kinematics import configuration
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.errors import InvalidInput, MissingExtra
from softreach.support.palette import BODY, bundle_color

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Pose", "frames_along", "gif", "over_paper", "path_movie", "posed", "square_around"]

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

_PIXELS, _SIDES, _STATIONS = 420, 32, 41
_MOST_FRAMES = 60
_PATH, _TRACE, _CLOUD = (225, 150, 185), (220, 30, 120), (214, 218, 226)
_DENSE = 3  # points of the path per pixel
_MARGIN = 0.06  # of the picture
_PAUSE = 60  # [ms] between frames
_LAST = 1200  # [ms]


def frames_along(count: int, most: int = _MOST_FRAMES) -> list[int]:
    """Numbers of the points of a path that are shown: evenly, the first and the last among them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})


def path_movie(
    track: xr.Dataset,
    cloud: ArrayLike | None = None,
    *,
    view: View = "oblique",
    progress: Callable[[float], None] = lambda share: None,
) -> bytes:
    """Animation of an arm along a path, and of the path as far as it has come.

    Args:
        track: From `track_path`; shown as far as it is followed.
        cloud: Faint points behind [m], shape (m, 3), such as the tips of a cloud.
        view: The direction of the camera.
        progress: Told the share of frames drawn so far; may raise to stop.

    Returns:
        The content of a GIF file.

    Raises:
        InvalidInput: A path that is not followed at all.
        MissingExtra: Pillow is not installed.
    """
    activations = track.activation.values[track.status.values == PathStatus.FOLLOWED]
    if not len(activations):
        raise InvalidInput("path", "not reached", "one whose first point is reached")
    arm = design_of(track)
    rod = tip_map(arm, float(track.attrs["tol"]), warn=False)
    path = track.position.values / arm.length
    points = np.empty((0, 3)) if cloud is None else np.asarray(cloud, float) / arm.length
    shown = frames_along(len(activations))
    shapes = [posed(rod, activations[k]) for k in shown]
    extent = square_around(
        [points, path, *(body.vertices / arm.length for body, _ in shapes)], view
    )
    behind, line = (ZBuffer(extent, _PIXELS, oversample=2) for _ in range(2))
    behind.draw_points(points, _CLOUD, 1.5, view=view)
    line.draw_points(_dense(path, extent), _PATH, 2.0, view=view)
    paper = over_paper(behind.rgba(), np.full((*behind.shape, 3), 255, np.uint8))
    frames = []
    for number, (k, shape) in enumerate(zip(shown, shapes, strict=True)):
        progress(number / len(shown))
        buffer = deepcopy(line)
        buffer.draw_points(_dense(path[: k + 1], extent), _TRACE, 4.0, view=view)
        within = ZBuffer(extent, _PIXELS, oversample=2)
        frames.append(over_paper(_drawn(buffer, within, arm, shape, view), paper))
    return gif(frames)


class Pose(NamedTuple):
    """An arm in one activation."""

    body: Surface
    bundles: Sequence[Surface]


def posed(rod: TipMap, activation: Array) -> Pose:
    """The arm in an activation [m]."""
    shape = configuration(rod, activation, _STATIONS)
    return Pose(arm_surface(rod.arm, shape, _SIDES), bundle_skins(rod.arm, shape, lift=0.02))


def _drawn(buffer: ZBuffer, within: ZBuffer, arm: Manipulator, shape: Pose, view: View) -> Image:
    body, skins = shape
    draw_mesh(buffer, body.vertices / arm.length, body.faces, BODY, view)
    clear = any(inside(arm))
    for k, skin in enumerate(skins):
        points = skin.vertices / arm.length
        draw_mesh(buffer, points, skin.faces, bundle_color(k), view)
        if clear:
            faces = faces_to_eye(points, skin.faces, view)
            draw_mesh(within, points, faces, bundle_color(k), view)
    image = buffer.rgba()
    return seen_through(image, within.rgba()) if clear else image


def over_paper(image: Image, paper: Image) -> Image:
    """RGBA over RGB."""
    cover = image[..., 3:] / 255
    return np.rint(image[..., :3] * cover + paper * (1 - cover)).astype(np.uint8)


def square_around(parts: Sequence[Array], view: View) -> Extent:
    """A square around everything, with a margin."""
    points = project(np.concatenate([part[:: max(1, len(part) // 5000)] for part in parts]), view)
    flat = points[np.isfinite(points).all(axis=1), :2]
    low, high = flat.min(axis=0), flat.max(axis=0)
    middle, half = (low + high) / 2, (0.5 + _MARGIN) * max(float((high - low).max()), 1e-9)
    return Extent(middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half)


def _dense(path: Array, extent: Extent) -> Array:
    """Even points along a path, so many that they make a line."""
    if len(path) < 2:
        return path
    pixel = (extent.right - extent.left) / _PIXELS
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    even = np.linspace(0.0, way[-1], 2 + int(_DENSE * way[-1] / pixel))
    return np.stack([np.interp(even, way, axis) for axis in path.T], axis=1)


def gif(frames: Sequence[Image]) -> bytes:
    """Frames, RGB, as an animation that rests on the last.

    Raises:
        MissingExtra: Pillow is not installed.
    """
    try:
        from PIL import Image as images
    except ModuleNotFoundError as error:
        raise MissingExtra(("Pillow", "plot")) from error
    # One palette for all frames: colors that change from frame to frame flicker.
    some = np.concatenate([frames[0], frames[len(frames) // 2], frames[-1]])
    first = images.fromarray(some).quantize(256, dither=images.Dither.NONE)
    made = [
        images.fromarray(frame).quantize(palette=first, dither=images.Dither.NONE)
        for frame in frames
    ]
    times = [_PAUSE] * (len(made) - 1) + [_LAST]
    file = io.BytesIO()
    made[0].save(
        file, "GIF", save_all=True, append_images=made[1:], duration=times, loop=0, optimize=False
    )
    return file.getvalue()
