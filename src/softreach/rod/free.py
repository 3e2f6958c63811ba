"""Rods of arms, and the free one: activations alone decide its shape."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import lru_cache, partial
from threading import RLock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.stations import Marker
from softreach.arm.tables import Tables, check_extension, strain_stations, tables
from softreach.kernels.rod import frames, jacobian
from softreach.kernels.rod import slopes as derivatives
from softreach.kernels.rod import tips as rod
from softreach.rod.inputs import ActivationBox
from softreach.rod.linearization import Linearization
from softreach.rod.steps import StepRule
from softreach.rod.tip_map import (
    SMALLEST_TOL,
    Frame,
    Frames,
    Shapes,
    Status,
    Strains,
    TipMap,
    TipOutputs,
    TipStatus,
    check_tol,
    drop,
    position_slopes,
)
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.lazy import lazy

_LEVER = 4.0  # of what is off by turning at the tip, over what is off by moving, per length


@dataclass(frozen=True, repr=False)
class ArmRod(TipMap):
    """The rod that one arm is, free or loaded, in the activations of all its bundles.

    Places are in the frame of the base.

    Raises:
        InvalidInput: `tol` out of range.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """

    arm: Manipulator
    """The arm."""
    tol: float = 1e-6
    """Largest tip error over L [-]."""
    fixed_steps: int | None = None
    """Steps along the arm, if nothing breaks it, in place of those that `tol` needs; an arm in so
    many steps is known to keep ζ > 0."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "tol", check_tol(self.tol))
        if self.fixed_steps is None:
            check_extension(self.arm)

    @property
    def frame(self) -> Frame:
        """That of the base, which is the world's where the arm stands upright at its origin."""
        return "world" if self.arm.base.is_identity else "base"

    @lazy
    def box(self) -> ActivationBox:
        return ActivationBox.between(self.arm.bounds, self.arm.bundle_names)

    @property
    def point(self) -> Marker | None:
        return self.arm.pointed

    @lazy
    def end(self) -> float:
        """Z of the section that the point goes with [m]."""
        return self.length if self.point is None else self.point.station_at("station", self.length)

    @lazy
    def offset(self) -> Array:
        """The point from the center of its section, in the directors [m], shape (3,)."""
        return np.zeros(3) if self.point is None else np.array(self.point.offset)

    @lazy
    def reach(self) -> float:
        """Distance of the point from the center of its section [m]."""
        return float(np.linalg.norm(self.offset))

    @lazy
    def _tip_tol(self) -> float:
        """Tolerance of the center of the section, with which the point is within `tol`."""
        return max(self.tol / (1.0 + _LEVER * self.reach / self.length), SMALLEST_TOL)

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        """A step turns the arm by η |Uγ| R2 dS."""
        table, profile = tables_at(self.arm, strain_stations(self.arm).tobytes()), self.arm.profile
        step = profile.radius(table.stations) * (profile.slender_length / self.steps)
        least, most = np.empty((2, len(gamma)))
        with np.errstate(all="ignore"):  # what overflows is no arm
            for block in parallel.blocks(len(gamma), 1024):
                # By BLAS, whose rounding does not matter to bounds of sense.
                extension = eta = 1.0 + gamma[block] @ table.extension.T
                if table.has_forces:
                    eta = 1.0 + gamma[block] @ table.rest_length_factor.T
                bend = np.tensordot(table.curvature, gamma[block], ([2], [1])).transpose(1, 0, 2)
                least[block] = np.minimum(extension, eta).min(axis=1)
                most[block] = (eta * step * np.linalg.norm(bend, axis=0).T).max(axis=1)
        return least, most

    def with_moments(self, gamma: Array, z: Array) -> tuple[Frames, Array, Status]:
        """Frames at ascending stations Z [m], m in the directors there [N m], and the status.

        Without loads m is 0, shape (n, station, 3).
        """
        shapes = self.shapes(gamma, z, ())
        return Frames(*shapes[:2]), np.zeros((len(gamma), len(z), 3)), shapes.status

    @abstractmethod
    def _prepare(self) -> None:
        """Compute what every sample needs."""

    def prepare(self) -> None:
        known = vars(self)
        if "_is_prepared" in known:
            return
        with known.setdefault("_lock", RLock()):
            if "_is_prepared" not in known:
                self._prepare()
                known["_is_prepared"] = True

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_lock"}


