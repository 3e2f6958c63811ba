"""A z-buffer: millions of points, and lit triangles, to one image where the nearest shows.

Every pixel holds one 64-bit key, the depth above the color, and drawing takes the larger key. So
the image does not depend on the order of what is drawn, and a point of several pixels is a shifted
maximum of the finished image, whatever the number of points.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.picture.projection import View, project
from softreach.support.arrays import Array, Index

Keys = NDArray[np.uint64]
_BLOCK = 1 << 15  # points at a time: temporary arrays stay in the cache, and in memory once touched
_LAMP = np.array([-0.45, 0.60, 0.66])  # over the left shoulder: right, up, toward the camera
_AMBIENT, _DIFFUSE, _GLOSS = 0.40, 0.62, 0.08
_SHARE = 0.55  # of what is inside, in the color of a pixel


class Extent(NamedTuple):
    """The part of the projection plane that an image covers, as `imshow` wants it."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def size(self) -> Array:
        """Width and height, shape (2,)."""
        return np.array([self.right - self.left, self.top - self.bottom])


class ZBuffer:
    """An image under construction: (right, up, toward the camera) coordinates in, RGBA out.

    The width counts square pixels; each is the mean of `oversample` squared, which smooths edges.
    Colors are multiples of `color_step`: a coarse one keeps files small.
    """

    def __init__(
        self, extent: Extent, width: int, oversample: int = 2, color_step: int = 1
    ) -> None:
        self.extent, self.oversample, self.color_step = extent, oversample, color_step
        height = max(1, round(width * (extent.size[1] / extent.size[0])))
        self._keys: Keys = np.zeros((height * oversample, width * oversample), np.uint64)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        return self._keys.shape[0] // self.oversample, self._keys.shape[1] // self.oversample

    def draw_points(
        self, points: ArrayLike, colors: ArrayLike, size: float = 1.0, *, view: View | None = None
    ) -> None:
        """Draw points, shape (n, 3), that are finite, as discs that face the camera.

        Colors are RGB from 0 to 255, shape (n, 3) or (3,), and the size is in pixels of the image.
        Without a view the points are already seen from the camera.
        """
        points = np.asarray(points, float)
        colors = np.broadcast_to(np.asarray(colors, np.uint8), points.shape)
        layer = np.zeros_like(self._keys)
        for start in range(0, len(points), _BLOCK):
            block = slice(start, start + _BLOCK)
            seen = points[block] if view is None else project(points[block], view)
            pixels = self._to_pixels(seen)
            inside = ((pixels >= 0) & (pixels < layer.shape[::-1])).all(axis=1)
            inside &= np.isfinite(seen[:, 2])
            column, row = pixels[inside].astype(np.int64).T
            keys = _keys(seen[inside, 2], colors[block][inside])
            np.maximum.at(layer.reshape(-1), row * layer.shape[1] + column, keys)
        np.maximum(self._keys, _grown(layer, size * self.oversample), out=self._keys)

    def draw_triangles(self, corners: ArrayLike, colors: ArrayLike) -> None:
        """Draw triangles; their colors, RGB from 0 to 255, blend. Shapes (n, 3 corners, 3)."""
        from softreach.kernels.points.triangles import fill_triangles  # lazily: Numba

        values = np.concatenate([np.asarray(corners, float), np.asarray(colors, float)], axis=2)
        values = values[np.isfinite(values).all(axis=(1, 2))]
        values[..., :2] = self._to_pixels(values)
        fill_triangles(values, np.empty((2, 6)), self._keys)

    def rgba(self) -> NDArray[np.uint8]:
        """The image from top to bottom, shape (rows, columns, 4); transparent where nothing is."""
        image, by, step = np.zeros((*self.shape, 4), np.uint8), self.oversample, self.color_step
        rows = _filled(self._keys, 1, by)
        keys = self._keys[by * rows.start : by * rows.stop]
        columns = _filled(keys, 0, by)
        mean = _averaged(keys[:, by * columns.start : by * columns.stop], by)
        levels = np.minimum(255, np.rint(np.arange(256) / step) * step).astype(np.uint8)
        image[rows, columns] = np.concatenate([levels[mean[..., :3]], mean[..., 3:]], axis=-1)
        return image

    def _to_pixels(self, points: Array) -> Array:
        """Column and row from the top, where whole numbers are the edges of pixels."""
        (rows, columns), (width, height) = self._keys.shape, self.extent.size
        column = (points[..., 0] - self.extent.left) * (columns / width)
        row = (self.extent.top - points[..., 1]) * (rows / height)
        return np.stack([column, row], axis=-1)


def _keys(depth: Array, colors: NDArray[np.uint8]) -> Keys:
    """Depth in the high half, in unsigned order; red, green, blue, 255 in the low."""
    bits = depth.astype(np.float32).view(np.uint32)
    negative = bits >> np.uint32(31) == 1
    ordered = np.where(negative, ~bits, bits | np.uint32(0x80000000)).astype(np.uint64)
    red, green, blue = colors.T.astype(np.uint32)
    color = red << np.uint32(24) | green << np.uint32(16) | blue << np.uint32(8) | np.uint32(255)
    return ordered << np.uint64(32) | color


