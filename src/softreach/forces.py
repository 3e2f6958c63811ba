"""Forces that a tip can exert: the blocked force, the largest of a tip fixed in its place."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.actuators import LengthTendon
from softreach.arm.manipulator import Manipulator
from softreach.force_growth import Grown, Growth, PushingTip, Stop
from softreach.inverse import solve_inverse
from softreach.inverse.request import as_activations
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.schema import AXES, activation_attributes, bundle_coordinates, provenance
from softreach.stiffness import yielding_rod
from softreach.support.arrays import Array, as_directions, as_floats, as_points
from softreach.support.errors import InvalidInput
from softreach.support.progress import Progress, as_progress

if TYPE_CHECKING:
    import xarray as xr

_Best = tuple[Array, Grown, float, bool]  # Start, end, error of the tip, whether it settles
_MEANINGS = " ".join(f"{stop.value}={stop.name.lower()}" for stop in Stop)


def blocked_force(
    arm: Manipulator | TipMap,
    places: ArrayLike | None,
    direction: ArrayLike,
    *,
    start: ArrayLike | None = None,
    tol: float = 1e-6,
    progress: Progress | None = None,
) -> xr.Dataset:
    """The largest force along a direction that the tip exerts while it is held at a place.

    What holds the tip pushes back against the direction alone, not sideways. The force begins at
    zero and grows along a path of stable equilibria until bounds of bundles, a singular shape or
    the loss of stability end it. With three free bundles the path is a curve, dγ/dF = J⁻¹C d with
    J = ∂r/∂γ and C = ∂r/∂F, and its end is exact. With more of them the force is the largest in
    the neighborhood of the path's end, where the conditions of an optimum hold; from another start
    it may be larger, and the largest over all starts is given. With fewer than three free bundles
    no change of activations keeps the tip in its place, and there is no such force.

    Args:
        arm: A design with three free bundles or more, or its tip map.
        places: Places at which the tip is held [m], shape (n, 3); None for the tips of `start`.
        direction: Along which the tip pushes, of any length, shape (3,) or (n, 3).
        start: Activations near which the force begins to grow [unit of each], shape (bundles,) or
            (n, bundles); by default all that `solve_inverse` finds for the places.
        tol: Largest tip error, in L.
        progress: Called with the number of places done since its last call.

    Returns:
        Dataset over `place`: `force` [N] with `force_error` from the tip error, the `activation`
        and the `start_activation`, `tip_force`, which then acts on the tip [N], `status`, which
        says what ended the growth, and `limit` (place, bundle), true for bundles at the bounds that
        did. `settles` says whether the force alone, raised from the posture of these activations,
        leads there; else only the way along which the tip was held does. NaN where no stable start
        was found.

    Raises:
        InvalidInput: Arguments of another shape or not finite, or fewer than three free bundles.
        InvalidDesign: A material has no Young's modulus.

    Examples:
        >>> arm = sr.designs.three_tendon_robot()
        >>> found = sr.forces.blocked_force(arm, None, [0, 0, 1], start=[4, 4, 4])
        >>> print(f"{found.force.values[0]:.2f} N")
        0.63 N
    """
    as_directions("direction", direction)
    progress = as_progress(progress)
    rod = as_tip_map(arm, tol)
    if rod.arm.drives or any(isinstance(part, LengthTendon) for part in rod.arm.actuators):
        hint = "ask the arm whose tendons are driven by tension, without drives"
        raise InvalidInput("arm", "driven", "one whose activations load its sections", hint)
    yielding = yielding_rod(rod)
    if rod.box.dimension < 3:
        allowed = "3 or more to keep the tip in its place"
        raise InvalidInput("free bundles", rod.box.dimension, allowed)
    targets, starts = _starts(rod, places, start)
    directions = as_directions("direction", direction, len(targets))
    best = []
    for target, along, choice in zip(targets, directions, starts, strict=True):
        push, place = rod.pose.directions_to_base(along), rod.pose.to_base(target)
        choice = rod.inputs.activations(choice)
        results = [each for gamma in choice if (each := _grown(yielding, push, place, gamma))]
        best.append(max(results, key=lambda each: each[1].fixed.force, default=None))
        progress(1)
    return _dataset(rod, targets, directions, best)


def _starts(
    rod: TipMap, places: ArrayLike | None, start: ArrayLike | None
) -> tuple[Array, list[Array]]:
    if start is None:
        if places is None:
            raise InvalidInput("places", None, "given, or `start`")
        targets = as_points("places", places)
        solutions = solve_inverse(rod, targets, from_rest=True)
        return targets, [solution.activations for solution in solutions]
    if places is None:
        gamma = rod.check_activations("start", np.atleast_2d(as_floats("start", start)))
        return rod.tips(gamma), list(gamma[:, None])
    targets = as_points("places", places)
    gamma = rod.box.with_fixed(as_activations("start", start, rod.box, len(targets)))
    return targets, list(gamma[:, None])


def _grown(rod: LoadedRod, direction: Array, place: Array, start: Array) -> _Best | None:
    """The end of the growth from one start, with steps along the arm that `tol` needs there."""
    pushing, allowed = PushingTip(rod, direction, rod.steps), rod.tol * rod.length
    growth = Growth(pushing, place, start, allowed)
    first, end = growth.first, growth.grown()
    while first is not None and end is not None:
        error = pushing.error(*end.fixed)
        if error <= 0.5 * allowed or pushing.is_finest:
            return first.gamma, end, error + growth.residual, pushing.settles(*end.fixed)
        pushing = pushing.finer()
        growth = replace(growth, pushing=pushing)
        end = growth.grown(end.before) or growth.grown()
    return None


def _dataset(rod: TipMap, places: Array, directions: Array, best: list[_Best | None]) -> xr.Dataset:
    import xarray as xr

    n, bundles = len(places), rod.box.bundles
    force, error = np.full((2, n), np.nan)
    activation, begun = np.full((2, n, bundles), np.nan)
    status, limit = np.full(n, Stop.NO_START, np.int8), np.zeros((n, bundles), bool)
    settles = np.zeros(n, bool)
    known = [(k, result) for k, result in enumerate(best) if result is not None]
    for k, (start, end, tip_error, settled) in known:
        force[k], status[k], settles[k] = end.fixed.force, end.stop, settled
        error[k], limit[k] = end.slope * tip_error, end.limits[:bundles]
        activation[k], begun[k] = end.fixed.gamma[:bundles], start[:bundles]
    of_axes, of_bundles = ("place", "axis"), ("place", "bundle")
    units = activation_attributes(rod.arm)
    dead = np.array(yielding_rod(rod).tables.loads.tip_force)
    acting = rod.pose.directions_to_world(dead) - force[:, None] * directions

    def about(meaning: str, unit: str = "1") -> dict[str, str]:
        return {"units": unit, "long_name": meaning}

    return xr.Dataset(
        {
            "position": (of_axes, places, {"units": "m"}),
            "direction": (of_axes, directions, {"units": "1"}),
            "force": ("place", force, about("blocked force", "N")),
            "force_error": ("place", error, about("error of the force", "N")),
            "tip_force": (of_axes, acting, about("force that acts on the tip in the end", "N")),
            "activation": (of_bundles, activation, units),
            "start_activation": (of_bundles, begun, units),
            "status": ("place", status, {"units": "1", "meanings": _MEANINGS}),
            "settles": ("place", settles, about("reached by the force alone, too")),
            "limit": (of_bundles, limit, about("at a bound that keeps the force from growing")),
        },
        {"axis": list(AXES), **bundle_coordinates(rod.arm)},
        {**provenance(rod.arm, rod.frame), "tol": rod.tol},
    )
