"""States under names, with the numbers of their designs."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, Self

from softreach.arm.manipulator import Manipulator
from softreach.studio.reach import Reach, Size
from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput

__all__ = ["REFERENCE", "Numbers", "Snapshot", "SnapshotStore", "Snapshots", "numbers_of"]

VERSION = 1
REFERENCE = "reference"
"""Name of a design that an older state keeps without a snapshot."""
_LONGEST_NAME = 60
_MOST = 100


class Numbers(NamedTuple):
    """Known numbers of the reach of a design."""

    size: Size
    unreachability: float
    """UNR [-]; NaN for all but solids."""


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """A state under a name.

    Raises:
        InvalidInput: A name that cannot be shown in a line.
    """

    name: str
    state: StudioState
    taken: float
    """Time [s since 1970]: the order of snapshots."""
    numbers: Numbers | None = None
    """None while they are not known."""

    def __post_init__(self) -> None:
        plain = isinstance(self.name, str) and self.name.isprintable() and self.name.strip()
        if not plain or len(self.name) > _LONGEST_NAME:
            allowed = f"a line of 1 to {_LONGEST_NAME} characters"
            raise InvalidInput("snapshot name", f"{self.name!r:.80}", allowed)
        if not math.isfinite(self.taken):
            raise InvalidInput("snapshot time", self.taken, "a finite number")

    def to_json(self) -> str:
        """The snapshot as text, from which `from_json` makes an equal one."""
        numbers = self.numbers and {
            "size": self.numbers.size._asdict(),
            "unreachability": _or_none(self.numbers.unreachability),
        }
        values = {
            "softreach_snapshot": VERSION,
            "name": self.name,
            "taken": self.taken,
            "numbers": numbers,
            "state": self.state.to_json(),
        }
        return json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """The snapshot that `to_json` wrote.

        Raises:
            InvalidInput: The text is no snapshot.
            InvalidDesign: Its design cannot exist.
        """
        allowed = f"one that the studio saved, version {VERSION}"
        try:
            values = json.loads(text)
            if values["softreach_snapshot"] != VERSION:
                raise InvalidInput("snapshot", f"version {values['softreach_snapshot']}", allowed)
            state = StudioState.from_json(values["state"])
            return cls(
                name=values["name"],
                taken=float(values["taken"]),
                numbers=_numbers(values["numbers"]),
                state=state,
            )
        except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
            if type(error).__module__.startswith("softreach"):
                raise
            raise InvalidInput("snapshot", f"{error!s:.200}", allowed) from None


class Snapshots:
    """Those of one server, which all its tabs show; a store may keep them."""

    def __init__(self, store: SnapshotStore | None = None) -> None:
        self._store = store
        self._lock = threading.RLock()  # tabs take and delete them at the same time
        self.changed: Callable[[], object] = lambda: None
        """Called after every change."""
        self.all: tuple[Snapshot, ...] = () if store is None else store.snapshots()
        """In the order in which they were taken."""

    def add(self, snapshot: Snapshot) -> None:
        """Keep one more.

        Raises:
            InvalidInput: The name is taken, or there are too many.
        """
        with self._lock:
            if any(snapshot.name == other.name for other in self.all):
                raise InvalidInput("snapshot name", snapshot.name, "another, as this one is taken")
            if len(self.all) >= _MOST:
                raise InvalidInput("snapshots", len(self.all), f"at most {_MOST}", "delete some")
            self._put(snapshot)

    def measure(self, name: str, numbers: Numbers) -> None:
        """Note the numbers of a snapshot that was taken before they were known."""
        with self._lock:
            for snapshot in self.all:
                if snapshot.name == name and snapshot.numbers != numbers:
                    self._put(replace(snapshot, numbers=numbers))

    def remove(self, name: str) -> None:
        """Forget one."""
        with self._lock:
            if self._store is not None:
                self._store.remove(name)
            self._become(tuple(snapshot for snapshot in self.all if snapshot.name != name))

    def named(self, name: str) -> Snapshot | None:
        """The snapshot of this name."""
        return next((snapshot for snapshot in self.all if snapshot.name == name), None)

    def name_of(self, design: Manipulator) -> str:
        """Name of the first snapshot of a design; "reference" for that of none."""
        names = (snapshot.name for snapshot in self.all if snapshot.state.design == design)
        return next(names, REFERENCE)

    def free_name(self) -> str:
        """A name that is not taken."""
        taken = {snapshot.name for snapshot in self.all}
        return next(name for k in range(1, _MOST + 2) if (name := f"design {k}") not in taken)

    def _put(self, snapshot: Snapshot) -> None:
        if self._store is not None:
            self._store.put(snapshot)
        others = [item for item in self.all if item.name != snapshot.name]
        self._become(tuple(sorted([*others, snapshot], key=lambda item: item.taken)))

    def _become(self, snapshots: tuple[Snapshot, ...]) -> None:
        self.all = snapshots
        self.changed()


class SnapshotStore(Protocol):
    """A place where snapshots stay when the server ends."""

    def snapshots(self) -> tuple[Snapshot, ...]:
        """Those that it holds, in the order in which they were taken."""
        ...

    def put(self, snapshot: Snapshot) -> None:
        """Keep one, instead of an older one of its name."""
        ...

    def remove(self, name: str) -> None:
        """Forget one."""
        ...


def numbers_of(reach: Reach | None, state: StudioState) -> Numbers | None:
    """The numbers of a state's design, if that is what is known."""
    if reach is None or not reach.fine or reach.arm != state.design or reach.size is None:
        return None
    return Numbers(reach.size, reach.unreachability)


def _numbers(values: Any) -> Numbers | None:
    if values is None:
        return None
    size = values["size"]
    value, error, unr = float(size["value"]), float(size["error"]), values["unreachability"]
    if not (math.isfinite(value) and math.isfinite(error)):
        raise ValueError("numbers that are not finite")
    share = math.nan if unr is None else float(unr)
    return Numbers(Size(str(size["name"]), value, error, int(size["power"])), share)


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
