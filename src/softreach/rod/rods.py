"""The tip map of an arm: its rod, free or loaded, between inputs and a pose in the world."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.base import UPRIGHT, Base
from softreach.arm.body import VERIFIED_LOAD_NUMBER, is_overloaded
from softreach.arm.driving import inner_arm
from softreach.arm.manipulator import Manipulator, no_arm
from softreach.arm.stations import Marker
from softreach.arm.tables import check_extension
from softreach.kernels.rod.frames import move, turn
from softreach.rod.free import ArmRod, FreeRod
from softreach.rod.inputs import ActivationBox, Inputs
from softreach.rod.tip_map import (
    DEVICES,
    SMALLEST_TOL,
    Array,
    Device,
    Frame,
    Frames,
    Held,
    Shapes,
    Status,
    TipMap,
    TipOutputs,
    TipStatus,
    check_tol,
    drop,
)
from softreach.support.arguments import as_flag, as_instance, as_one_of
from softreach.support.errors import InvalidInput, NotPossible
from softreach.support.errors import warn as issue_warning
from softreach.support.lazy import lazy

_OF_LENGTHS = 0.03  # tolerance of shapes of which lengths are taken, over that of tips


@dataclass(frozen=True, repr=False)
class ArmMap(TipMap):
    """The tip map of an arm: a rod in the frame of its base, between inputs and a pose.

    Tips of unstable equilibria are NaN, as a real arm leaves them; see `with_unstable`.
    """

    rod: TipMap
    """Kernels and physics: tips in the frame of the base at the activations of sections."""
    inputs: Inputs
    """The activations of the rod at x."""
    pose: Base = UPRIGHT
    """Pose of the base in the frame of places."""
    unstable: bool = False
    """True if unstable equilibria have tips."""
    arm: Manipulator = field(init=False, compare=False)
    """The arm."""
    tol: float = field(init=False, compare=False)
    """Largest tip error over L [-]."""

    def __post_init__(self) -> None:
        driving = self.inputs.driving
        object.__setattr__(self, "arm", self.rod.arm if driving is None else driving.arm)
        object.__setattr__(self, "tol", self.rod.tol)

    @classmethod
    def of(cls, rod: TipMap, pose: Base = UPRIGHT) -> ArmMap:
        """The map of a rod in the activations of its sections."""
        return cls(rod, Inputs.of(rod.box), pose)

    @property
    def frame(self) -> Frame:
        return self.rod.frame if self.pose.is_identity else "world"

    @property
    def block(self) -> int:
        return self.rod.block

    @property
    def device(self) -> str:
        return self.rod.device

    @property
    def point(self) -> Marker | None:
        return self.rod.point

    @lazy
    def box(self) -> ActivationBox:
        return self.inputs.box

    @lazy
    def measures(self) -> Array:
        return self.inputs.measures

    @property
    def steps(self) -> int:
        return self.rod.steps

    @lazy
    def supports_unstable(self) -> bool:
        return self.rod.supports_unstable

    @property
    def is_smooth(self) -> bool:
        driving = self.inputs.driving
        return self.rod.is_smooth and (driving is None or driving.is_smooth)

    @property
    def kinks(self) -> list[Array]:
        return self.rod.kinks if self.inputs.are_activations else self.inputs.kinks

    def prepare(self) -> None:
        self.rod.prepare()
        if self.inputs.driving is not None:
            self.inputs.activations(self.box.low[None])

    def continued_from(self, gamma: Array, frames: Array | None = None) -> TipMap:
        if not self.supports_unstable:
            return self
        activation = self.inputs.activations(gamma)
        rod = self.rod.continued_from(activation, frames)
        if rod is self.rod:
            return self
        return replace(self, rod=rod, inputs=self.inputs.continued_from(activation, frames))

    def fill(self, gamma: Array, out: TipOutputs) -> None:
        is_whole = self.unstable or not self.supports_unstable
        if is_whole and self.inputs.are_activations and self.pose.is_identity:
            self.rod.fill(gamma, out)
            return
        moved = {"slopes": out.slopes, "twists": out.twists}
        moved, of_drives = {name: v for name, v in moved.items() if v is not None}, None
        if moved:
            inner, of_drives = self.inputs.with_slopes(gamma)
        else:
            inner = self.inputs.activations(gamma)
        room = out
        if not self.inputs.are_activations:  # derivatives along the activations of the rod
            along = {name: np.empty((*v.shape[:2], inner.shape[1])) for name, v in moved.items()}
            room = out._replace(**along)
        if out.status is None and not is_whole:
            room = room._replace(status=np.empty(len(gamma), np.int8))
        inner, lost = self.known_activations(inner)
        self.rod.fill(inner, room)
        self._place(room)
        for name, values in moved.items():
            if (along_rod := getattr(room, name)) is not values:
                self.inputs.along_x(along_rod, of_drives, values)
        self._drop(lost, room.status, out.tips, out.slopes, out.twists, out.directions)

    def known_activations(self, inner: Array) -> tuple[Array, NDArray[np.intp]]:
        """Activations (n, bundles), lower bounds where no tensions were found, and their rows."""
        lost = np.flatnonzero(np.isnan(inner).any(axis=1))
        if len(lost):
            inner[lost] = self.rod.box.low
        return inner, lost

    def _drop(self, lost: NDArray[np.intp], status: Status | None, *values: Array | None) -> None:
        """Make NaN what has no tensions, and what is not stable unless that is wanted."""
        drop(lost, None, *values)
        if status is None:
            return
        status[lost] = TipStatus.UNDECIDED
        if not self.unstable:
            drop(np.flatnonzero(status != TipStatus.STABLE), None, *values)

    def _place(self, out: TipOutputs) -> None:
        """Take to the world what is in the frame of the base: r = r(0) + R r'."""
        if self.pose.is_identity:
            return
        rotation, position = np.array(self.pose.rotation), np.array(self.pose.position)
        move(out.tips, rotation, position)
        if out.slopes is not None:
            turn(out.slopes, rotation)
        if out.directions is not None:
            move(out.directions, rotation, np.zeros(3))
        if out.twists is not None:
            turn(out.twists, rotation)
            if position.any():  # v is that of the origin, which is another point now
                v, w = out.twists[:, :3], out.twists[:, 3:]
                for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                    v[:, i] += position[j] * w[:, k] - position[k] * w[:, j]

    def shapes(self, activations: ArrayLike, framed: ArrayLike, strained: ArrayLike) -> Shapes:
        inner, lost = self.known_activations(self.inputs.activations(self.box.check(activations)))
        shapes = self.rod.shapes(inner, framed, strained)
        shapes = shapes._replace(**self.placed(Frames(*shapes[:2]))._asdict())
        self._drop(lost, shapes.status, *shapes[:4])
        return shapes

    def placed(self, frames: Frames) -> Frames:
        """Centerlines and directors in the world of those in the frame of the base."""
        if self.pose.is_identity:
            return frames
        directors = self.pose.directions_to_world(frames.directors)
        return Frames(self.pose.to_world(frames.position), directors)

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        return self.rod.extension_and_turn(self.inputs.activations(gamma))

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held | None:
        held = self.rod.held(self.inputs.activations(gamma), sizes)
        if held is not None:
            self._place(TipOutputs(held.tips))
            self._place(TipOutputs(held.end_tips))
        return held

    def farthest(self) -> float:
        return self.rod.farthest()

    def linearization_error(self, half_widths: Array) -> float:
        widths = self.inputs.widths(half_widths)
        return np.inf if widths is None else self.rod.linearization_error(widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        widths = self.inputs.widths(half_widths)
        if widths is None:
            return np.full(len(centers), np.inf)
        return self.rod.linearization_errors(self.inputs.activations(centers), widths)


def as_tip_map(
    arm: Manipulator | TipMap,
    tol: float = 1e-6,
    *,
    frame: Frame = "world",
    point: str | None = None,
    warn: bool = True,
    device: Device = "cpu",
) -> ArmMap:
    """The tip map of an arm, kept for the next call; a tip map is returned as it is.

    Args:
        arm: The design, or a tip map, whose own tolerance then counts.
        tol: Largest tip error, in L.
        frame: Frame of places: the "world", or that of the "base", whose z is
            along the straight arm. That of a tip map, if it is not of the world, counts.
        point: Name of the marker that counts as the tip; by default that of the design, or of a
            tip map.
        warn: Whether to warn of loads beyond what was verified.
        device: What computes tips and their derivatives: "cpu", or "cuda" for a GPU. That of a tip
            map counts.

    Raises:
        InvalidInput: No arm, no such frame, marker or device, or `tol` out of range.
        MissingExtra: `softreach[cuda]` is not installed.
        NotPossible: There is no GPU, no driver for it, or the arm has loads.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    as_one_of("frame", frame, ("world", "base"))
    check_device(device)
    if not isinstance(arm, Manipulator | TipMap):
        raise no_arm("arm", arm, "a Manipulator or a TipMap")
    if isinstance(arm, TipMap):
        known = arm if isinstance(arm, ArmMap) else ArmMap.of(arm)
        return replace(known, pose=UPRIGHT) if frame == "base" != known.frame else known
    made = _of_arm(arm.at_point(point), check_tol(tol), frame, device)
    if as_flag("warn", warn) and arm.loads is not None:
        _warn_of_large_loads(arm)
    return made


def check_device(device: Device) -> None:
    """See that a device can compute tips.

    Raises:
        InvalidInput: There is no such kind of device.
        MissingExtra: `softreach[cuda]` is not installed.
        NotPossible: There is no GPU, or no driver for it.
    """
    if as_one_of("device", device, DEVICES) == "cuda":
        from softreach.rod.cuda import device_name

        device_name()


def refined(tip_map: TipMap, tol: float) -> TipMap:
    """The tip map of the same arm to a smaller tolerance [L]; itself if its own is no larger."""
    return tip_map if tip_map.tol <= check_tol(tol) else _to_tolerance(tip_map, tol)


def coarsened(tip_map: TipMap, tol: float) -> TipMap:
    """The tip map of the same arm to a larger tolerance [L]; itself if its own is no smaller."""
    return tip_map if tip_map.tol >= check_tol(tol) else _to_tolerance(tip_map, tol)


def _to_tolerance(tip_map: TipMap, tol: float) -> TipMap:
    known = as_tip_map(tip_map)
    if not isinstance(known.rod, ArmRod):
        return tip_map
    inputs = _with_tensions(known.inputs, tol)
    device: Device = "cpu" if known.device == "cpu" else "cuda"
    return replace(known, rod=_known_rod(known.rod.arm, tol, device), inputs=inputs)


@lru_cache(maxsize=64)
def at_marker(tip_map: TipMap, name: str) -> ArmMap:
    """The same map of a marker in place of the tip; that of postures straight from rest alone."""
    known, device = as_tip_map(tip_map), "cpu" if tip_map.device == "cpu" else "cuda"
    rod = _known_rod(known.rod.arm.at_point(name), known.tol, device)
    if type(rod) is not type(known.rod):
        raise NotPossible(f"{name} is known only of an arm in postures straight from rest")
    return replace(known, rod=rod)


def effective(tip_map: TipMap) -> TipMap:
    """The tip map of the same arm in inputs beyond the dead zones of its drives.

    It has the same image and no kinks at dead zones; itself where there are none.
    """
    known = as_tip_map(tip_map)
    if not any(drive.dead_zone for drive in known.arm.drives):
        return tip_map
    return replace(known, inputs=known.inputs.effective())


def free_bundles(tip_map: TipMap) -> TipMap:
    """The restriction of a tip map to its free bundles; the map itself if all are free."""
    as_instance("tip_map", tip_map, TipMap, "a TipMap")
    if tip_map.box.dimension == tip_map.box.bundles:
        return tip_map
    known = as_tip_map(tip_map)
    free = tuple(known.inputs.free[k] for k in tip_map.box.free)
    return replace(known, inputs=replace(known.inputs, free=free))


def measured_bundles(tip_map: TipMap) -> TipMap:
    """A tip map whose activations are in `activation_measures`; the map itself if they are."""
    known = as_tip_map(tip_map)
    inputs = known.inputs.measured(known.arm)
    return tip_map if inputs == known.inputs else replace(known, inputs=inputs)


def all_inputs(tip_map: TipMap) -> ArmMap:
    """The tip map of all inputs of an arm, each in its own unit."""
    known = as_tip_map(tip_map)
    if known.inputs.is_plain:
        return known
    return replace(known, inputs=Inputs.of(known.inputs.own_box, known.inputs.driving))


def with_unstable(tip_map: TipMap) -> ArmMap:
    """The tip map that has tips of unstable equilibria, too."""
    known = as_tip_map(tip_map)
    is_there = known.unstable or not known.supports_unstable
    return known if is_there else replace(known, unstable=True)


def of_tip(tip_map: TipMap) -> ArmMap:
    """The tip map, for what is known of tips alone.

    Raises:
        InvalidInput: A marker stands for its tip.
    """
    if tip_map.point is not None:
        raise InvalidInput("point", tip_map.point.name, "left out: this is known of the tip alone")
    return as_tip_map(tip_map)


def in_steps(arm: Manipulator, steps: int, like: TipMap, *, extends: bool = False) -> TipMap:
    """The tip map of an arm in so many steps, which are not checked against its tolerance.

    Maps of neighboring designs in as many steps err by what is a smooth function of the design, so
    that differences between them do not see it; and none of them needs a search for its steps.
    Tolerance, frame and effective inputs are those of a map that it is like. Unless it is known
    that the arm `extends`, ζ > 0 in all of its bounds, that is checked.

    Raises:
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    driving, inner = as_tip_map(like).inputs.driving, inner_arm(arm)
    if not extends:
        check_extension(inner)
    made = _made(arm, like.tol, like.frame, _rod(inner, like.tol, steps))
    return effective(made) if driving is not None and driving.is_effective else made


@lru_cache(maxsize=64)
def _of_arm(arm: Manipulator, tol: float, frame: Frame, device: Device) -> ArmMap:
    return _made(arm, tol, frame, _known_rod(inner_arm(arm), tol, device))


def _made(arm: Manipulator, tol: float, frame: Frame, rod: ArmRod) -> ArmMap:
    inputs = Inputs.of(rod.box) if arm.is_direct else _with_tensions(Inputs.of_drives(arm), tol)
    return ArmMap(rod, inputs, arm.base if frame == "world" else UPRIGHT)


def _with_tensions(inputs: Inputs, tol: float) -> Inputs:
    """The same with tensions under loads for a tolerance of tips [L]."""
    driving = inputs.driving
    if driving is None or driving.arm.loads is None or driving.is_bundles:
        return inputs
    from softreach.rod.loaded.rod import LoadedTendons

    # A tip moves by far more than the length by which a tendon near the axis is off.
    rod = _rod(inner_arm(driving.arm), max(_OF_LENGTHS * tol, SMALLEST_TOL))
    return replace(inputs, driving=replace(driving, pulled=LoadedTendons(driving.law, rod)))


@lru_cache(maxsize=64)
def _known_rod(inner: Manipulator, tol: float, device: Device) -> ArmRod:
    if device == "cpu":
        return _rod(inner, tol)
    from softreach.rod.cuda import CudaRod

    return CudaRod.of(inner, tol)


def _rod(inner: Manipulator, tol: float, steps: int | None = None) -> ArmRod:
    if inner.loads is None:
        return FreeRod(inner, tol, steps)
    from softreach.rod.loaded.rod import LoadedRod

    return LoadedRod(inner, tol, steps)


@lru_cache(maxsize=64)
def _warn_of_large_loads(arm: Manipulator) -> None:
    """Warn once of an arm that is loaded beyond what was verified; one text for all."""
    if is_overloaded(arm):
        issue_warning(
            f"the load number is above {VERIFIED_LOAD_NUMBER:g}, up to which shapes under loads "
            "were verified: look at the status of the samples, and compare with a smaller tol"
        )
