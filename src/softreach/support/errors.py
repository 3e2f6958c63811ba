"""Errors and warnings, said so that the reader knows what to do next."""

import importlib.util
import math
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, Self

_LONGEST = 300  # characters of a value that an error shows


def counted(number: int, noun: str) -> str:
    """A number of things in words: "1 design", "2 designs"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def did_you_mean(name: str, known: Iterable[str], cutoff: float = 0.7) -> str:
    """A hint at the known name that is closest to an unknown one; empty if none is close."""
    from difflib import get_close_matches

    close = get_close_matches(name, list(known), n=1, cutoff=cutoff)
    return f'did you mean "{close[0]}"?' if close else ""


def in_short(value: object) -> str:
    """A value in one line of moderate length."""
    lines = str(value).splitlines()  # an array takes several, a dataset many
    text = lines[0] if lines and lines[0].startswith("<") else " ".join(lines)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


class SoftreachError(Exception):
    """Base of every error that softreach raises on purpose."""


class InvalidInput(SoftreachError, ValueError):
    """An argument outside what is allowed.

    The message is one line: what was wrong, its value, what is allowed, what to do.

    Attributes:
        name: The argument or key that is wrong.
        value: The value that was given.
        allowed: What would have been accepted.
    """

    def __init__(self, name: str, value: object, allowed: str, hint: str = "") -> None:
        self.name, self.value, self.allowed = name, value, allowed
        message = f"{name} = {in_short(value)}: must be {allowed}"
        super().__init__(f"{message}; {hint}" if hint else message)


class NotPossible(SoftreachError, ValueError):
    """Something that cannot be done, although no single argument is wrong; one sentence says why.

    The sentence says what stands in the way, and what to do.
    """


class Range(NamedTuple):
    """The numbers that a quantity may take."""

    low: float = -math.inf
    """Lower end [unit]."""
    high: float = math.inf
    """Upper end [unit]."""
    unit: str = ""
    """SI unit; "" for none."""
    open_low: bool = False
    """True if the lower end itself is refused."""
    open_high: bool = False
    """True if the upper end itself is refused."""
    whole: bool = False
    """True if only integers are allowed."""
    why: str = ""
    """Reason for the limits, if they follow from other values."""

    def admits(self, value: object) -> bool:
        """True if the value is a finite number (an integer where asked) in the range."""
        if isinstance(value, bool) or not isinstance(value, int if self.whole else int | float):
            return False
        above = value > self.low or (value == self.low and not self.open_low)
        below = value < self.high or (value == self.high and not self.open_high)
        return above and below and abs(value) <= sys.float_info.max

    def in_degrees(self) -> Self:
        """The same range of an angle, for files and the command line."""
        return self._replace(low=math.degrees(self.low), high=math.degrees(self.high), unit="deg")

    def __str__(self) -> str:
        return f"{self.why}; must be {self.text}" if self.why else f"must be {self.text}"

    @property
    def text(self) -> str:
        """The range in words: "a finite number > 0 and <= 1 m"."""
        unit = f" {self.unit}" if self.unit else ""
        low = f"{'>' if self.open_low else '>='} {self.low:.6g}" if self.low > -math.inf else ""
        high = f"{'<' if self.open_high else '<='} {self.high:.6g}" if self.high < math.inf else ""
        limits = " and ".join(text for text in (low, high) if text)
        number = "a whole number" if self.whole else "a finite number"
        return f"{number} {limits}{unit}" if limits else f"{number}{' in' if unit else ''}{unit}"


class Fault(NamedTuple):
    """One thing wrong with a design."""

    path: str
    """Place of the fault: `taper`, or `fibers[1].extent`."""
    value: object
    """The value that was given; None if there was none."""
    allowed: Range | str
    """Values that are allowed, and what to do."""

    def __str__(self) -> str:
        many = isinstance(self.value, list) and any(isinstance(each, dict) for each in self.value)
        if many or self.value is None or isinstance(self.value, dict):
            return f"{self.path}: {self.allowed}"  # a table takes more lines than its fault
        shown = f"{self.value:.6g}" if isinstance(self.value, float) else in_short(repr(self.value))
        return f"{self.path} = {shown}: {self.allowed}"


class InvalidDesign(SoftreachError, ValueError):
    """A design that cannot exist; every fault is named at once.

    Attributes:
        faults: The faults, in the order of the design's fields.
    """

    def __init__(self, faults: Sequence[Fault], source: str = "") -> None:
        self.faults = tuple(faults)
        head = [f"{source}: {counted(len(self.faults), 'problem')}"] if source else []
        super().__init__(("\n  " if source else "\n").join([*head, *map(str, self.faults)]))


_EXTRAS = {  # module -> extra with it
    "matplotlib": "plot",
    "skimage": "surface",
    "distributed": "cluster",
    "viser": "studio",
    "numba_cuda": "cuda",
    "jinja2": "report",
    "optuna": "search",
    "cmaes": "search",
    "elastica": "simulators",
}
_EXTRAS |= dict.fromkeys(("pyarrow", "trimesh", "meshio", "manifold3d"), "export")
_PACKAGES = {"skimage": "scikit-image", "elastica": "pyelastica"}


class MissingExtra(SoftreachError, ImportError):
    """Optional libraries are needed but not installed."""

    def __init__(self, *modules: str) -> None:
        names = dict.fromkeys(_PACKAGES.get(name, name) for name in modules)
        extras = ",".join(dict.fromkeys(_EXTRAS[name] for name in modules))
        them = "them" if len(names) > 1 else "it"
        remedy = f"pip install 'softreach[{extras}]'"
        if extras != "cuda":  # which is no part of [all]
            remedy += ", or in a clone with: make setup"
        super().__init__(f"this needs {' and '.join(names)}; install {them} with: {remedy}")


def check_installed(*modules: str) -> None:
    """Name the modules that are missing, all at once, without the time that importing takes."""
    if missing := [name for name in modules if importlib.util.find_spec(name) is None]:
        raise MissingExtra(*missing)


class NotWritten(SoftreachError, OSError):
    """A file that could not be written: nothing of it is there, and an older one is as it was.

    Attributes:
        errno: The system's number of the reason, or 0.
    """

    def __init__(self, path: str, number: int, reason: str) -> None:
        super().__init__(number, reason)
        self._message = f"{in_short(path)} cannot be written: {' '.join(reason.split())}"

    def __str__(self) -> str:
        return self._message


class SoftreachWarning(UserWarning):
    """A result that can be used, with a limit that its reader should know."""


_silenced = ContextVar("_silenced", default=False)


def warn(text: str) -> None:
    """Issue a `SoftreachWarning` that names the line of the caller of softreach."""
    if _silenced.get():
        return
    frame, level = sys._getframe(1), 2
    while frame and frame.f_globals.get("__name__", "").split(".")[0] == __name__.split(".")[0]:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, SoftreachWarning, stacklevel=level)


@contextmanager
def no_warnings() -> Iterator[None]:
    """Silence `warn` for a block, on this thread only; `warnings.catch_warnings` does on all."""
    token = _silenced.set(True)
    try:
        yield
    finally:
        _silenced.reset(token)
