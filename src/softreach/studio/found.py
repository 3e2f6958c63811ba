"""Knowledge of a tab as one frozen value: what its jobs have found out of its state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.calibration.calibration import Calibration
from softreach.calibration.measurements import Measurements
from softreach.inverse import Solution
from softreach.inverse.path import Drag, Dragged
from softreach.plot.coloring import BundleKey, ScalarKey
from softreach.requirements import Check
from softreach.rod.tip_map import TipStatus
from softreach.studio.figures import Picture, VolumeSlopes
from softreach.studio.reach import Reach
from softreach.studio.state import StudioState
from softreach.support.arrays import Array

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """What is known; each part may be of the design before, until that of the present one is."""

    reach: Reach | None = None  # of the design
    refusal: str = ""  # reason why nothing can be computed of the design
    ends: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # of its sliders, by name
    slopes: VolumeSlopes | None = None  # change of its volume by each slider
    free: Reach | None = None  # reach of a loaded design without its loads
    reference: Reach | None = None  # reach of the design that is kept
    key: BundleKey | ScalarKey | None = None  # to the colors of cloud or surface
    tip: Array | None = None  # its place [L]; None before it is known, and without an equilibrium
    pointing: Array = field(default_factory=lambda: np.full(3, np.nan))  # direction d3 of the tip
    posture: TipStatus | None = None  # of a loaded arm in its activation; None without loads
    clearance: Clearance | None = None  # of the whole arm as it is; None without surroundings
    answer: Solution | None = None  # every activation that reaches the target
    goal: tuple[float, ...] | None = None  # activation to which the arm moves without touching
    takes_nearest: bool = False  # true if the arm moves to the nearest of them, as after a click
    pull: Pull | None = None  # latest order of who drags the tip; None once it is followed
    drag: Drag | None = None  # what follows a dragged tip of the design
    lag: Lag | None = None  # how far the arm lags behind the pointer; None when nobody drags
    held: tuple[Manipulator, Dragged] | None = None  # an arm, and how the last drag left it
    bench: Bench | None = None  # measured poses, and what was fitted to them
    sample: Sample | None = None  # markers of the pose that is shown
    check: Check | None = None  # the design against its needs
    check_refusal: str = ""  # reason why it cannot be judged
    part: int = 0  # number of the part whose numbers are typed, in the list of parts
    section: Picture | None = None  # of the reachable set by the plane of the slice
    sweep: Picture | None = None  # volumes of designs that differ in one parameter
    track: xr.Dataset | None = None  # result of `track_path` for the path

    @property
    def is_dragged(self) -> bool:
        """True while a drag of the tip is under way."""
        return self.pull is not None and not self.pull.rests

    def complete_reach(self, design: Manipulator | None, name: str = "reach") -> Reach | None:
        """One of the reaches, where it is the fine one of a design."""
        reach = getattr(self, name)
        return reach if reach is not None and reach.fine and reach.arm == design else None


def is_alike(arm: Manipulator, other: Manipulator) -> bool:
    """True if two designs differ in their surroundings alone, or not at all."""
    return arm == other or arm.replace(surroundings=()) == other.replace(surroundings=())


class Known(NamedTuple):
    """All that decides what a tab does: its state, and what was found out of it."""

    state: StudioState
    found: Found


@cache
def in_session(path: str) -> str:
    """Place of "design" of a state, "found.tip" of what is known or "tab.busy" in a session."""
    root, _, rest = path.partition(".")
    return rest if root == "tab" else path if root in ("found", "state") else f"state.{path}"


class Clearance(NamedTuple):
    """Where the arm comes nearest to what it must not touch."""

    value: float = np.nan  # gap beyond the distance to keep [m]; infinite without anything near
    name: str = ""  # of what is nearest
    station: float = np.nan  # Z of the place [m]
    number: int = -1  # of the solid among the surroundings
    refusal: str = ""  # reason why nothing is known


@dataclass(frozen=True, eq=False)
class Pull:
    """Place where a person wants the tip [L]."""

    place: Array
    rests: bool  # true once the drag has ended there


@dataclass(frozen=True, eq=False)
class Lag:
    """Place where a person wants the tip [L], and what comes of that."""

    wanted: Array
    dragged: Dragged


@dataclass(frozen=True, eq=False)
class Bench:
    """Measured poses, the pose that is shown, and what was fitted to them."""

    data: Measurements
    arm: Manipulator  # the design that they were read for
    number: int = 0  # of the pose that is shown
    free: tuple[str, ...] = ("pose",)  # numbers that a fit may change
    result: Calibration | None = None

    def fits(self, arm: Manipulator) -> bool:
        """True of an arm with the inputs and the markers of the one that the data were read for."""
        columns = lambda arm: (arm.input_names, arm.input_units, [m.name for m in arm.markers])
        return columns(arm) == columns(self.arm)

    def posed(self, state: StudioState) -> StudioState:
        """The state with the inputs of the pose, as far as its bounds go."""
        return state.replace(activation=tuple(self.data.inputs[self.number].tolist()))

    def fitted(self, design: Manipulator) -> Manipulator | None:
        """The calibrated arm; None without a fit that began with this design."""
        result = self.result
        return result.arm if result is not None and result.start == design else None


@dataclass(frozen=True, eq=False)
class Sample:
    """Markers of a measured pose."""

    measured: Array  # [m], shape (marker, 3)
    predicted: Array  # of the calibrated arm, or of the design [m], shape (marker, 3)
    arm: Manipulator  # the one that predicts

    @property
    def distances(self) -> Array:
        """From measured to predicted markers [m], shape (marker,)."""
        return np.linalg.norm(self.predicted - self.measured, axis=1)
