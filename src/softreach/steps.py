"""How many steps a rod needs: the grid along Z and the rule that meets a tip tolerance."""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach import taper
from softreach.actuation import actuation
from softreach.errors import InvalidInput
from softreach.kernels import magnus, rod
from softreach.manipulator import Manipulator

__all__ = ["Nodes", "node_tables", "packed_nodes", "station_steps", "steps_for"]

Array = NDArray[np.float64]

_SAFETY = 2.0
_SMALLEST_TOL = 1e-12
_MOST_STEPS = 4096
# Rotation of one step [rad] up to which the kernels' series are good to 1e-10 (tips), and to
# rounding (frames, whose directors must stay orthonormal).
_TIP_TURN, _FRAME_TURN = 2.0, 1.0


class Nodes(NamedTuple):
    """Tables at the three Gauss nodes of every step, what a rod kernel reads."""

    measure: Array
    """Length of the step as each node sees it [m], shape (step, node)."""
    stretch: Array
    """z [-], shape (step, node, fiber)."""
    curvature: Array
    """U [1/m], shape (step, node, 3, fiber)."""


def node_tables(arm: Manipulator, edges: ArrayLike) -> Nodes:
    """Actuation at the Gauss nodes of the steps between `edges`, uniform in S within each step.

    Args:
        arm: The design.
        edges: Step boundaries in the slender coordinate S [-], ascending, shape (step + 1,).
    """
    edges = np.asarray(edges, float)
    width = np.diff(edges)[:, None]
    s = edges[:-1, None] + width * np.array(magnus.NODES)
    z = taper.station_of(s, arm.outer_radius, arm.taper)
    table = actuation(arm, z.ravel())
    return Nodes(
        width * arm.radius(z),  # dZ = R2 dS
        table.extension.reshape(*s.shape, -1),
        table.curvature.reshape(*s.shape, 3, -1),
    )


@lru_cache(maxsize=64)
def packed_nodes(arm: Manipulator, steps: int) -> Array:
    """Packed tables of `steps` uniform steps from base to tip, read-only."""
    table = rod.pack(*node_tables(arm, np.linspace(0.0, _slender_length(arm), steps + 1)))
    table.setflags(write=False)
    return table


def station_steps(arm: Manipulator, stations: Array, tol: float) -> tuple[Nodes, NDArray[np.int64]]:
    """Nodes of a grid with a step boundary at every station, and the steps up to each.

    No step is longer in S than those of `steps_for`, so the same tolerance holds.
    """
    s = taper.slender_coordinate(stations, arm.outer_radius, arm.taper)
    gaps = np.diff(s, prepend=0.0)
    steps = max(steps_for(arm, tol), _fewest_steps(arm, _FRAME_TURN))
    counts = np.ceil(gaps / (_slender_length(arm) / steps)).astype(np.int64)
    starts = s - gaps
    edges = [a + g * np.arange(n) / n for a, g, n in zip(starts, gaps, counts, strict=True) if n]
    return node_tables(arm, np.concatenate([*edges, s[-1:]])), np.cumsum(counts)


@lru_cache(maxsize=1024)
def steps_for(arm: Manipulator, tol: float = 1e-6) -> int:
    """The number of uniform steps in S for which no tip is off by more than `tol`.

    The rule: every corner of the activation box (1,024 drawn at random when there are more), 256
    points on its faces and 256 inside are run with n and with 2n steps; n is the smallest number
    whose largest difference, doubled for safety, is within `tol`, and for which no step of theirs
    turns by more than 2 rad. Halving is sharp at sixth order: it sees 63/64 of the error.

    Args:
        arm: The design.
        tol: Largest tip error, in L.

    Raises:
        InvalidInput: `tol` below 1e-12, or not reached within 4,096 steps.
    """
    if not (_SMALLEST_TOL <= tol < np.inf):
        raise InvalidInput("tol", tol, f"at least {_SMALLEST_TOL:g} (in L)")
    allowed = tol * arm.length / _SAFETY
    steps, pilot = _fewest_steps(arm, _TIP_TURN), _pilot(arm)
    while steps <= _MOST_STEPS:
        error = _halving_error(arm, steps, pilot)
        if error <= allowed:
            return steps
        # Undershoot the sixth-order prediction a little, so that the smallest number is found.
        steps = max(steps + 1, int(0.97 * steps * (error / allowed) ** (1 / 6)))
    raise InvalidInput("tol", tol, f"reachable within {_MOST_STEPS} steps", "use a larger one")


def _slender_length(arm: Manipulator) -> float:
    return float(taper.slender_coordinate(arm.length, arm.outer_radius, arm.taper))


def _fewest_steps(arm: Manipulator, turn: float) -> int:
    """Steps of which none turns by more than `turn`: |ω| = ζ |u| R2 dS at the pilot samples."""
    z = taper.station_of(np.linspace(0.0, _slender_length(arm), 65), arm.outer_radius, arm.taper)
    table, gamma = actuation(arm, z), _pilot(arm)
    bend = np.linalg.norm(np.einsum("scf,nf->nsc", table.curvature, gamma), axis=-1)
    rate = (1.0 + gamma @ table.extension.T) * bend * arm.radius(z)
    return max(2, int(np.ceil(rate.max() * _slender_length(arm) / turn)))


def _pilot(arm: Manipulator) -> Array:
    """Unit-box samples scaled to the bounds: corners, faces, inside; the same for every design."""
    m, rng = arm.bundles, np.random.default_rng(0)
    if m <= 10:
        corners = np.array(list(itertools.product([0.0, 1.0], repeat=m)))
    else:
        corners = rng.integers(0, 2, (1024, m)).astype(float)
        corners[:2] = [[0.0], [1.0]]
    inside, faces = rng.random((256, m)), rng.random((256, m))
    faces[np.arange(256), rng.integers(0, m, 256)] = rng.integers(0, 2, 256)
    cube = np.concatenate([corners, faces, inside])
    return np.ascontiguousarray(arm.bounds[:, 0] + cube * np.diff(arm.bounds, axis=1)[:, 0])


def _halving_error(arm: Manipulator, steps: int, gamma: Array) -> float:
    coarse, fine = np.empty((len(gamma), 3)), np.empty((len(gamma), 3))
    rod.tips(packed_nodes(arm, steps), gamma, coarse)
    rod.tips(packed_nodes(arm, 2 * steps), gamma, fine)
    return float(np.linalg.norm(coarse - fine, axis=1).max())
