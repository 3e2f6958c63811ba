"""Share of its reachable volume that an arm keeps under a payload, and the payload it can carry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.schema import provenance
from softreach.support.arguments import as_number
from softreach.support.arrays import Array, as_floats, over
from softreach.support.errors import InvalidDesign, InvalidInput, Range
from softreach.support.progress import Progress, as_progress
from softreach.support.quantity import quantity
from softreach.workspace.reach import ACCURACIES, reachable_set

if TYPE_CHECKING:
    import xarray as xr

_USUAL = (0.0, 0.5, 1.0, 2.0, 4.0)  # payloads over the one that bends the arm by about a third
_DOUBLINGS = 6  # of the largest payload, in search of one that is too heavy


def payload_curve(
    arm: Manipulator,
    payloads: ArrayLike | None = None,
    *,
    accuracy: float = 0.01,
    point: str | None = None,
    progress: Progress | None = None,
) -> PayloadCurve:
    """The volume of the exact reachable set under each payload.

    All other loads stay as they are: the reference without payload is the arm under its own weight.

    Args:
        arm: A design with gravity among its loads and three free bundles or more.
        payloads: Masses at the tip [kg], in any order, shape (n,); 0 is added. None for four that
            fit the stiffness of the arm.
        accuracy: Relative error allowed in each volume, as for `reachable_set`.
        point: Name of the marker that counts as the tip; by default that of the design.
        progress: Called with the number of volumes done since its last call.

    Raises:
        InvalidInput: No gravity, fewer than three free bundles, or payloads that are not finite
            masses of 0 or more.
        InvalidDesign: A material has no Young's modulus or no density.

    Warns:
        SoftreachWarning: The estimated error of a volume is larger than asked.
    """
    arm = a_manipulator("arm", arm).at_point(point)
    if arm.loads is None or not any(arm.loads.gravity):
        allowed = "Loads with gravity, which makes a payload heavy"
        hint = "pass arm.replace(loads=Loads(gravity=(0, 0, -9.81)))"
        raise InvalidInput("loads", arm.loads, allowed, hint)
    if faults := arm.loads.section_faults(arm.section, arm.length):
        raise InvalidDesign(faults)
    if (free := sum(low < high for low, high in arm.input_bounds)) < 3:
        raise InvalidInput("free bundles", int(free), "3 or more, which reach a volume")
    masses = _usual_payloads(arm) if payloads is None else as_floats("payloads", payloads).ravel()
    if not (np.isfinite(masses) & (masses >= 0)).all():
        raise InvalidInput("payloads", masses, "finite masses of 0 or more [kg]")
    accuracy, progress = as_number("accuracy", accuracy, ACCURACIES), as_progress(progress)
    masses, volumes = np.unique(np.append(masses, 0.0)), dict[float, _Volume]()
    for mass in masses.tolist():
        volumes[mass] = _volume(arm, mass, accuracy)
        progress(1)
    value, error, lost = np.array(list(volumes.values())).T
    return PayloadCurve(arm, masses, value, error, lost, accuracy, volumes)


class LargestPayload(NamedTuple):
    """The payload up to which an arm keeps a share of its reachable volume."""

    payload: float
    """[kg]"""
    payload_error: float
    """Error of the payload, by the search and by the errors of the volumes [kg]."""
    share: float
    """Share of the volume without payload that is kept [-]."""

    def __repr__(self) -> str:
        mass = quantity(self.payload, "kg", self.payload_error)
        return f"<LargestPayload: {mass} keep {self.share:.0%} of the reachable volume>"


class _Volume(NamedTuple):
    value: float
    error: float
    lost_share: float


@dataclass(frozen=True, eq=False, repr=False)
class PayloadCurve:
    """Reachable volume against payload."""

    arm: Manipulator
    """The design; its own payload does not count."""
    payloads: Array
    """[kg], ascending from 0, shape (n,)."""
    volumes: Array
    """Volume of the exact reachable set under each payload [m³], shape (n,)."""
    volume_errors: Array
    """Error of each volume [m³], shape (n,)."""
    lost_shares: Array
    """Share of the activation box that is left out for want of stability [-], shape (n,)."""
    accuracy: float
    """Relative error allowed in each volume [-]."""
    _known: dict[float, _Volume]

    @property
    def shares(self) -> Array:
        """Share of the volume without payload that is left [-], shape (n,)."""
        return self.volumes / self.volumes[0]

    @property
    def share_errors(self) -> Array:
        """Error of each share; that of the first is 0 [-], shape (n,)."""
        first = self.volume_errors[0] * self.shares
        errors = (self.volume_errors + first) / self.volumes[0]
        return np.where(self.payloads > 0, errors, 0.0)

    def largest_payload(self, share: float, *, accuracy: float = 0.01) -> LargestPayload:
        """The payload up to which the arm keeps a share of the volume without payload.

        Found by further volumes, not by interpolation: the first payload on the curve that leaves
        less than the share is bracketed, beyond the curve's end if need be, and the bracket made
        smaller.

        Args:
            share: Of the volume without payload, between 0 and 1.
            accuracy: Relative error allowed in the search for the payload.

        Raises:
            InvalidInput: A share or accuracy out of range, or one that no payload undercuts.
        """
        share = as_number("share", share, Range(0.0, 1.0, open_low=True, open_high=True))
        accuracy = as_number("accuracy", accuracy, Range(1e-4, 0.5))
        bracket = self._bracket(share)
        low, high = _narrowed(lambda mass: self._share(mass) - share, *bracket, accuracy)
        below, above = self._at(low), self._at(high)
        drop = (below.value - above.value) / (high - low)
        # where the curve crosses the share between the two, and how far the volumes let it move
        mass = low + (below.value - share * self.volumes[0]) / drop
        scatter = max(below.error, above.error) + share * self.volume_errors[0]
        off = max(mass - low, high - mass) + scatter / drop
        return LargestPayload(float(mass), float(off), share)

    def to_dataset(self) -> xr.Dataset:
        """Volumes and shares with their errors over `payload` [kg]."""
        import xarray as xr

        shares = {"share": self.shares, "share_error": self.share_errors}
        volumes = {"volume": self.volumes, "volume_error": self.volume_errors}
        values = over("payload", "kg", payload=self.payloads) | over("payload", "m3", **volumes)
        values |= over("payload", "1", **shares, lost_share=self.lost_shares)
        return xr.Dataset(values, attrs={**provenance(self.arm), "accuracy": self.accuracy})

    def __repr__(self) -> str:
        first = quantity(self.volumes[0], "m³", self.volume_errors[0])
        _, *rows = zip(self.payloads, 100 * self.shares, 100 * self.share_errors, strict=True)
        lines = [f"{mass:g} kg: {quantity(share, '%', error)}" for mass, share, error in rows]
        return "\n  ".join([f"PayloadCurve: {first} without payload", *lines])

    def _at(self, mass: float) -> _Volume:
        if mass not in self._known:
            self._known[mass] = _volume(self.arm, mass, self.accuracy)
        return self._known[mass]

    def _share(self, mass: float) -> float:
        return self._at(mass).value / float(self.volumes[0])

    def _bracket(self, share: float) -> tuple[float, float]:
        """Neighbors on the curve of which the heavier is the first to leave less than the share."""
        light = 0.0
        for mass in self.payloads[1:].tolist():
            if self._share(mass) < share:
                return light, mass
            light = mass
        heavy = 2.0 * light or float(_usual_payloads(self.arm)[1])
        for _ in range(_DOUBLINGS):
            if self._share(heavy) < share:
                return light, heavy
            light, heavy = heavy, 2.0 * heavy
        left = f"{self._share(light):.3g} of the volume is left under {light:g} kg"
        raise InvalidInput("share", share, "one that a payload undercuts", left)


def _narrowed(
    function: Callable[[float], float], low: float, high: float, accuracy: float
) -> tuple[float, float]:
    """A smaller bracket of a falling function's root, at most a relative accuracy wide.

    Secants that go a little past the root, so that both ends come near, and halves where too slow.
    """
    at_low, at_high, halve = function(low), function(high), False
    while high - low > accuracy * high:
        root = low + (high - low) * at_low / (at_low - at_high)
        nearer_low = root - low < high - root
        mass = root + (0.4 if nearer_low else -0.4) * accuracy * high
        if halve or not low < mass < high:
            mass = 0.5 * (low + high)
        wide, value = high - low, function(mass)
        if value < 0:
            high, at_high = mass, value
        else:
            low, at_low = mass, value
        halve = not halve and high - low > 0.5 * wide
    return low, high


def _volume(arm: Manipulator, mass: float, accuracy: float) -> _Volume:
    assert arm.loads is not None
    carrying = arm.replace(loads=arm.loads.replace(payload=mass))
    reached = reachable_set(carrying, accuracy=accuracy)
    return _Volume(reached.volume, reached.volume_error, reached.lost_share)


def _usual_payloads(arm: Manipulator) -> Array:
    assert arm.loads is not None
    stiffness = arm.section.stiffness_at(arm.profile, np.array([0.5 * arm.length]))
    softer = min(1.0, arm.section.bending_ratio)
    weight = softer * float(stiffness.bending[0]) / arm.length**2
    mass = weight / float(np.linalg.norm(arm.loads.gravity))
    return float(f"{mass:.1g}") * np.array(_USUAL)
