"""The tip map: from activations to where the tip is, and everything else that a rod can say.

Left of it there is physics and no sample; right of it there are millions of samples and no physics.
Code that needs to know where an arm can go calls a tip map, and reads no field of the arm.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.base import UPRIGHT, Base
from softreach.arm.manipulator import Manipulator
from softreach.arm.stations import Marker
from softreach.rod.inputs import ActivationBox
from softreach.support import parallel
from softreach.support.arguments import as_number
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidInput, Range, counted
from softreach.support.lazy import lazy

Status = NDArray[np.int8]
Frame = Literal["world", "base"]
"""Frame of places: the world, or that of the base, whose z is along the straight arm."""
Device = Literal["cpu", "cuda"]
"""What computes tips: the processor, or a GPU of NVIDIA."""
DEVICES: tuple[Device, ...] = ("cpu", "cuda")

BLOCK = 16_384
"""Samples per task: large against a thread's cost, small enough for Ctrl-C to be prompt."""
SMALLEST_TOL = 1e-12
_FARTHEST = 1e3  # of the bounds, of activations that mean anything
_SLIGHT = 1e-2  # of the bounds, by which a tension may be negative, such as in a difference
MOST_TURN_OF_STEP = 2.0
"""Rotation of one step [rad] up to which the series of the kernels of tips are good to 1e-10."""


class TipStatus(IntEnum):
    """Status of a tip: a stable equilibrium, an unstable one, none, or unknown."""

    STABLE = 0
    """A stable equilibrium."""
    UNSTABLE = 1
    """An unstable equilibrium; its tip is NaN by default."""
    NO_EQUILIBRIUM = 2
    """There is no such arm: it would be shortened to nothing; the tip is NaN."""
    UNDECIDED = 3
    """The branch was not followed to its end, so that it is unknown whether it leads there; the tip
    is NaN."""
    SNAPS = 4
    """The branch of stable postures from rest ends before: the arm snaps to another one; the tip is
    NaN."""


def has_tip(status: Status) -> NDArray[np.bool_]:
    """Mask of each `TipStatus` that is an equilibrium's, stable or not."""
    return status <= TipStatus.UNSTABLE


class InvalidLoads(InvalidInput):
    """Loads under which an arm has no equilibrium, or none that can be computed."""


