"""State of a tab of the studio as a value, what it is made of, and the history of states."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np

from softreach.arm.design_file import in_file_terms
from softreach.arm.manipulator import Manipulator
from softreach.requirements import Requirements
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arguments import as_instance, as_integer, as_number, as_one_of
from softreach.support.arrays import as_directions, as_floats
from softreach.support.errors import InvalidDesign, InvalidInput, Range, SoftreachError
from softreach.support.units import UNITS

TOL = 1e-5  # [L], the largest tip error: far below a pixel
LARGEST = 8_000_000  # bytes of a file that a person opens
_MOST_PLACES = 300  # to reach, which are judged while a slider moves
_one_at_a_time = threading.Lock()  # jobs that draw and measure one arm would both try for long


def rod_of(arm: Manipulator) -> TipMap:
    """The tip map of a design, kept; InvalidDesign if some activation shortens it to nothing."""
    return as_tip_map(arm, TOL, warn=False)  # the page says whether samples are stable


def design_of_text(text: str, source: str) -> Manipulator:
    """A design that has a rod, from the text of a file; `source` is what errors call it."""
    arm = Manipulator.from_toml(text, source)
    try:
        rod_of(arm)
    except InvalidDesign as error:
        raise in_file_terms(error, source) from None
    return arm


def solvable_rod(arm: Manipulator) -> TipMap:
    """The tip map of a design whose loads can be computed; slow the first time if loaded."""
    if arm.loads is not None:
        with _one_at_a_time:
            if not _is_solvable(arm):
                allowed = f"such that tips can be computed to {TOL:g} L"
                raise InvalidInput("loads", "too large", allowed, "lighten them or stiffen the arm")
    return rod_of(arm)


@lru_cache(maxsize=64)
def _is_solvable(arm: Manipulator) -> bool:
    try:
        return rod_of(arm).steps > 0
    except InvalidInput:  # which a tip map does not keep
        return False


@lru_cache(maxsize=32)
def requirements_of(text: str) -> Requirements:
    """The requirements in the state of a tab; none for an empty text."""
    return needs_of_text(text) if text else Requirements()


def needs_of_text(text: str, *, length: float | None = None, source: str = "") -> Requirements:
    """Requirements from the text of a file that comes from a page, as `Requirements.from_toml`."""
    # what lies beside the file is not sent with it, and this machine's files are not for the page
    needs = Requirements.from_toml(text, folder=None, length=length, source=source)
    if (count := len(needs.places)) > _MOST_PLACES:
        allowed = f"at most {_MOST_PLACES} in the studio"
        raise InvalidInput("places", f"{count:,}", allowed, "use softreach check")
    return needs


VERSION = 5
LEVELS = range(12, 22)  # 2^level points: every such prefix of a Sobol sequence is even
MOUSE = {
    "tip": "drags the tip",
    "target": "sets the target",
    "path": "adds points to the path",
    "place": "adds places to reach",
    "none": "turns the view alone",
}
"""Uses of the mouse in the scene: name -> what the menu says."""
MOST_POINTS = 2000  # of a path: each is followed, drawn and kept in the state
AXES = ("none", "x", "y", "z")
_LONGEST = 200  # steps back
_PAUSE = 1.5  # [s] without changes of the same kind, after which the next is another step
_SETTINGS = ("design", "reference", "needs")
_POSE = ("activation", "target", "direction", "cone")
_FAR = 1e3  # [L], beyond which there is nothing to see
_PLACES, _SIZES = Range(-_FAR, _FAR), Range(0.0, _FAR)
Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Slice:
    """A slab across the cloud; the rest is hidden."""

    axis: str = "none"  # "x", "y" or "z" across the slab, or "none"
    center: float = 0.0  # [L]
    thickness: float = 0.05  # [L]

    def __post_init__(self) -> None:
        as_one_of("slice.axis", self.axis, AXES)
        as_number("slice.center", self.center, _PLACES)
        as_number("slice.thickness", self.thickness, _SIZES)


@dataclass(frozen=True, kw_only=True)
class Appearance:
    """Looks of a tab: what is drawn and how."""

    level: int = 17
    color: str = "effort"  # one of `colors.color_names`
    slice: Slice = field(default_factory=Slice)
    free: bool = False  # only samples that touch nothing are shown
    half: bool = True  # the half of the cloud in front of the arm is cut away
    dark: bool = False  # the page is dark
    cloud: bool = False
    arm: bool = True
    surface: bool = True  # the exact boundary of the reachable set
    mouse: str = "tip"  # use of the mouse in the scene, one of `MOUSE`; it turns the view besides
    section: bool = False  # plots beside the scene, each computed only while it is shown
    sweep: str = ""  # parameter against which the volume is plotted; "" for none
    unit: str = ""  # of lengths, areas and volumes; "" for that of the design

    def __post_init__(self) -> None:
        as_integer("level", self.level, LEVELS[0], LEVELS[-1])
        as_one_of("mouse", self.mouse, MOUSE)
        as_one_of("unit", self.unit, ("", *UNITS))
        for each in fields(self):  # in a state that came from elsewhere too
            if (kind := {"bool": bool, "str": str}.get(str(each.type))) is not None:
                name = f"appearance.{each.name}"
                as_instance(name, getattr(self, each.name), kind, f"a {each.type}")


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Place of a camera, and the place it looks at [L]."""

    position: Vector
    look_at: Vector
    aspect: float | None = None  # width of its picture over the height; None if unknown

    def __post_init__(self) -> None:
        if self.aspect is not None:
            as_number("camera.aspect", self.aspect, _SIZES)
        for name in ("position", "look_at"):
            place = (as_number("camera", value, _PLACES) for value in getattr(self, name))
            object.__setattr__(self, name, vector(place))