def _grown(layer: Keys, diameter: float) -> Keys:
    """Every pixel takes the largest key of a disc around it: of centers within the radius.

    The disc is built of rows from its narrow ends to its wide middle, so that each row only widens
    the one before; that takes as many passes as the disc is high, not as it has pixels.
    """
    reach = int(diameter / 2)
    result, row, half = layer.copy(), layer.copy(), 0
    for dy in range(reach, -1, -1):
        width = int(np.sqrt(diameter * diameter / 4 - dy * dy))
        for dx in range(half + 1, width + 1):
            _raise(row.T, layer.T, dx)
        half = width
        _raise(result, row, dy)
    return result


def _raise(target: Keys, source: Keys, shift: int) -> None:
    """The larger of target and source moved down, and moved up, by some rows; in place."""
    if shift >= len(source):
        return
    stop = len(source) - shift
    np.maximum(target[shift:], source[:stop], out=target[shift:])
    np.maximum(target[:stop], source[shift:], out=target[:stop])


def _filled(keys: Keys, axis: int, by: int) -> slice:
    """Rows (axis 1) or columns (axis 0), in blocks of pixels, outside of which nothing is drawn."""
    indices = np.flatnonzero(keys.max(axis=axis, initial=0))
    return slice(indices[0] // by, indices[-1] // by + 1) if len(indices) else slice(0, 0)


def _averaged(keys: Keys, by: int) -> NDArray[np.uint8]:
    """RGBA means of blocks of pixels; colors are weighted by opacity so that edges keep theirs."""
    if by == 1:  # every key ends in its color
        return keys.astype(">u4").view(np.uint8).reshape(*keys.shape, 4)
    # four sums in one number: opacity, green, blue and red from 0 to 255, each in 16 bits of 64
    pairs = np.uint64(0x00FF00FF)
    lanes = (keys & pairs) | (keys >> np.uint64(8) & pairs) << np.uint64(32)
    total = sum(lanes[i::by, j::by] for i, j in product(range(by), repeat=2))
    opacity, green, blue, red = (total >> np.uint64(s) & np.uint64(0xFFFF) for s in (0, 16, 32, 48))
    # opacity is 0 or 255 here, and the color of an empty pixel is 0
    full = np.maximum(opacity.astype(np.uint16) // 255, 1)
    channels = [color.astype(np.uint16) // full for color in (red, green, blue)]
    return np.stack([*channels, opacity // np.uint64(by**2)], axis=-1).astype(np.uint8)


def draw_mesh(
    buffer: ZBuffer,
    vertices: ArrayLike,
    faces: ArrayLike,
    color: ArrayLike,
    view: View,
    fade: float = 0.0,
) -> None:
    """Draw a lit mesh, shapes (v, 3) and (f, 3), in a color from 0 to 1 that fades toward white."""
    points, faces = project(vertices, view), np.asarray(faces)
    colors = shade(vertex_normals(points, faces), color)
    colors += fade * (255 - colors)
    buffer.draw_triangles(points[faces], colors[faces])


def shade(normals: Array, color: ArrayLike) -> Array:
    """RGB from 0 to 255 for unit normals as seen, shapes (n, 3), lit alike from both sides."""
    facing = np.where(normals[:, 2:] < 0, -normals, normals)
    # from 0 to 1 all around, so that the dark side has a shape too
    light = (0.5 + 0.5 * (facing @ _LAMP) / np.linalg.norm(_LAMP))[:, None] ** 1.5
    lit = (_AMBIENT + _DIFFUSE * light) * np.asarray(color, float) + _GLOSS * light**12
    return 255 * np.clip(lit, 0.0, 1.0)


def vertex_normals(points: Array, faces: NDArray[np.integer]) -> Array:
    """Unit mean of the normals of the faces around each vertex, by area, shape (v, 3)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, faces[:, k], normals)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0)


def seen_through(image: NDArray[np.uint8], within: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An image through which one of what is within shows: RGBA, 0 to 255, (rows, columns, 4)."""
    front, back = image.astype(float), within.astype(float)
    cover = front[..., 3:] / 255
    weight = back[..., 3:] / 255 * (1.0 - (1.0 - _SHARE) * cover)
    mixed = np.where(cover > 0, (1.0 - weight) * front + weight * back, back)
    mixed[..., 3:] = np.maximum(front[..., 3:], back[..., 3:])
    return np.rint(mixed).astype(np.uint8)


def faces_to_eye(vertices: ArrayLike, faces: ArrayLike, view: View) -> Index:
    """Those of faces turning outwards, (f, 3), that are seen from outside, shape (n, 3)."""
    points, faces = project(vertices, view)[:, :2], np.asarray(faces)
    a, b, c = (points[faces[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return faces[ux * vy > uy * vx]
