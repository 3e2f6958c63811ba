"""From the activations of an arm to those of its inner arm, which the sections see.

Displacements of tendons become tensions, and the rest shape is a bundle that is held at 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import LengthTendon
from softreach.arm.rest_shape import STRAIGHT, RestStrains
from softreach.arm.tables import strain_stations, tables
from softreach.arm.tensions import LengthLaw, Tensions
from softreach.support.errors import Fault, InvalidDesign

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = ["Driving", "InnerActivations", "body_of", "inner_arm", "pilot"]

Array = NDArray[np.float64]

_MOST_CORNERS = 1024
_INSIDE = 256
_SAFETY = 1.25  # of the largest tensions that samples reach
_LEAST_EXTENSION = 0.05  # that a box of tensions has


@dataclass(frozen=True, eq=False)
class InnerActivations:
    """Activations of the inner arm and their derivatives."""

    values: Array
    """γ, shape (n, inner bundle)."""
    slopes: Array
    """∂γ/∂x, shape (n, inner bundle, bundle)."""


@dataclass(frozen=True, eq=False)
class Driving:
    """The map from the activations x of an arm without loads to those of its inner arm, γ(x)."""

    arm: Manipulator

    @cached_property
    def law(self) -> LengthLaw:
        """Law of the tendons that are driven by length."""
        return LengthLaw(body_of(self.arm))

    @cached_property
    def has_length_tendons(self) -> bool:
        """True if tensions follow from displacements."""
        return any(isinstance(each, LengthTendon) for each in self.arm.actuators)

    def held(self, x: Array) -> Array:
        """Activations of all bundles of the inner arm, displacements among them."""
        count = self.law.arm.bundles - x.shape[1]
        return np.concatenate([x, np.ones((len(x), count))], axis=1)

    def activations(self, x: Array) -> Array:
        """γ at checked x (n, bundles)."""
        bundles = self.held(x)
        if not self.has_length_tendons:
            return bundles
        return self.law.inner(bundles, self.law.tensions(bundles).tension)

    def with_slopes(self, x: Array) -> InnerActivations:
        """γ with ∂γ/∂x."""
        bundles = self.held(x)
        slopes = np.eye(bundles.shape[1], x.shape[1])
        if not self.has_length_tendons:
            return InnerActivations(bundles, np.broadcast_to(slopes, (len(x), *slopes.shape)))
        tensions = self.law.tensions(bundles)
        inner = self.law.inner(bundles, tensions.tension)
        return self.on_taut(bundles, tensions, self.law.shortening_slopes(inner))

    def on_taut(self, bundles: Array, tensions: Tensions, of_strains: Array) -> InnerActivations:
        """γ with ∂γ/∂x on the taut tendons.

        Args:
            bundles: Activations of all bundles with displacements, shape (n, inner bundle).
            tensions: Those that they lead to.
            of_strains: ∂s/∂γ there, shape (n or 1, tendon, inner bundle).
        """
        inner = self.law.inner(bundles, tensions.tension)
        slopes = self.law.slopes(inner, tensions.is_taut, of_strains)
        return InnerActivations(inner, slopes[..., : self.arm.bundles])


def inner_arm(arm: Manipulator) -> Manipulator:
    """The arm as tables and kernels see it, with bounds that hold what activations lead to.

    Raises:
        InvalidDesign: Displacements within the bounds shorten the arm to nothing.
    """
    driving, body = Driving(arm), body_of(arm)
    if not driving.has_length_tendons:
        return body
    low, high = arm.bounds.T
    gamma = driving.activations(low + pilot(arm.bundles) * (high - low))
    rates = tables(body, strain_stations(body)).extension
    least = float(1.0 + (gamma @ rates.T).min())
    if not least > 0.0:
        allowed = f"reaches extension ζ = {least:.4g}; must keep ζ > 0: narrow the bounds"
        bounds = body.bounds[driving.law.columns].tolist()
        raise InvalidDesign([Fault("displacement_bounds", bounds, allowed)])
    most = _SAFETY * gamma.max(axis=0) + _against_loads(arm)
    bounds = body.bounds.copy()
    columns = driving.law.columns
    bounds[columns] = np.stack([np.zeros(len(columns)), most[columns]], axis=1)
    return body.replace(actuators=tuple(_by_tension(body, _fitting(bounds, columns, rates))))


def _against_loads(arm: Manipulator) -> float:
    """A tension that is enough to balance loads, with the lever arm of the farthest tendon [N]."""
    if arm.loads is None:
        return 0.0
    per_length, force = arm.loads.sizes(arm.section, arm.profile)
    force += per_length * arm.length
    outline, radius = arm.outline(np.zeros(1)), float(arm.profile.radius(0.0))
    lever = radius * float(outline.middle_ratio[0].max())
    return 2.0 * force * max(1.0, arm.length / lever)


def body_of(arm: Manipulator) -> Manipulator:
    """The arm with its rest shape, if any, as a bundle held at 1 behind the others."""
    if arm.rest.is_straight:
        return arm
    held = RestStrains(
        name=_unused("rest shape", arm.bundle_names),
        shape=arm.rest,
        activation_bounds=(1.0, 1.0),
    )
    return arm.replace(actuators=(*arm.actuators, held), rest=STRAIGHT)


def pilot(count: int) -> Array:
    """Corners of the unit cube, no more than 1,024 of them, and points inside."""
    rng = np.random.default_rng(0)
    if 2**count <= _MOST_CORNERS:
        corners = np.indices((2,) * count).reshape(count, 2**count).T.astype(float)
    else:
        corners = rng.integers(0, 2, (_MOST_CORNERS, count)).astype(float)
        corners[:2] = [[0.0], [1.0]]
    return np.concatenate([corners, rng.random((_INSIDE, count))])


def _fitting(bounds: Array, columns: NDArray[np.intp], rates: Array) -> Array:
    """The bounds, with lower tensions where all of them at once would shorten the arm to nothing.

    Displacements never lead to all at once: what they lead to was looked at before.
    """
    ends = (rates[..., None] * bounds).min(-1)
    others = 1.0 + np.delete(ends, columns, axis=1).sum(1)
    pulled = 0.0 - ends[:, columns].sum(1)  # no -0.0 where nothing pulls
    with np.errstate(divide="ignore"):
        share = float(((1.0 - _LEAST_EXTENSION) * others / pulled).min())
    fitting = bounds.copy()
    fitting[columns] *= min(1.0, share)
    return fitting


def _by_tension(body: Manipulator, bounds: Array) -> Iterator[object]:
    """Actuators with tendons by tension in place of those by length."""
    first = 0
    for actuator in body.actuators:
        last = first + actuator.bundles
        is_pulled = isinstance(actuator, LengthTendon)
        yield actuator.by_tension(bounds[first:last]) if is_pulled else actuator
        first = last


def _unused(name: str, taken: Sequence[str]) -> str:
    """The name, with a mark for each time that it is taken."""
    return _unused(name + "'", taken) if name in taken else name
