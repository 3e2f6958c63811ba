"""Questions to an atlas: its status, its designs and their clouds, and the best of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.written import from_written, written_name
from softreach.atlas.intermediates import activations_of
from softreach.atlas.layout import PER_DESIGN
from softreach.atlas.reading import EXPLAINED, a_store, command_of, contents, opened_atlas
from softreach.atlas.store import DAMAGED, KNOWN, AtlasStore
from softreach.rod.rods import as_tip_map, with_unstable
from softreach.schema import cloud_dataset, with_status
from softreach.support.arguments import (
    as_flag,
    as_integer,
    as_names,
    as_number,
    as_text,
)
from softreach.support.errors import InvalidInput, did_you_mean
from softreach.support.quantity import columns, numbers_in

if TYPE_CHECKING:
    import xarray as xr
    from zarr.storage import StoreLike

    from softreach.atlas.reading import AtlasLike


_QUICK = 3e8  # bytes of tips
_MOST_MESSAGES = 10


@dataclass(frozen=True, kw_only=True)
class AtlasStatus:
    """Status of an atlas: numbers of its designs."""

    designs: int
    done: int
    failed: int
    gaps: int
    unstable: int
    """Designs of which no activation has a stable equilibrium."""
    damaged: int
    """Designs of which a stored chunk is damaged; the command that built them does so again."""
    todo: int
    tips_verified: bool = field(compare=False)
    """True if stored tips were read too, or there are none."""
    messages: dict[int, str]
    """Messages of designs that failed, cannot exist, are nowhere stable or damaged, by number."""

    def __str__(self) -> str:
        counts = ("designs", "done", "todo", "failed", "gaps", "unstable", "damaged")
        rows = [(name, f"{getattr(self, name):,}") for name in counts]
        verified = "yes" if self.tips_verified else "no: softreach atlas verify"
        rows.append(("tips verified", verified))
        rows += [(f"number {k}", text) for k, text in self.messages.items()][:_MOST_MESSAGES]
        return "\n".join(columns(rows))


def atlas_status(atlas: AtlasLike) -> AtlasStatus:
    """Number of designs of an atlas that are done, and faults of the others.

    Metrics are verified, and so are tips if they are on disk and take no more than a second;
    `verify_atlas` verifies all of them.

    Args:
        atlas: A store; or a dataset from `open_atlas`, which has the status of when it was opened.

    Raises:
        InvalidInput: There is no atlas.
        DamagedStore: What all designs share is damaged.
    """
    import xarray as xr

    if isinstance(atlas, xr.Dataset):
        opened = opened_atlas(atlas)
        names = ("status", "number", "message")
        status, numbers, texts = (opened[name].values.ravel() for name in names)
        explained = np.flatnonzero(np.isin(status, (*EXPLAINED, DAMAGED)))
        return _counted(status, {int(numbers[k]): str(texts[k]) for k in explained}, False)
    store = AtlasStore.open(a_store("atlas", atlas), "r")
    command = store.command
    at_hand = isinstance(store.location, str) and "://" not in store.location
    is_small = at_hand and 12.0 * command.n * command.space.size <= _QUICK
    return _verified(store, tips=is_small or not command.keep_clouds)


def verify_atlas(store: StoreLike) -> AtlasStatus:
    """Read all of an atlas and check it: what is damaged, and how much is done.

    The command that built the atlas computes again what is damaged.

    Args:
        store: Path, URL or Zarr store.

    Raises:
        InvalidInput: There is no atlas.
        DamagedStore: What all designs share is damaged.
    """
    return _verified(AtlasStore.open(a_store("store", store), "r"), tips=True)


def atlas_design(atlas: AtlasLike, **at: float) -> Manipulator:
    """The design at, or nearest to, these parameters.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        **at: Every parameter [SI units], or `design` and its number.

    Raises:
        InvalidInput: A parameter is missing or unknown.
        InvalidDesign: The place is a gap.
    """
    opened = opened_atlas(atlas, metrics=False)
    return command_of(opened).space.design(int(_nearest(opened[["number"]], at)["number"]))


def atlas_cloud(atlas: AtlasLike, **at: float) -> xr.Dataset:
    """The cloud of the design at, or nearest to, these parameters, like those of `compute_cloud`.

    Stored tips are rounded to 1e-5 of the shortest length; without them the cloud is computed
    again, exactly as it was, and so are those of loaded designs, whose samples have a status.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        **at: Every parameter [SI units], or `design` and its number.

    Raises:
        InvalidInput: A parameter is missing or unknown, or the design is not done.
    """
    opened = opened_atlas(atlas, metrics=False)
    command = command_of(opened)
    kept = [name for name in ("status", "number", "tip") if name in opened]
    row = _nearest(opened[kept], at)
    if (status := int(row["status"])) not in KNOWN:
        raise InvalidInput("design", at, "done", f"its status is {status}")
    arm = command.space.design(int(row["number"]))
    rod = as_tip_map(arm, command.tol)
    activation = activations_of(rod, opened["unit_activation"].values)
    drawn: Any = {"seed": command.seed, "sampler": command.sampler, "tol": command.tol}
    if rod.supports_unstable:
        tip, stability = with_unstable(rod).tips_and_status(activation)
        return with_status(cloud_dataset(arm, activation, tip, **drawn), stability)
    if "tip" in opened:
        tip = np.ascontiguousarray(row["tip"].values.T, dtype=float)
    else:
        tip = rod.tips(activation)
    return cloud_dataset(arm, activation, tip, **drawn)


def best_designs(
    atlas: AtlasLike,
    metric: str,
    *,
    smallest: bool = False,
    where: str | Sequence[str] = (),
    count: int = 1,
) -> xr.Dataset:
    """The designs with the largest or smallest metric among those that meet the constraints.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        metric: What to compare.
        smallest: Whether smaller values are better.
        where: Constraints that all hold, such as `unreachability<=0.4`; parameters are called by
            their names, or with the units of the command line, as in `taper_deg<=1`.
        count: How many designs at most.

    Returns:
        All metrics and parameters over `rank`, the best first; empty if no design qualifies.

    Raises:
        InvalidInput: No such metric or parameter, or an argument of another kind.
    """
    metric, smallest = as_text("metric", metric), as_flag("smallest", smallest)
    count, opened = as_integer("count", count, 1), opened_atlas(atlas)
    limits = list(_limits(as_names("where", where), opened))
    dims = opened["status"].dims
    numbers = [name for name in opened.data_vars if opened[name].dims == dims]
    _check_known(metric, [str(name) for name in numbers if opened[name].dtype.kind == "f"])
    along = [x for x, c in opened.variables.items() if len(c.dims) == 1 and c.dims[0] in dims]
    stacked = opened[[*numbers, *map(str, along)]].stack(rank=dims, create_index=False)
    allowed = np.isfinite(stacked[metric].values)
    for name, low, high in limits:
        _check_known(name, [str(known) for known in stacked.variables])
        values = stacked[name].values
        allowed &= (values >= low) & (values <= high)
    order = np.argsort(stacked[metric].values * (1 if smallest else -1), kind="stable")
    return stacked.isel(rank=order[allowed[order]][:count])


def _limits(where: Sequence[str], atlas: xr.Dataset) -> Iterator[tuple[str, float, float]]:
    """Variable, lowest and highest value allowed, in SI units."""
    written = {
        written_name(str(name), unit): (str(name), unit)
        for name, values in atlas.variables.items()
        if (unit := values.attrs.get("units", "1"))
    }
    for text, low, high in map(_constraint, where):
        name, unit = written.get(text, (text, "1"))
        yield name, from_written(low, unit), from_written(high, unit)


def _constraint(text: str) -> tuple[str, float, float]:
    """`taper_deg<=1` -> its name, and the numbers between which it is."""
    name, sign, number = (*re.split("([<>]=?)", text, maxsplit=1), "", "")[:3]
    if (values := numbers_in(number, 1)) is None:
        raise InvalidInput("where", text or "''", "a name, <= or >=, and a finite number")
    low, high = (-math.inf, values[0]) if "<" in sign else (values[0], math.inf)
    return name.strip(), low, high


def _verified(store: AtlasStore, *, tips: bool) -> AtlasStatus:
    for name in store.watch.digests.keys() - {*PER_DESIGN}:
        _ = store.array(name)[...]
    numbers = range(store.command.space.size) if tips else ()
    content = contents(store, tips_of=numbers)
    return _counted(content.status, content.messages, tips)


def _counted(status: np.ndarray, messages: dict[int, str], tips_verified: bool) -> AtlasStatus:
    names = ("todo", "done", "failed", "gaps", "unstable", "damaged")  # in the order of the status
    counts = dict(zip(names, np.bincount(status, minlength=len(names)).tolist(), strict=True))
    verified = {"tips_verified": tips_verified, "messages": messages}
    return AtlasStatus(designs=status.size, **counts, **verified)


def _nearest(atlas: xr.Dataset, at: Mapping[str, float]) -> xr.Dataset:
    dims = [str(dim) for dim in atlas["number"].dims]
    if set(at) != set(dims):
        raise InvalidInput("parameters", ", ".join(at) or "none", f"all of {', '.join(dims)}")
    if "design" in at:
        last = atlas.sizes["design"] - 1
        return atlas.isel(design=as_integer("design", at["design"], 0, last))
    place = {name: as_number(name, value) for name, value in at.items()}
    return atlas.sel(place, method="nearest")


def _check_known(name: str, known: list[str]) -> None:
    if name not in known:
        hint = did_you_mean(name, known)
        raise InvalidInput("metric", name, f"one of {', '.join(dict.fromkeys(known))}", hint)