@dataclass(frozen=True, kw_only=True)
class TipPath:
    """A path of the tip, and how far along it the arm is."""

    points: tuple[Vector, ...]  # [m], in order
    start: tuple[float, ...] | None = None  # activation; None for the best at the first point
    at: int = 0  # the point where the arm is
    activations: tuple[tuple[float, ...], ...] = ()  # at the points, where the path was planned

    def __post_init__(self) -> None:
        if not 2 <= len(self.points) <= MOST_POINTS:
            raise InvalidInput("path", f"{len(self.points)} points", f"2 to {MOST_POINTS}")
        if not np.isfinite(self.points).all():
            raise InvalidInput("path", "not finite", "finite numbers [m]")
        as_integer("path.at", self.at, 0, len(self.points) - 1)

    @classmethod
    def through(
        cls,
        points: Any,
        start: Sequence[float] | None = None,
        at: int = 0,
        activations: Iterable[Sequence[float]] = (),
    ) -> Self:
        """A path through points [m], shape (k, 3)."""
        values = as_floats("path", points)
        if values.ndim != 2 or values.shape[1] != 3:
            raise InvalidInput("path.shape", values.shape, "of shape (k, 3)")
        start = None if start is None else tuple(map(float, start))
        rows = tuple(tuple(map(float, row)) for row in activations)
        return cls(points=tuple(map(vector, values)), start=start, at=at, activations=rows)


