"""From the activations of an arm to those of its inner arm, which the sections see.

Displacements of tendons become tensions, and the rest shape is a bundle that is held at 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import LengthTendon, Tendon
from softreach.arm.body import STRAIGHT, RestStrains
from softreach.arm.guides import arc_loads, has_guides
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import ends_over, range_of_extension, strain_stations, tables
from softreach.arm.tensions import LengthLaw, PulledTendons
from softreach.support.arrays import Array, Mask
from softreach.support.errors import Fault, InvalidDesign
from softreach.support.lazy import lazy

_MOST_CORNERS = 1024
_INSIDE = 256
_SAFETY = 1.25  # of the largest tensions that samples reach
_LEAST_EXTENSION = 0.05  # that a box of tensions has


@dataclass(frozen=True)
class Driving:
    """The map from the inputs x of an arm to the activations of its inner arm, γ(x)."""

    arm: Manipulator
    pulled: PulledTendons | None = None  # Those of the arm under loads; None without
    is_effective: bool = False  # True if x are inputs beyond the dead zones of the drives

    @lazy
    def driven(self) -> Manipulator:
        """The arm; if x are effective inputs, with drives that begin beyond their dead zones."""
        if not self.is_effective or not any(drive.dead_zone for drive in self.arm.drives):
            return self.arm
        ends = ((drive, drive.effective(np.array(drive.bounds))[0]) for drive in self.arm.drives)
        drives = (drive.replace(bounds=tuple(u.tolist()), dead_zone=0.0) for drive, u in ends)
        return self.arm.replace(drives=tuple(drives))

    @lazy
    def law(self) -> LengthLaw:
        """Law of the tendons that are driven by length, without loads."""
        return LengthLaw(body_of(self.arm)) if self.pulled is None else self.pulled.law

    @lazy
    def is_bundles(self) -> bool:
        """True if the activations of the bundles are those of the inner arm."""
        pulled = any(isinstance(each, LengthTendon) for each in self.arm.actuators)
        return not (pulled or has_guides(self.arm))

    @lazy
    def is_affine(self) -> bool:
        """True if γ(x) is affine, so that it has no kinks."""
        return self.is_bundles and not self._has_kinked_drives

    @lazy
    def _has_kinked_drives(self) -> bool:
        is_cut = self._pulls & (self._reached()[:, 0] < 0.0)
        return any(drive.dead_zone for drive in self.driven.drives) or bool(is_cut.any())

    @lazy
    def is_smooth(self) -> bool:
        """True if γ(x) has no kinks within the bounds: is affine, or all lengths stay taut."""
        if self.is_affine:
            return True
        if self._has_kinked_drives or not self.law.columns.size:
            return not self._has_kinked_drives
        if self.arm.loads is not None or self.law.works.growing.size:
            return False
        low, high = self.driven.input_bounds.T
        bundles = self.bundles(low + pilot(self.arm.inputs) * (high - low))
        return bool(self.tendons.inner(bundles)[1].all())

    @lazy
    def kinks(self) -> list[Array]:
        """Inputs at which a drive alone lets a tendon go slack, for each input in its unit."""
        low, high = self.driven.input_bounds.T
        at_low, kinks = self.offsets + self.gains @ low, list[Array]()
        free = (self.gains != 0.0) & (low < high)
        for k in range(self.arm.inputs):
            alone = np.flatnonzero(self._pulls & free[:, k] & (free.sum(axis=1) == 1))
            kinks.append(np.unique(low[k] - at_low[alone] / self.gains[alone, k]))
        return kinks

    @lazy
    def ranges(self) -> Array:
        """Bounds of the bundles of the inner arm, displacements among them, shape (bundle, 2)."""
        reached = self._reached()
        return np.where(self._pulls[:, None], np.maximum(reached, 0.0), reached)

    def _reached(self) -> Array:
        """Bounds of the bundles, if tendons could push."""
        bounds = self.driven.input_bounds.copy()
        for k, drive in enumerate(self.driven.drives):
            bounds[k] = drive.effective(bounds[k])[0]
        return self.offsets[:, None] + ends_over(self.gains, bounds)

    @lazy
    def gains(self) -> Array:
        """Activation of each bundle of the inner arm per effective input, (bundle, input)."""
        names, alone = self.arm.bundle_names, list(self.arm.undriven)
        gains = np.zeros((self.law.arm.bundles, self.arm.inputs))
        for k, drive in enumerate(self.arm.drives):
            for name, gain in drive.gains.items():
                gains[names.index(name), k] = gain
        gains[alone, len(self.arm.drives) + np.arange(len(alone))] = 1.0
        return gains

    @lazy
    def offsets(self) -> Array:
        """Activation of each bundle of the inner arm at inputs of 0; 1 of the rest shape."""
        offsets = self.law.rest[0].copy()
        for drive in self.arm.drives:
            for name, offset in drive.offsets.items():
                offsets[self.arm.bundle_names.index(name)] += offset
        return offsets

    @lazy
    def _pulls(self) -> Mask:
        pulls = np.zeros(self.law.arm.bundles, bool)
        for k, actuator in enumerate(self.arm.bundle_actuators):
            by_tension = isinstance(actuator, Tendon) and not isinstance(actuator, LengthTendon)
            pulls[k] = by_tension and k not in self.arm.undriven
        return pulls

    def bundles(self, x: Array) -> Array:
        """Activations of all bundles of the inner arm, displacements among them."""
        return self._of_drives(x)[0]

    def _of_drives(self, x: Array) -> tuple[Array, Array]:
        """The same with their derivatives along x, shape (n, inner bundle, input)."""
        effective, slopes = x.copy(), np.ones(x.shape)
        for k, drive in enumerate(self.driven.drives):
            effective[:, k], slopes[:, k] = drive.effective(x[:, k])
        bundles = np.tile(self.offsets, (len(x), 1))
        for k in range(x.shape[1]):  # in their order, whatever BLAS and its threads would do
            bundles += effective[:, k, None] * self.gains[:, k]
        slack = self._pulls & (bundles < 0.0)
        bundles[slack] = 0.0
        return bundles, np.where(slack[..., None], 0.0, slopes[:, None] * self.gains)

    def activations(self, x: Array) -> Array:
        """γ at checked x (n, inputs); NaN where no tensions are found."""
        bundles = self.bundles(x)
        return bundles if self.is_bundles else self.tendons.inner(bundles)[0]

    def with_slopes(self, x: Array) -> tuple[Array, Array]:
        """γ (n, inner bundle) with ∂γ/∂x (n, inner bundle, input), of taut tendons."""
        bundles, of_drives = self._of_drives(x)
        if self.is_bundles:
            return bundles, of_drives
        inner, is_taut = self.tendons.inner(bundles)
        return inner, self.tendons.slopes(inner, is_taut) @ of_drives

    @lazy
    def tendons(self) -> LengthLaw | PulledTendons:
        """How the arm takes what is pulled in, and guides."""
        if self.pulled is not None:
            return self.pulled
        return PulledTendons(self.law) if has_guides(self.arm) else self.law

    def with_dead_zones(self, x: Array) -> Array:
        """Inputs of the arm at x (n, inputs), with the dead zones that effective ones leave."""
        if not self.is_effective:
            return x
        zones = np.zeros(x.shape[1])
        zones[: len(self.arm.drives)] = [drive.dead_zone for drive in self.arm.drives]
        return x + np.sign(x) * zones


def inner_arm(arm: Manipulator) -> Manipulator:
    """The arm as tables and kernels see it, with bounds that hold what activations lead to.

    It is the arm itself where inputs load its sections as they are: else see `body_of`.

    Raises:
        InvalidDesign: Displacements within the bounds shorten the arm to nothing.
    """
    return arm if arm.is_direct else _inner_arm(arm)


@lru_cache(maxsize=64)
def _inner_arm(arm: Manipulator) -> Manipulator:
    driving, body = Driving(arm), body_of(arm)
    bounds = driving.ranges.copy()
    if driving.is_bundles:
        return body.with_bounds(bounds)
    low, high = arm.input_bounds.T
    gamma = driving.activations(low + pilot(arm.inputs) * (high - low))
    known = np.isfinite(gamma).all(axis=1)
    if not (known.any() if driving.law.columns.size else known.all()):
        allowed = "let the arm buckle between guides: narrow the bounds, or add guides"
        raise InvalidDesign([Fault("activation_bounds", arm.input_bounds.tolist(), allowed)])
    gamma = gamma[known]
    rates = tables(body, strain_stations(body)).extension
    least = float(1.0 + (gamma @ rates.T).min())
    if not least > 0.0:
        allowed = f"shortens the arm to nothing, with extension ζ = {least:.4g}; "
        allowed += "must keep ζ > 0: narrow the bounds"
        given = bounds[driving.law.columns].tolist()
        raise InvalidDesign([Fault("displacement_bounds", given, allowed)])
    most = _SAFETY * gamma.max(axis=0) + _against_loads(arm)
    columns = driving.law.columns
    bounds[columns] = np.stack([np.zeros(len(columns)), most[columns]], axis=1)
    if has_guides(arm):
        loads = slice(bounds.shape[0] - body.actuators[-1].bundles, None)
        size = _SAFETY * np.abs(gamma[:, loads]).max(axis=0)
        bounds[loads] = np.stack([-size, size], axis=1)
    pulled = (x.by_tension() if isinstance(x, LengthTendon) else x for x in body.actuators)
    return body.replace(actuators=tuple(pulled)).with_bounds(_fitting(bounds, columns, rates))


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
    """The arm without drives, its rest shape as a bundle held at 1, loads of arcs as others."""
    if not arm.drives and arm.rest.is_straight and not has_guides(arm):
        return arm
    if (known := vars(arm).get("_body")) is None:
        name, actuators = "rest shape", list(arm.actuators)
        while name in arm.bundle_names:
            name += "'"
        if not arm.rest.is_straight:
            held = RestStrains(name=name, shape=arm.rest, activation_bounds=(1.0, 1.0))
            actuators.append(held)
        if (loads := arc_loads(arm)) is not None:
            actuators.append(loads)
        known = arm.replace(drives=(), actuators=tuple(actuators), rest=STRAIGHT)
        vars(arm)["_body"] = known
    return known


def cube_corners(count: int, rng: np.random.Generator) -> Array:
    """Corners of the unit cube, shape (n, count): all, or 1,024 at random with both extremes."""
    if 2**count <= _MOST_CORNERS:
        return np.indices((2,) * count).reshape(count, 2**count).T.astype(float)
    corners = rng.integers(0, 2, (_MOST_CORNERS, count)).astype(float)
    corners[:2] = [[0.0], [1.0]]
    return corners


def pilot(count: int) -> Array:
    """Corners of the unit cube, no more than 1,024 of them, and points inside."""
    rng = np.random.default_rng(0)
    return np.concatenate([cube_corners(count, rng), rng.random((_INSIDE, count))])


def _fitting(bounds: Array, columns: NDArray[np.intp], rates: Array) -> Array:
    """The bounds, with lower tensions where all of them at once would shorten the arm to nothing.

    Displacements never lead to all at once: what they lead to was looked at before.
    """
    ends = (rates[..., None] * bounds).min(-1)
    others = 1.0 + np.delete(ends, columns, axis=1).sum(1)
    pulled = -ends[:, columns].sum(1)
    share = float(((1.0 - _LEAST_EXTENSION) * others / np.maximum(pulled, 1e-300)).min())
    fitting = bounds.copy()
    fitting[columns] *= min(1.0, share)
    return fitting


def extension_range(arm: Manipulator) -> tuple[float, float]:
    """Smallest and largest ζ anywhere in the activation box and along the arm [-]."""
    arm = inner_arm(arm)
    return range_of_extension(arm, tables(arm, strain_stations(arm)).extension)
