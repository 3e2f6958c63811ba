"""Command that builds an atlas: the same one resumes, another one is refused."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from importlib.metadata import version
from typing import Any, Self

import numpy as np

from softreach.atlas.metrics import Metric, known_metric
from softreach.atlas.space import DesignSpace
from softreach.cloud.curvature import QUANTILES
from softreach.rod.tip_map import Device
from softreach.sampling import check_sampler
from softreach.support.errors import InvalidInput, counted

ATLAS_VERSION = 5  # Version of the layout of a store
STATIONS = tuple(np.linspace(0.5, 1.0, 6).tolist())

_RESERVED = frozenset(
    ("status", "message", "number", "tip", "axis", "unit_activation", "sample", "bundle", "length")
    + ("design", "metric", "metrics", "curvature", "quantity", "station", "quantile", "rank")
)
"""Names that no metric may have, as an atlas or a question about it uses them itself."""
_LONGEST = 1e3  # ratio of the lengths of designs whose tips share one fixed-point step


@dataclass(frozen=True, kw_only=True)
class Command:
    """Everything that decides the numbers of an atlas, and nothing else."""

    space: DesignSpace
    n: int
    seed: int
    sampler: str
    tol: float
    alpha_over_length: float  # Radius of the alpha shapes over the length of each design
    accuracy: float  # Relative error asked of the exact volumes
    metrics: tuple[Metric, ...]  # As `chosen_metrics` has them
    keep_clouds: bool
    device: Device = "cpu"
    """What computes tips; the last digits depend on it."""
    stations: tuple[float, ...] = STATIONS
    """Places at which curvature is measured, over the length of each design."""
    quantiles: tuple[float, ...] = QUANTILES
    softreach_version: str = field(default_factory=lambda: version("softreach"))
    atlas_version: int = ATLAS_VERSION

    def __post_init__(self) -> None:
        space = self.space
        for metric in self.metrics:
            if metric.name in _RESERVED or metric.name in space.names:
                allowed = "a name that the atlas does not use itself"
                raise InvalidInput("name of a metric", metric.name, allowed)
        if not space.bundles:
            why = next(iter(space.gaps.values()))
            designs = counted(space.size, "design")
            raise InvalidInput("space", designs, "valid for at least one design", why)
        shortest, longest = space.length_range
        if self.keep_clouds and longest > _LONGEST * shortest:
            allowed = f"within a factor of {_LONGEST:g} of each other if clouds are kept"
            hint = "stored tips share one step; pass keep_clouds=False, or build two atlases"
            raise InvalidInput("length", f"{shortest:g} to {longest:g} m", allowed, hint)
        check_sampler(self.sampler, self.n, space.bundles, self.seed)

    @property
    def numbers(self) -> tuple[Metric, ...]:
        """The metrics that are single numbers."""
        return tuple(metric for metric in self.metrics if not metric.over)

    @property
    def profiles(self) -> tuple[Metric, ...]:
        """The metrics over stations and quantiles."""
        return tuple(metric for metric in self.metrics if metric.over)

    @property
    def profile_sizes(self) -> dict[str, int]:
        """Number of stations and quantiles of a profile."""
        return {"station": len(self.stations), "quantile": len(self.quantiles)}

    def to_json(self) -> str:
        """The command as text, from which `from_json` makes an equal one."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        metrics = [metric.to_dict() for metric in self.metrics]
        return json.dumps({**values, "space": self.space.to_dict(), "metrics": metrics})

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The command that `to_json` wrote; metrics that are not softreach's lack a function."""
        values = json.loads(text)  # the root of a store is sealed
        if (version := values.get("atlas_version")) != ATLAS_VERSION:
            hint = "build the atlas again in a new folder"
            raise InvalidInput("version of the atlas", version, str(ATLAS_VERSION), hint)
        values |= {name: tuple(values[name]) for name in ("stations", "quantiles")}
        space, metrics = DesignSpace.from_dict(values["space"]), list[Metric]()
        for metric in values["metrics"]:
            own = known_metric(metric["name"])
            same = own is not None and own.to_dict() == metric
            metrics.append(own if own and same else Metric.from_dict(metric))
        return cls(**{**values, "space": space, "metrics": tuple(metrics)})

    def continuing(self, begun: Self) -> Self:
        """This command for a store that another version began: without metrics added since."""
        names = {metric.name for metric in begun.metrics}
        kept = (m for m in self.metrics if m.name in names or not known_metric(m.name))
        return replace(self, metrics=tuple(kept), softreach_version=begun.softreach_version)

    def differences(self, other: Self) -> list[str]:
        """Differences between this command and another, one line each."""
        own, its = ({m.name: m.to_dict() for m in each.metrics} for each in (self, other))
        lines = [*_differences(_flat(self), _flat(other))]
        if only := [name for name in its if name not in own]:
            lines.append(f"metrics: {', '.join(only)} there and not here")
        if only := [name for name in own if name not in its]:
            lines.append(f"metrics: {', '.join(only)} here and not there")
        for name in own.keys() & its.keys():
            lines += (f"metric {name}, {line}" for line in _differences(own[name], its[name]))
        return lines


def _flat(command: Command) -> dict[str, Any]:
    """All settings but the metrics by name, those of the space too."""
    values = {f.name: getattr(command, f.name) for f in fields(command) if f.name != "metrics"}
    space = values.pop("space")
    design = {"layout": space.layout, "design": space.base.to_toml()}
    return values | design | dict(space.parameters)


def _differences(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> Iterator[str]:
    for name in dict.fromkeys([*mine, *theirs]):
        own, other = mine.get(name), theirs.get(name)
        if own != other:
            yield f"{name}: {_shown(other, own)} there, {_shown(own, other)} here"


def _shown(value: Any, other: Any) -> str:
    """A setting in a few words, chosen so that it differs visibly from the other one."""
    if value is None:
        return "none"
    if isinstance(value, tuple) and len(value) > 4:
        return f"{len(value)} values from {value[0]:.6g} to {value[-1]:.6g}"
    if isinstance(value, str) and "\n" in value:
        own = [line for line in value.splitlines() if line and line not in str(other).splitlines()]
        return "; ".join(own) or "less"
    return repr(value)
