"""What an atlas was asked to hold: the same command resumes, another one is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from typing import Any, Self

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.atlas.metrics import METRICS
from softreach.atlas.space import DesignSpace
from softreach.curvature import QUANTILES
from softreach.errors import InvalidInput
from softreach.sampling import check_sampler

__all__ = ["ATLAS_VERSION", "Command"]

ATLAS_VERSION = 1
STATIONS = tuple(np.linspace(0.5, 1.0, 6).tolist())


@dataclass(frozen=True, kw_only=True)
class Command:
    """Everything that decides the numbers of an atlas, and nothing else.

    Raises:
        InvalidInput: An argument out of range, or a space without a single valid design.
    """

    space: DesignSpace
    n: int
    seed: int
    sampler: str
    tol: float
    alpha: float
    """Radius of the alpha shapes, in L."""
    accuracy: float
    """Relative error asked of the exact volumes."""
    metrics: tuple[str, ...]
    """Groups of metrics, in the order of `metrics.METRICS`."""
    keep_clouds: bool
    stations: tuple[float, ...] = STATIONS
    """Where curvature is measured, in L."""
    quantiles: tuple[float, ...] = QUANTILES
    softreach_version: str = field(default_factory=lambda: version("softreach"))
    atlas_version: int = ATLAS_VERSION

    def __post_init__(self) -> None:
        unknown = [name for name in self.metrics if name not in METRICS]
        if unknown or not self.metrics:
            raise InvalidInput("metrics", self.metrics, f"some of {', '.join(METRICS)}")
        if not 0 < self.alpha < np.inf:
            raise InvalidInput("alpha", self.alpha, "a radius > 0 (in L)")
        object.__setattr__(self, "metrics", tuple(name for name in METRICS if name in self.metrics))
        if not self.space.bundles:
            raise InvalidInput(
                "space", f"{self.space.size} designs", "valid for one at least", _why(self.space)
            )
        check_sampler(self.sampler, self.n, self.space.bundles, self.seed)

    def design(self, index: int) -> Manipulator:
        """The design with this number."""
        return self.space.design(index)

    def to_json(self) -> str:
        """The command as text, from which `from_json` makes an equal one."""
        values = {name: value for name, value in vars(self).items() if name != "space"}
        return json.dumps({"space": self.space.to_dict(), **values})

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The command that `to_json` wrote."""
        values = json.loads(text)
        values |= {name: tuple(values[name]) for name in ("metrics", "stations", "quantiles")}
        return cls(**values | {"space": DesignSpace.from_dict(values["space"])})

    def differences(self, other: Command) -> list[str]:
        """What differs between this command and another, one line each."""
        return list(_differences(_flat(self), _flat(other)))


def _why(space: DesignSpace) -> str:
    return next(iter(space.gaps.values()))


def _flat(command: Command) -> dict[str, Any]:
    """Every setting by its name; the base design line by line."""
    values = {name: getattr(command, name) for name in asdict(command) if name != "space"}
    space = command.space
    return values | {
        "layout": space.layout,
        "design": space.base.to_toml(),
        **dict(space.parameters),
    }


def _differences(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> Iterator[str]:
    for name in dict.fromkeys([*mine, *theirs]):
        here, there = mine.get(name), theirs.get(name)
        if here != there:
            yield f"{name}: {_shown(there, here)} there, {_shown(here, there)} here"


def _shown(value: Any, other: Any) -> str:
    """A setting in a few words, chosen so that it differs visibly from the other one."""
    if value is None:
        return "none"
    if isinstance(value, tuple) and len(value) > 4:
        return f"{len(value)} values from {value[0]:.6g} to {value[-1]:.6g}"
    if isinstance(value, str) and "\n" in value:
        others = str(other).splitlines()
        return (
            "; ".join(line for line in value.splitlines() if line and line not in others) or "less"
        )
    return repr(value)