@dataclass(frozen=True, repr=False)
class FreeRod(ArmRod):
    """r' = ζ d3, dᵢ' = η Uγ × dᵢ with ζ = 1 + z·γ, in Magnus steps of order 6: (18)."""

    @lazy
    def rule(self) -> StepRule:
        """Rule by which the arm is cut into steps."""
        return StepRule(self.arm, self.box)

    @property
    def steps(self) -> int:
        """The number of steps that `tol` needs, those that end at breakpoints included."""
        return len(self.rule.edges(self._fineness)) - 1

    @lazy
    def _fineness(self) -> int:
        """Uniform steps in S, of which none may be longer."""
        return self.fixed_steps or self.rule.steps_for(self._tip_tol)

    @lazy
    def _shape_steps(self) -> int:
        """Steps with which `tol` holds all along the arm, and directors lose no digits."""
        return self.fixed_steps or max(self._fineness, self.rule.steps_for_shapes(self.tol))

    @lazy
    def table(self) -> Array:
        """Node tables of the steps up to the section of the point, as `kernels.rod.tips.pack`."""
        stations = None if self.end == self.length else np.array([self.end])
        return self.rule.packed(self.rule.edges(self._fineness, stations))

    def _prepare(self) -> None:
        self.table  # noqa: B018

    def fill(self, gamma: Array, out: TipOutputs) -> None:
        """Put tips, and what else is wanted, into place: theory (25) and (31)."""
        tips, slopes, twists, status, directions = out
        has_offset = self.reach > 0.0
        if has_offset and slopes is not None and twists is None:
            twists = np.empty((len(gamma), 6, gamma.shape[1]))
        if twists is not None:
            jacobian.jacobians(self.table, gamma, tips, twists)
        elif slopes is not None:
            derivatives.slopes(self.table, gamma, tips, slopes)
        else:
            rod.tips(self.table, gamma, tips)
        if has_offset or directions is not None:
            place, directors = np.empty((len(gamma), 1, 3)), np.empty((len(gamma), 1, 3, 3))
            frames.frames(*self._tip_table, gamma, place, directors)
            add_offset(tips, self.offset, directors[:, 0])
            if directions is not None:
                directions[:] = directors[:, 0, 2]
        if slopes is not None and twists is not None:
            position_slopes(tips, twists, slopes)
        if status is not None:
            status[:] = TipStatus.STABLE

    def farthest(self) -> float:
        """The length of the longest arm [m]."""
        return self._linearization.longest_arm

    def linearization_error(self, half_widths: Array) -> float:
        return self._linearization.error(half_widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        return self._linearization.errors(centers, half_widths)

    @lazy
    def _linearization(self) -> Linearization:
        return Linearization(self.arm, self.box, self.end, self.reach)

    def shapes(self, activations: ArrayLike, framed: ArrayLike, strained: ArrayLike) -> Shapes:
        """Centerlines and directors, and u = Uγ η/ζ and ζ = 1 + z·γ: theory (7)."""
        gamma, lost = self.with_arms(self.box.check(activations))
        z, at = np.asarray(framed, float), np.asarray(strained, float)
        strains = per_length(*linear_strains(tables_at(self.arm, at.tobytes()), gamma))
        places, directors = np.empty((len(gamma), len(z), 3)), np.empty((len(gamma), len(z), 3, 3))
        if len(z):
            is_tip = len(z) == 1 and z[0] == self.end
            packed = self.rule.packed_stations
            table = self._tip_table if is_tip else packed(z, self._shape_steps)
            parallel.run(
                partial(frames.frames, *table, gamma[b], places[b], directors[b])
                for b in parallel.blocks(len(gamma), 1024)
            )
        shapes = Shapes(places, directors, *strains, np.zeros(len(gamma), np.int8))
        drop(lost, shapes.status, *shapes[:4])
        return shapes

    @lazy
    def _tip_table(self) -> tuple[Array, NDArray[np.int64]]:
        steps = max(self._fineness, self.rule.fewest_steps())
        return self.rule.packed_stations(np.array([self.end]), steps)


def add_offset(tips: Array, offset: Array, directors: Array) -> None:
    """Move tips (n, 3) by an offset in their directors (n, 3, 3); by nothing, bit for bit."""
    for k in np.flatnonzero(offset):
        tips += offset[k] * directors[:, k]


@lru_cache(maxsize=64)
def tables_at(arm: Manipulator, stations: bytes) -> Tables:
    """Tables at the stations [m] of these bytes, kept for the next block of activations."""
    return tables(arm, np.frombuffer(stations))


def linear_strains(table: Tables, gamma: Array) -> tuple[Array, Array, Array]:
    """Uγ, ζ = 1 + z·γ and η at the stations of a table: theory (7).

    Samples vary fastest in memory, so that all values at one station lie side by side. The sum runs
    over the bundles in their order, so that BLAS and its threads do not decide the rounding.

    Returns:
        Curvature [1/m] in the directors, per length of η, shape (n, station, 3); ζ [-] and η [-],
        what fibers and muscles make of the length of matter at rest, shape (n, station) each.
    """
    parts = [table.curvature, table.extension[:, None]]
    parts += [table.rest_length_factor[:, None]] if table.has_forces else []
    rows, bundles = np.concatenate(parts, axis=1), np.ascontiguousarray(gamma.T)
    columns = rows.shape[1]
    total, term = np.zeros((len(rows), columns, len(gamma))), np.empty((columns, len(gamma)))
    for row, out in zip(rows, total, strict=True):  # station by station, so that terms stay cached
        for j, bundle in enumerate(bundles):
            product = np.multiply(row[:, j : j + 1], bundle, out=term if j else out)
            if j:
                out += product
    total[:, 3:] += 1.0
    extension = total[:, 3].T
    eta = total[:, 4].T if table.has_forces else extension
    return np.moveaxis(total[:, :3], 2, 0), extension, eta


def per_length(curvature: Array, extension: Array, eta: Array) -> Strains:
    """Strains with curvature per length as it is, from curvature per length of η."""
    if eta is not extension:
        curvature = curvature * (eta / extension)[..., None]
    return Strains(curvature, extension)