@dataclass(frozen=True, kw_only=True)
class StudioState:
    """Everything that a tab shows follows from this value.

    Raises:
        InvalidInput: Activations or appearance out of range.
        InvalidDesign: A design that some activation within its bounds would shorten to nothing.
    """

    design: Manipulator
    activation: tuple[float, ...] = ()
    """Of each bundle in its unit, within the bounds; rest, or what is nearest to it, by default."""
    appearance: Appearance = field(default_factory=Appearance)
    target: Vector | None = None  # place where the tip should go [m]
    direction: tuple[float, ...] = ()  # where it should point there, of any length; () for anywhere
    cone: float = 1.0  # angle from that direction that is allowed [deg]
    reference: Manipulator | None = None  # a design that is kept, to be compared with this one
    camera: Camera | None = None
    path: TipPath | None = None  # that the tip follows
    needs: str = ""  # requirements of the design, as TOML; "" for none

    def __post_init__(self) -> None:
        if self.reference is not None:
            rod_of(self.reference)
        requirements_of(self.needs)
        as_number("within", self.cone, Range(0.0, 180.0))
        if self.direction:
            as_directions("direction", self.direction, 1)
        if (unit := self.appearance.unit) and unit != self.design.display_unit:
            object.__setattr__(self, "design", self.design.replace(display_unit=unit))
        box = rod_of(self.design).box
        values = np.zeros(box.bundles)
        count = min(len(self.activation), box.bundles)
        values[:count] = np.asarray(self.activation, float)[:count]
        if not np.isfinite(values).all():
            raise InvalidInput("activation", tuple(self.activation), "finite numbers")
        object.__setattr__(self, "activation", tuple(box.clip(values).tolist()))

    @cached_property
    def free(self) -> Manipulator | None:
        """A loaded design without its loads; None for one that has none."""
        return None if self.design.loads is None else self.design.replace(loads=None)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed; activations are moved into the bounds."""
        return replace(self, **changes)

    def showing(self, **changes: Any) -> Self:
        """A copy that looks different."""
        return replace(self, appearance=replace(self.appearance, **changes))

    def to_json(self) -> str:
        """The state as text, from which `from_json` makes an equal one."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        for name in ("appearance", "camera", "path"):
            values[name] = values[name] and asdict(values[name])
        for name in ("design", "reference"):
            values[name] = values[name] and values[name].file_text
        return json.dumps({"softreach_studio": VERSION, **values}, indent=1, ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """The state that `to_json` wrote.

        Raises:
            InvalidInput: The text is no such state.
            InvalidDesign: A design in it cannot exist.
        """
        allowed = f"a state that the studio saved, version {VERSION}"
        try:
            values = json.loads(text)
            version = values.pop("softreach_studio", None) if isinstance(values, dict) else None
            if version != VERSION:
                raise InvalidInput("state file", f"version {version}", allowed)
            read: dict[str, Any] = {k: v if v is None else _READ[k](v) for k, v in values.items()}
            return cls(**read)
        except _WRONG as error:
            if isinstance(error, SoftreachError):
                raise
            raise InvalidInput("state file", str(error), allowed) from None


_WRONG = ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError
_READ: dict[str, Callable[[Any], Any]] = {
    "design": lambda text: design_of_text(text, "state file"),
    "activation": lambda values: tuple(map(float, values)),
    "appearance": lambda look: Appearance(**look | {"slice": Slice(**look["slice"])}),
    "target": lambda place: vector(place),
    "direction": lambda way: tuple(map(float, way)),
    "cone": float,
    "reference": lambda text: design_of_text(text, "state file"),
    "camera": lambda camera: Camera(**camera),
    "path": lambda path: TipPath.through(**path),
    "needs": str,
}
"""Fields of a state from the values in its file."""


def vector(values: Iterable[float]) -> Vector:
    """Three plain numbers."""
    x, y, z = map(float, values)
    return x, y, z


@dataclass(frozen=True, kw_only=True)
class History:
    """States to go back and forth to; a change makes a new history. Looks are no part of it."""

    past: tuple[StudioState, ...] = ()  # the latest last
    future: tuple[StudioState, ...] = ()  # the next last
    kind: str = ""  # of the latest change; "" after a step back or forth
    at: float = field(default=0.0, compare=False)  # time of that change [s]

    def after(self, old: StudioState, new: StudioState, *, goes_on: bool, now: float) -> History:
        """The history after a change at a time [s]; it stays the same if only the view differs.

        A change that goes on, as of a dragged slider, is part of the step before if that was of the
        same kind, and a moment ago.
        """
        differ = [name for name in (*_SETTINGS, *_POSE) if getattr(old, name) != getattr(new, name)]
        settings = [name for name in differ if name in _SETTINGS]
        kind = " ".join(settings) or ("pose" if differ else "")  # bounds may have moved activations
        if not kind:
            return self
        same = goes_on and kind == self.kind and now - self.at < _PAUSE
        past = self.past if same else (*self.past, old)[-_LONGEST:]
        return History(past=past, kind=kind, at=now)

    def step(self, present: StudioState, *, back: bool) -> tuple[History, StudioState]:
        """The state before the latest step, or the one undone last, seen as the present one is.

        Where there is none, both stay as they are.
        """
        left, behind = (self.past, self.future) if back else (self.future, self.past)
        if not left:
            return self, present
        state = replace(left[-1], appearance=present.appearance, camera=present.camera)
        ways = left[:-1], (*behind, present)
        past, future = ways if back else ways[::-1]
        return History(past=past, future=future), state