class TipMap(ABC):
    """The map from the activations of one arm to its tip, to a tolerance; frozen.

    All arrays of activations have shape (n, bundles) and are checked; activations outside the
    bounds are allowed, but `tol` is promised inside them. Where `has_arm` says that there is none,
    tips are NaN with the status `NO_EQUILIBRIUM`. Results do not depend on threads.
    """

    arm: Manipulator
    """The design, to be stored beside results; nothing here looks inside it."""
    tol: float
    """Largest tip error over L [-]."""

    @lazy
    @abstractmethod
    def box(self) -> ActivationBox:
        """The activations within bounds."""

    @abstractmethod
    def fill(self, gamma: Array, out: TipOutputs) -> None:
        """Put tips, and what else is wanted, into place, at checked activations (n, bundles).

        It runs on the calling thread; whoever calls it from several calls `prepare` before.
        """

    def shapes(self, activations: ArrayLike, framed: ArrayLike, strained: ArrayLike) -> Shapes:
        """Arms at stations along them; each equilibrium, of (n, bundles), is found once.

        Centerline and directors are those at `framed` Z [m], curvature and extension those at
        `strained` Z [m], both ascending; there may be none.
        """
        raise NotImplementedError

    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        return Frames(*self.shapes(activations, self.check_stations(stations), ())[:2])

    def strains(self, activations: ArrayLike, stations: ArrayLike) -> Strains:
        """Curvature and extension at stations Z [m], in any order."""
        z = self.check_stations(stations, ascending=False)
        ascending, back = np.unique(z, return_inverse=True)
        shapes = self.shapes(activations, (), ascending)
        if np.array_equal(z, ascending):
            return Strains(shapes.curvature, shapes.extension)
        return Strains(shapes.curvature[:, back], shapes.extension[:, back])

    @property
    def length(self) -> float:
        """L [m], the scale of everything in space."""
        return self.arm.length

    pose: Base = UPRIGHT
    """Pose of the clamped end in the frame of places."""

    @property
    def block(self) -> int:
        """Samples of a task."""
        return BLOCK

    @property
    def device(self) -> str:
        """What computes the tips: "cpu", or the name of a GPU."""
        return "cpu"

    @property
    def point(self) -> Marker | None:
        """The marker that stands for the tip; None for the tip."""
        return None

    @property
    def frame(self) -> Frame:
        """The frame of places and directions."""
        return "world"

    @lazy
    def supports_unstable(self) -> bool:
        """True if a tip can have another status than stable."""
        return False

    @property
    def is_smooth(self) -> bool:
        """True if tips depend smoothly on activations within the bounds, on each branch."""
        return True

    @property
    def kinks(self) -> list[Array]:
        """Values of each activation [its unit] at which the map has a kink, whatever the others."""
        return [np.empty(0)] * self.box.bundles

    @property
    def steps(self) -> int:
        """Steps that an integrator makes along the arm; 0 for a map that has none of its own."""
        return 0

    @lazy
    def measures(self) -> Array:
        """Size of one unit of each activation [unit of its bundle], shape (bundles,)."""
        return np.ones(self.box.bundles)

    def prepare(self) -> None:  # noqa: B027
        """Compute what every sample needs, once for all threads."""

    def continued_from(self, gamma: Array, frames: Array | None = None) -> TipMap:
        """The map of an arm that is in its posture at γ (k, bundles), and moves straight from it.

        Of several postures it moves from that of the nearest. They are its own, or those of `held`
        with these frames. Itself for arms without loads, which have one shape at every activation.
        """
        return self

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        """Smallest ζ, or η, along the arm at activations (n, bundles), shape (n,).

        And the largest angle by which a step turns the arm [rad], shape (n,).
        """
        return np.ones(len(gamma)), np.zeros(len(gamma))

    def has_arm(self, gamma: Array) -> NDArray[np.bool_]:
        """Mask of activations (n, bundles) at which ζ > 0 and the steps follow the arm, shape (n,).

        Within the bounds they do.
        """
        exists = np.ones(len(gamma), bool)
        outside = np.flatnonzero(((gamma < self.box.low) | (gamma > self.box.high)).any(axis=1))
        if len(outside):
            extension, turn = self.extension_and_turn(gamma[outside])
            exists[outside] = (extension > 0) & (turn <= MOST_TURN_OF_STEP)
        return exists

    def check_activations(self, name: str, activations: ArrayLike) -> Array:
        """The activations as an (n, bundles) float array, each of which leaves an arm.

        Raises:
            InvalidInput: Another shape, values that are not finite, ζ <= 0 somewhere along the arm,
                or an arm so bent that the steps do not follow it.
        """
        gamma = self.box.check(activations)
        self._check_sense(name, gamma)
        if not len(wrong := np.flatnonzero(~self.has_arm(gamma))):
            return gamma
        first = gamma[wrong[:1]]
        (extension,), (turn,) = self.extension_and_turn(first)
        why = f"here the arm is shortened to nothing: ζ = {extension:.4g}"
        if extension > 0:
            why = f"here the arm turns by {turn:.3g} rad in a step, too far to be followed"
        lower, upper = map(_listed, (self.box.low, self.box.high))
        count = f"; so are {len(wrong):,} rows in all" if len(wrong) > 1 else ""
        allowed = f"such that the arm has a shape, as between {lower} and {upper}"
        name = name if len(gamma) == 1 else f"{name}[{wrong[0]}]"
        raise InvalidInput(name, _listed(first[0]), allowed, why + count)

    def _check_sense(self, name: str, gamma: Array) -> None:
        """Refuse tensions that push, and what is a thousand times as large as the bounds."""
        arm, box = self.arm, self.box
        kinds = dict(zip(arm.bundle_names, arm.bundle_actuators, strict=True))
        pulls = np.array([getattr(kinds.get(each), "least", -1.0) == 0.0 for each in box.names])
        size = np.maximum(np.abs(box.low), np.abs(box.high))
        size[size == 0.0] = 1.0
        low = -np.where(pulls, _SLIGHT, _FARTHEST) * size
        for row, k in np.argwhere((gamma < low) | (gamma > _FARTHEST * size))[:1]:
            allowed = f"at most {_FARTHEST:g} times as large as its bounds"
            if pulls[k] and gamma[row, k] < 0.0:
                allowed = "at least 0: a tendon pulls and cannot push"
            raise InvalidInput(f"{name}[{row}], {box.names[k]}", f"{gamma[row, k]:g}", allowed)

    def with_arms(self, gamma: Array) -> tuple[Array, NDArray[np.intp]]:
        """Activations (n, bundles), at the lower bounds where they leave no arm, and these rows."""
        lost = np.flatnonzero(~self.has_arm(gamma))
        if len(lost):
            gamma = gamma.copy()
            gamma[lost] = self.box.low
        return gamma, lost

    def farthest(self) -> float:
        """No tip is farther from the base than this [m]; infinite where no bound is known."""
        return np.inf

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box.

        Infinite where no bound is known, so that nothing is proved by it.
        """
        return np.inf

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center (n, bundles), shape (n,).

        No d leads out of the box.
        """
        return np.full(len(centers), self.linearization_error(half_widths))

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held | None:
        """All postures that are held without a snap from rest; None where each γ has one alone.

        That is the part of all stable equilibria that is connected with the posture at rest, with
        those that lean to either side. γ (nodes, bundles) is that of the nodes of a grid of these
        sizes, in C order.
        """
        return None

    def tips(self, activations: ArrayLike) -> Array:
        """Tip positions [m], shape (n, 3)."""
        return self._filled(activations)[0]

    def status(self, activations: ArrayLike) -> Status:
        """`TipStatus` of each activation, shape (n,)."""
        return self.tips_and_status(activations)[1]

    def tips_and_status(self, activations: ArrayLike) -> tuple[Array, Status]:
        """Tips [m], shape (n, 3), NaN without an equilibrium, and their `TipStatus`, (n,)."""
        return self._filled(activations, "status")

    def tips_and_slopes(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m], shape (n, 3), and their derivatives ∂r/∂γ [m], shape (n, 3, bundles)."""
        return self._filled(activations, "slopes")

    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m], shape (n, 3), and spatial twists of the tip frame per unit of each activation.

        They are (v, ω) with v [m] and ω [rad], shape (n, 6, bundles).
        """
        return self._filled(activations, "twists")

    def tip_motions(self, activations: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Tips and their derivatives as `tips_and_slopes` has them, tangents and their turn.

        Tangents d3 [-] have shape (n, 3), and the turns ω [rad] of ∂d3/∂γ = ω × d3 shape
        (n, 3, bundles).
        """
        filled = self._filled(activations, "slopes", "directions", "twists")
        return *filled[:3], filled[3][:, 3:]

    def tip_directions(self, activations: ArrayLike) -> Array:
        """Tangents d3 of the tips [-], shape (n, 3)."""
        return np.ascontiguousarray(self.tip_frames(activations)[:, :, 2])

    def tip_frames(self, activations: ArrayLike) -> Array:
        """Frames of the tips with the directors d1, d2, d3 as columns [-], shape (n, 3, 3)."""
        end = self.length if self.point is None else self.point.station_at("station", self.length)
        return self.frames(activations, [end]).directors[:, 0].transpose(0, 2, 1)

    def _filled(self, activations: ArrayLike, *wanted: str) -> tuple[Any, ...]:
        """Tips, and what else of `TipOutputs` is wanted, on all threads."""
        gamma, lost = self.with_arms(self.box.check(activations))
        n, m = gamma.shape
        room: dict[str, Any] = {"tips": np.empty((n, 3))}
        for name in wanted:
            shape = {"slopes": (n, 3, m), "twists": (n, 6, m), "directions": (n, 3)}.get(name, (n,))
            room[name] = np.empty(shape, np.int8 if name == "status" else float)
        size = self.block
        if len(room) > 1 and wanted != ("status",):
            size //= 16 if self.supports_unstable else 8  # an equilibrium takes a search
        self.prepare()
        tasks: list[Callable[[], object]] = []
        for block in parallel.blocks(n, size):
            out = TipOutputs(**{name: values[block] for name, values in room.items()})
            tasks.append(partial(self.fill, gamma[block], out))
        parallel.run(tasks)
        if len(lost):
            drop(lost, room.get("status"), *(room[name] for name in room if name != "status"))
        return tuple(room.values())

    def radius(self, stations: ArrayLike) -> Array:
        """Outer radius R2 before activation at stations Z [m]."""
        return self.arm.profile.radius(stations)

    def check_stations(self, stations: ArrayLike, *, ascending: bool = True) -> Array:
        """Stations Z [m], shape (station,), as a float array; they may fall if not `ascending`.

        Raises:
            InvalidInput: No such Z within [0, L].
        """
        z = as_floats("stations", stations)
        inside = z.ndim == 1 and z.size > 0 and ((z >= 0) & (z <= self.length)).all()
        if not inside or (ascending and (np.diff(z) < 0).any()):
            order = "ascending " if ascending else ""
            raise InvalidInput("stations", z, f"{order}Z within [0, {self.length:g}] m")
        return z

    def __repr__(self) -> str:
        size = f"L = {self.length:g} m, {counted(self.box.bundles, 'bundle')}"
        return f"<{type(self).__name__}: {size}, tip error up to {self.tol:g} L>"


class Frames(NamedTuple):
    """Rods in space, at stations."""

    position: Array
    """Centerline r [m], shape (n, station, 3)."""
    directors: Array
    """d1, d2, d3 as rows [-], shape (n, station, 3, 3)."""


class Strains(NamedTuple):
    """Strains of rods at stations."""

    curvature: Array
    """u in the directors, per unit of activated arclength [1/m], shape (n, station, 3)."""
    extension: Array
    """ζ [-], shape (n, station)."""


class Held(NamedTuple):
    """All postures that a loaded arm holds at the nodes of a grid, and how they go on beside."""

    node: NDArray[np.intp]
    """The node of each, shape (n,)."""
    tips: Array
    """Their tips [m], shape (n, 3)."""
    links: NDArray[np.intp]
    """Pairs of neighbors that are on one branch, shape (l, 2)."""
    ends: NDArray[np.intp]
    """Postures whose branch ends on the way to a node beside, and that node, shape (e, 2)."""
    end_tips: Array
    """Tips where these end [m], shape (e, 3)."""
    is_doubled: NDArray[np.bool_]
    """Mask of nodes at which two are held on the side of the posture, shape (nodes,)."""
    frames: Array | None = None
    """Frames of each [-], from which `TipMap.continued_from` goes on, shape (n, component)."""


class Shapes(NamedTuple):
    """Arms at stations."""

    position: Array
    """Centerline r [m], shape (n, framed station, 3)."""
    directors: Array
    """d1, d2, d3 as rows [-], shape (n, framed station, 3, 3)."""
    curvature: Array
    """u in the directors, per unit of activated arclength [1/m], (n, strained station, 3)."""
    extension: Array
    """ζ [-], shape (n, strained station)."""
    status: Status
    """`TipStatus`, shape (n,)."""


class TipOutputs(NamedTuple):
    """Arrays for n activations that a tip map fills; None for what is not wanted."""

    tips: Array
    """Tips r [m], shape (n, 3); NaN without an equilibrium."""
    slopes: Array | None = None
    """∂r/∂γ [m], shape (n, 3, bundles)."""
    twists: Array | None = None
    """(v, ω) of the tip frame per unit of each activation [m, rad], shape (n, 6, bundles)."""
    status: Status | None = None
    """`TipStatus`, shape (n,)."""
    directions: Array | None = None
    """Tangents d3 [-], shape (n, 3)."""


def drop(lost: NDArray[np.intp], status: Status | None, *values: Array | None) -> None:
    """Make rows NaN, and give them the status `NO_EQUILIBRIUM`."""
    for some in values:
        if some is not None:
            some[lost] = np.nan
    if status is not None:
        status[lost] = TipStatus.NO_EQUILIBRIUM


def _listed(activation: Array) -> str:
    """An activation as the command line takes it: "-1,0,-0.5"."""
    return ",".join(f"{value:g}" for value in activation)


def position_slopes(tips: Array, twists: Array, slopes: Array) -> None:
    """Put ∂r/∂γ = v + ω × r (n, 3, bundles) into place, from tips and spatial twists (v, ω)."""
    v, w = twists[:, :3], twists[:, 3:]
    slopes[:] = v
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        slopes[:, i] += w[:, j] * tips[:, k, None] - w[:, k] * tips[:, j, None]


def check_tol(tol: float) -> float:
    """A tolerance that can be met in double precision.

    Raises:
        InvalidInput: It is below 1e-12 or not a number.
    """
    if type(tol) is float and SMALLEST_TOL <= tol < np.inf:  # by far the most, in a tenth of it
        return tol
    return as_number("tol", tol, Range(SMALLEST_TOL, unit="(in L)"))


def no_equilibrium(tried: int, sought: str = "a stable equilibrium") -> InvalidLoads:
    """Error of loads under which none of so many activations has what is sought."""
    missing = f"none of {tried} activations tried has {sought}"
    return InvalidLoads("loads", missing, f"light enough for {sought}", "lighten the load")
