"""All directions that the tip may have at one place: the poses of a redundant arm there.

Activations that put the tip at a place form curves with four free bundles, surfaces with five, and
so on. From some of them steps along ker ∂r/∂γ, each led back to the place, lead to the others of
the same piece: one pose is kept in each cell of the activation box that a step enters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.inverse.prepared import PreparedMap, prepared_map
from softreach.inverse.solve import solve_inverse
from softreach.rod.tip_map import Frame, TipMap
from softreach.schema import activation_attributes, bundle_coordinates, provenance
from softreach.support.arguments import as_number
from softreach.support.arrays import Array, Mask, as_points
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.workspace.search import CLOSELY, nearest_tips

if TYPE_CHECKING:
    import xarray as xr

_SEEDS = 24  # poses from which steps begin
_RESIDUAL = 1e-10  # |tip - place| of poses, in L
_MOST = 200_000  # poses


def directions_at(
    arm: Manipulator | TipMap | PreparedMap,
    place: ArrayLike,
    *,
    spacing: float = 0.05,
    seed: int = 0,
    tol: float = 1e-6,
    frame: Frame = "world",
    point: str | None = None,
) -> xr.Dataset:
    """The directions that the tip can have at a place, each with an activation.

    With three free bundles these are the directions of all solutions. With more they are a net over
    the family of solutions, which steps from 24 of them spread over; a piece of the family that
    holds none of these is not found. Of an arm under loads only postures from rest count.

    Args:
        arm: The design, its tip map, or what `prepared_map` made of it.
        place: Where the tip is to be [m], shape (3,).
        spacing: Length of a step, and edge of the cells with one pose each, in ranges of the
            activations [-].
        seed: Seed of the solutions from which steps begin.
        tol: Largest error of the tips, in L.
        frame: That of the place and of directions: "world", or "base".
        point: Name of the marker that counts as the tip; by default that of the design.

    Returns:
        Dataset over `pose`: `activation` (pose, bundle) [unit of each] and `direction`
        (pose, axis), the unit tangents d3 of the tip. The attribute `direction_error` [rad] is
        twice the largest angle by which a direction turned in one step: no direction of the pieces
        found is farther than about that from one of these.

    Raises:
        InvalidInput: No such place, or a spacing outside [0.001, 0.5].
        NotPossible: The arm does not reach the place, or more than 200,000 poses are that close.
    """
    prepared = prepared_map(arm, tol, frame=frame, point=point)
    target = as_points("place", place)
    if len(target) != 1:
        raise InvalidInput("place.shape", np.shape(place), "(3,)")
    spacing = as_number("spacing", spacing, Range(1e-3, 0.5))
    solution = solve_inverse(
        prepared, target, family=_SEEDS, seed=seed, from_rest=True, residual_over_length=_RESIDUAL
    )[0]
    if not len(solution):
        raise NotPossible(f"The tip does not reach the place: {solution}")
    tip_map, whole = prepared.tip_map, prepared.whole
    gamma, turn = (solution.activations / whole.measures)[:, whole.box.free], 0.0
    if prepared.dimension > 3:
        gamma, turn = _spread(tip_map, target[0], gamma, spacing)
    return _dataset(prepared, gamma, 2.0 * turn)


def _dataset(prepared: PreparedMap, gamma: Array, error: float) -> xr.Dataset:
    import xarray as xr

    whole = prepared.whole
    activation = whole.box.with_fixed(gamma) * whole.measures
    of_activation = activation_attributes(whole.arm, whole.box.names)
    return xr.Dataset(
        {
            "activation": (("pose", "bundle"), activation, of_activation),
            "direction": (("pose", "axis"), prepared.tip_map.tip_directions(gamma)),
        },
        {"axis": ["x", "y", "z"]} | bundle_coordinates(whole.arm, whole.box.names),
        provenance(whole.arm, whole.frame) | {"direction_error": error},
    )


def _spread(tip_map: TipMap, place: Array, seeds: Array, spacing: float) -> tuple[Array, float]:
    """A pose in each cell that steps from seeds enter, and the largest turn of one step [rad]."""
    cells = dict[bytes, Array]()
    front, turn, most = _new(cells, tip_map, seeds, spacing), 0.0, _RESIDUAL * tip_map.length
    while len(front):
        ways = _tangents(tip_map, front)
        steps = front[:, None] + spacing * ways * tip_map.box.scales
        start = tip_map.box.clip(steps.reshape(-1, front.shape[1]))
        target = np.broadcast_to(place, (len(start), 3)).copy()
        ends = nearest_tips(tip_map, start, target, most, CLOSELY)
        kept = ends.distance <= most
        source, gamma = np.repeat(front, ways.shape[1], axis=0)[kept], ends.gamma[kept]
        along = (np.abs(gamma - source) / tip_map.box.scales).max(axis=1, initial=0.0)
        turn = max(turn, _largest_turn(tip_map, source, gamma, along < 2.0 * spacing))
        front = _new(cells, tip_map, gamma, spacing)
        if len(cells) > _MOST:
            raise NotPossible(f"More than {_MOST:,} poses at spacing {spacing}: take a larger one")
    return np.array(list(cells.values())), turn


def _new(cells: dict[bytes, Array], tip_map: TipMap, gamma: Array, spacing: float) -> Array:
    """Those of activations (n, m) that lie in a cell without one; their cells are taken."""
    at = np.floor((gamma - tip_map.box.low) / (spacing * tip_map.box.scales)).astype(np.int16)
    before = len(cells)
    for key, values in zip(at, gamma, strict=True):
        cells.setdefault(key.tobytes(), values)
    return np.array(list(cells.values())[before:]).reshape(-1, gamma.shape[1])


def _tangents(tip_map: TipMap, gamma: Array) -> Array:
    """Unit vectors along ker ∂r/∂γ, both ways along each axis, in ranges, (n, 2 (m - 3), m)."""
    slopes = tip_map.tips_and_slopes(gamma)[1] * tip_map.box.scales
    kernel = np.linalg.svd(slopes)[2][:, 3:]
    return np.concatenate([kernel, -kernel], axis=1)


def _largest_turn(tip_map: TipMap, source: Array, gamma: Array, near: Mask) -> float:
    before, after = tip_map.tip_directions(source[near]), tip_map.tip_directions(gamma[near])
    chord = np.linalg.norm(after - before, axis=1).max(initial=0.0)
    return 2.0 * float(np.arcsin(min(1.0, 0.5 * chord)))
