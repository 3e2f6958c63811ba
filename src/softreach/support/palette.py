"""Color of a bundle in every picture and file, and the color that its activations mix to."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Color = tuple[float, float, float]

BODY: Color = (0.87, 0.85, 0.82)  # The passive body of an arm
STEEL: Color = (0.55, 0.68, 0.82)  # The surface of a hull or reachable set
MET: Color = (0.13, 0.55, 0.25)  # What meets its requirements
MISSED: Color = (0.80, 0.12, 0.12)  # What misses them
BEST: Color = (0.90, 0.50, 0.05)  # The best designs of a search

# The paper's red, green, blue and yellow come first; lightness differs along the list, so that the
# order survives most color deficiencies and gray print.
# fmt: off
_BUNDLES: tuple[Color, ...] = (
    (0.82, 0.10, 0.12), (0.16, 0.64, 0.24), (0.12, 0.30, 0.82), (0.97, 0.78, 0.12),
    (0.60, 0.20, 0.65), (0.10, 0.68, 0.75), (0.95, 0.50, 0.10), (0.35, 0.35, 0.35),
    (0.97, 0.62, 0.76), (0.45, 0.24, 0.08), (0.68, 0.88, 0.36), (0.03, 0.10, 0.28),
)
# Light that an activation adds: pure, so that three bundles are the paper's RGB.
_LIGHTS = np.array([
    [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1],
    [1, 0.5, 0], [1, 1, 1], [1, 0, 0.5], [0.5, 0.25, 0], [0.5, 1, 0], [0, 0, 0.5],
], float)
# Pale, so that bundles stand out; the first is the body. Hatches tell them apart without color.
_MATERIALS: tuple[tuple[Color, str], ...] = (
    (BODY, ""), ((0.76, 0.84, 0.92), "////"), ((0.96, 0.91, 0.76), "...."),
    ((0.78, 0.88, 0.80), "\\\\\\\\"), ((0.90, 0.80, 0.86), "xxxx"), ((0.70, 0.70, 0.72), "++++"),
)
# fmt: on
_BLOCK = 1 << 15  # samples at a time: temporary arrays stay in the cache


def material_fill(index: int) -> tuple[Color, str]:
    """Color and hatch of a material in sections; they repeat after six."""
    return _MATERIALS[index % len(_MATERIALS)]


def eight_bit(color: Color) -> tuple[int, int, int]:
    """A color in channels from 0 to 255."""
    red, green, blue = (round(255 * channel) for channel in color)
    return red, green, blue


def bundle_color(index: int) -> Color:
    """The color of a bundle: red, green, blue, yellow, then others; they repeat after twelve."""
    return _BUNDLES[index % len(_BUNDLES)]


def activation_colors(activation: ArrayLike) -> NDArray[np.uint8]:
    """RGB of each sample, 0 to 255: every bundle adds its light in proportion to |γ| / max |γ|.

    With three bundles R, G and B are the three relative magnitudes, as in the paper. Activations
    are of shape (sample, bundle), of which NaN is black, and colors of shape (sample, 3).
    """
    gamma = np.asarray(activation, float)
    blocks = [slice(k, k + _BLOCK) for k in range(0, len(gamma), _BLOCK)]
    sizes = (_magnitudes(gamma[block]).max(initial=0.0) for block in blocks)
    largest = max(sizes, default=0.0) or 1.0
    lights = _LIGHTS[np.arange(gamma.shape[1]) % len(_LIGHTS)]
    mix = lights * (255.0 / largest) / np.maximum(lights.sum(axis=0), 1.0)
    colors = np.empty((len(gamma), 3), np.uint8)
    for block in blocks:
        colors[block] = np.rint(_magnitudes(gamma[block]) @ mix)
    return colors


def _magnitudes(gamma: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(gamma if np.isfinite(gamma).all() else np.nan_to_num(gamma))
