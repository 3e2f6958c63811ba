"""The steel rod of SoRoSim's equilibria with strains that are linear in Z on each of its halves.

This is how the 500 rows of steel were made, as they tell themselves: beyond the rounding of their
wrenches and places they differ from the equilibria of the rod by what these strains do. SoRoSim's
rows of another rod do not (`tests/data/README.md`). With the moment m(Z) that the loads put on the
sections of the shape, in its directors, the coefficients solve the equations of Galerkin,
∫ φ (u - K⁻¹ m) dZ = 0 for every shape function φ.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tests.oracles.rod import Loads, Rod

Array = NDArray[np.float64]

_HALF = 40  # cells of each half, straight or bent to an arc
_STEP = 1e-6


def centers(rod: Rod) -> Array:
    """Z of the cells' centers [m]."""
    return rod.length * (np.arange(2 * _HALF) + 0.5) / (2 * _HALF)


def places(rod: Rod, loads: Loads, curvature: Array, stations: Array) -> Array:
    """r at stations, shape (station, 3) [m].

    Args:
        rod: Uniform, straight and inextensible.
        loads: Gravity, wrench at the tip and one in the middle.
        curvature: u at the centers of cells to begin from, shape (cell, 3) [1/m].
        stations: Z [m].
    """
    shapes = _shape_functions()
    stiffness = np.array([rod.bending(0.0), rod.bending(0.0), rod.torsion(0.0)])

    def miss(flat: Array) -> Array:
        u = np.einsum("cp,bpi->bci", shapes, flat.reshape(len(flat), 4, 3))
        wanted = _moments(rod, loads, *_walk(rod, u)) / stiffness
        return np.einsum("cp,bci->bpi", shapes, u - wanted).reshape(len(flat), 12)

    x = np.linalg.lstsq(shapes, curvature, rcond=None)[0].ravel()
    for _ in range(15):
        values = miss(x + _STEP * np.eye(13, 12, k=-1))
        step = np.linalg.solve((values[1:] - values[0]).T / _STEP, -values[0])
        x = x + step
        if np.abs(step).max() < 1e-7:
            nodes = _walk(rod, (shapes @ x.reshape(4, 3))[None])[2][0]
            return CubicSpline(np.linspace(0.0, rod.length, len(nodes)), nodes)(stations)
    raise ArithmeticError("no equilibrium with linear strains near the start")


def _shape_functions() -> Array:
    """1 and a line on each half, shape (cell, 4)."""
    line = (2 * np.arange(_HALF) + 1) / _HALF - 1
    half = np.stack([np.ones(_HALF), line], axis=1)
    return np.kron(np.eye(2), half)


def _walk(rod: Rod, u: Array) -> tuple[Array, Array, Array]:
    """Frames and places at centers, and places at the ends of cells, of a batch of curvatures."""
    h, count = rod.length / (2 * _HALF), len(u)
    frame = np.broadcast_to(np.array(rod.base).T, (count, 3, 3))
    frames, middles, ends = [], [], [np.zeros((count, 3))]
    for k in range(2 * _HALF):
        frames.append(frame @ _rotation(u[:, k] * h / 2))
        middles.append(ends[-1] + h / 2 * (frame @ _rotation(u[:, k] * h / 4))[:, :, 2])
        ends.append(ends[-1] + h * frames[-1][:, :, 2])
        frame = frame @ _rotation(u[:, k] * h)
    return np.stack(frames, 1), np.stack(middles, 1), np.stack(ends, 1)


def _moments(rod: Rod, loads: Loads, frames: Array, middles: Array, ends: Array) -> Array:
    """m at the centers in their directors, from what acts beyond."""
    h, (point,) = rod.length / (2 * _HALF), loads.points
    weight = rod.mass(0.0) * h * np.array(loads.gravity)
    arms = np.cumsum(middles[:, ::-1], axis=1)[:, ::-1] - middles
    arms -= np.arange(2 * _HALF)[::-1, None] * middles
    arms += 0.25 * (ends[:, 1:] - middles)  # the outer half of the own cell
    moment = np.cross(arms, weight) + np.array(loads.tip_moment)
    moment += np.cross(ends[:, -1:] - middles, loads.tip_force)
    moment[:, :_HALF] += np.cross(ends[:, _HALF : _HALF + 1] - middles[:, :_HALF], point.force)
    moment[:, :_HALF] += np.array(point.moment)
    return np.einsum("bcij,bci->bcj", frames, moment)


def _rotation(w: Array) -> Array:
    """exp(w×)."""
    angle = np.maximum(np.linalg.norm(w, axis=-1), 1e-12)[..., None, None]
    x, y, z = np.moveaxis(w, -1, 0)
    zero = 0 * x
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*w.shape, 3)
    return (
        np.eye(3) + np.sin(angle) / angle * cross + (1 - np.cos(angle)) / angle**2 * cross @ cross
    )
