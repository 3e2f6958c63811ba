"""Forward kinematics: where the tip is, how it moves, what shape the arm takes.

The only caller of the rod kernels. Clamped at Z = 0, tangent d3 = +z there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach import parallel, schema
from softreach.actuation import actuation
from softreach.arrays import Jacobians, Points
from softreach.errors import InvalidInput
from softreach.kernels import frames, jacobian, rod
from softreach.manipulator import Manipulator
from softreach.steps import packed_nodes, station_steps, steps_for

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["configuration", "tip_jacobian", "tip_positions", "tip_task", "tips_and_jacobians"]

Array = NDArray[np.float64]

BLOCK = 16_384
"""Samples per task: large against a thread's cost, small enough for Ctrl-C to be prompt."""


def tip_positions(arm: Manipulator, activations: ArrayLike, tol: float = 1e-6) -> Points:
    """Tip positions of many activations (section 2; sixth-order Magnus integration).

    Args:
        arm: The design.
        activations: γ [-], shape (n, bundles); values outside the bounds are allowed, but `tol` is
            promised inside them.
        tol: Largest tip error, in L; it decides the number of steps (`steps_for`).

    Returns:
        Tips [m], shape (n, 3).

    Raises:
        InvalidInput: Activations of another shape or not finite, or a `tol` out of range.
    """
    gamma = arm.check_activations(activations)
    out = np.empty((len(gamma), 3))
    parallel.run(tip_task(arm, tol, gamma[b], out[b]) for b in parallel.blocks(len(gamma), BLOCK))
    return out


def tip_task(arm: Manipulator, tol: float, gamma: Array, out: Array) -> Callable[[], object]:
    """The work of filling `out` with the tips of `gamma`, to be run on any thread."""
    return partial(rod.tips, packed_nodes(arm, steps_for(arm, tol)), gamma, out)


def tip_jacobian(arm: Manipulator, activations: ArrayLike, tol: float = 1e-6) -> Jacobians:
    """Spatial twist of the tip per unit of each activation: the exact derivative of the tip.

    Column j is (v, ω): ω [rad] turns the tip frame, and the tip at p moves by v + ω × p [m].

    Args:
        arm: The design.
        activations: γ [-], shape (n, bundles).
        tol: As for `tip_positions`, whose derivative this is to rounding.

    Returns:
        Jacobians, shape (n, 6, bundles), linear rows first.

    Raises:
        InvalidInput: As for `tip_positions`.
    """
    return tips_and_jacobians(arm, activations, tol)[1]


def tips_and_jacobians(
    arm: Manipulator, activations: ArrayLike, tol: float = 1e-6
) -> tuple[Points, Jacobians]:
    """Tips and their Jacobians in one pass; see `tip_positions` and `tip_jacobian`."""
    gamma = arm.check_activations(activations)
    table = packed_nodes(arm, steps_for(arm, tol))
    tips, out = np.empty((len(gamma), 3)), np.empty((len(gamma), 6, arm.bundles))
    parallel.run(
        partial(jacobian.jacobians, table, gamma[b], tips[b], out[b])
        for b in parallel.blocks(len(gamma), BLOCK // 8)
    )
    return tips, out


def configuration(
    arm: Manipulator,
    activation: ArrayLike,
    stations: int | ArrayLike = 101,
    tol: float = 1e-6,
) -> xr.Dataset:
    """The whole shape of the arm: centerline, directors, curvature and extension along Z.

    Args:
        arm: The design.
        activation: γ [-], shape (bundles,), or (n, bundles) for a leading `sample` dimension.
        stations: Number of stations, evenly spaced from base to tip, or their Z [m], ascending.
        tol: Largest position error, in L.

    Returns:
        Dataset with `position` [m], `directors` (d1, d2, d3), `curvature` u [1/m] in the directors,
        `extension` ζ and `radius` R2 [m], over `station` (coordinate Z [m]).

    Raises:
        InvalidInput: Activations or stations of another shape or out of range.
    """
    gamma = arm.check_activations(np.atleast_2d(np.asarray(activation, float)))
    z = _checked_stations(arm, stations)
    nodes, ends = station_steps(arm, z, tol)
    position, directors = np.empty((len(gamma), len(z), 3)), np.empty((len(gamma), len(z), 3, 3))
    table = rod.pack(*nodes)
    parallel.run(
        partial(frames.frames, table, ends, gamma[b], position[b], directors[b])
        for b in parallel.blocks(len(gamma), 1024)
    )
    local = actuation(arm, z)
    dataset = schema.configuration_dataset(
        arm,
        gamma,
        z,
        position=position,
        directors=directors,
        curvature=np.einsum("scf,nf->nsc", local.curvature, gamma),
        extension=1.0 + gamma @ local.extension.T,
    )
    return dataset.isel(sample=0) if np.ndim(activation) == 1 else dataset


def _checked_stations(arm: Manipulator, stations: int | ArrayLike) -> Array:
    if np.ndim(stations) == 0:
        count = int(np.asarray(stations))
        if count < 2:
            raise InvalidInput("stations", stations, "2 or more, or the stations' Z in m")
        return np.linspace(0.0, arm.length, count)
    z = np.asarray(stations, float)
    inside = z.ndim == 1 and z.size > 0 and np.isfinite(z).all()
    if not inside or z[0] < 0 or z[-1] > arm.length or (np.diff(z) < 0).any():
        raise InvalidInput("stations", stations, f"ascending Z within [0, {arm.length:g}] m")
    return z
