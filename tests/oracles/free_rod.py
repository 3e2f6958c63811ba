"""The reference: the rod in NumPy, 4x4 matrices and library exponentials, on one page.

The fast kernels are held to these functions, which take real or complex activations (so that
complex-step differences give exact derivatives) and know neither blocks nor threads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64] | NDArray[np.complex128]


def hat(omega: Array, v: Array) -> Array:
    """The 4x4 matrix of the twist (ω, v), shape (..., 3), (..., 3) -> (..., 4, 4)."""
    x, y, z = np.moveaxis(omega, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y, v[..., 0]], [z, zero, -x, v[..., 1]], [-y, x, zero, v[..., 2]]]
    rows.append([zero] * 4)
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def twists(
    measure: Array, stretch: Array, rest_length_factor: Array, curvature: Array, gamma: Array
) -> Array:
    """A = (ηu, ζe3) dZ at every node of every step, shape (step, node, 4, 4), of one γ (bundle,).

    Of the length [m] of a step as each node sees it (step, node), z and its part in η [-]
    (step, node, bundle), and U [1/m] (step, node, 3, bundle).
    """
    rest_length = measure * (1.0 + rest_length_factor @ gamma)
    length = measure * (1.0 + stretch @ gamma)
    e3 = np.array([0.0, 0.0, 1.0])
    return hat(rest_length[..., None] * (curvature @ gamma), length[..., None] * e3)


def magnus6(a1: Array, a2: Array, a3: Array) -> Array:
    """Sixth-order Magnus exponent of g' = gA from three Gauss nodes (Blanes, Casas, Ros 2000).

    The bracket is [X, Y] = YX - XY because the twist multiplies from the right.
    """

    def bracket(x: Array, y: Array) -> Array:
        return y @ x - x @ y

    b1, b2, b3 = a2, np.sqrt(15) / 3 * (a3 - a1), 10 / 3 * (a3 - 2 * a2 + a1)
    c1 = bracket(b1, b2)
    c2 = -bracket(b1, 2 * b3 + c1) / 60
    return b1 + b3 / 12 + bracket(-20 * b1 - b3 + c1, b2 + c2) / 240


def frames(
    measure: Array, stretch: Array, rest_length_factor: Array, curvature: Array, gamma: Array
) -> Array:
    """Homogeneous frames (d1 d2 d3 r) at the base and after every step, (step + 1, 4, 4)."""
    from scipy.linalg import expm

    frame = [np.eye(4)]
    for a in twists(measure, stretch, rest_length_factor, curvature, gamma):
        frame.append(frame[-1] @ expm(magnus6(*a)))
    return np.array(frame)


def tip(
    measure: Array, stretch: Array, rest_length_factor: Array, curvature: Array, gamma: Array
) -> Array:
    """Tip position r(L) [m], shape (3,)."""
    return frames(measure, stretch, rest_length_factor, curvature, gamma)[-1, :3, 3]
