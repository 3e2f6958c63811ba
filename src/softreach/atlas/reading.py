"""Reading an atlas, also while it is being written: a dataset, and questions about its designs."""

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from zarr.abc.store import Store  # noqa: TID253  (imported where stores are)
from zarr.storage import StoreLike, StorePath  # noqa: TID253

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import from_written, written_name
from softreach.atlas.metrics import Need, activations_of
from softreach.atlas.space import Command
from softreach.atlas.store import ABOUT, DAMAGED, EXPLAINED, KNOWN, OF, PER_DESIGN, AtlasStore
from softreach.rod.rods import as_tip_map, with_unstable
from softreach.schema import cloud_dataset, stored_names, with_status
from softreach.support import arguments
from softreach.support.errors import InvalidInput, counted, did_you_mean, warn
from softreach.support.files.stores import ARRAYS, DIGEST, READING, Chunk, storage_errors
from softreach.support.lazy import DataArray, Dataset
from softreach.support.quantity import columns, numbers_in

AtlasLike = StoreLike | Dataset

_POWERS = {"m": 1, "m2": 2, "m3": 3, "1/m": -1}
_READ_HERE = ("metrics", "metric", "curvature", "quantity", "status", "message")
_QUICK = 3e8  # bytes of tips
_MOST_MESSAGES = 10


def open_atlas(store: StoreLike) -> Dataset:
    """An atlas with a dimension for each parameter, so that ``atlas.volume.sel(taper=...)`` works.

    Clouds are read when they are used. Designs that are not done are NaN, and so are those of which
    no activation is stable, but for their `lost_share`.

    Args:
        store: Path, URL or Zarr store.

    Returns:
        Dataset over the parameters of a grid [SI units], or over `design`: the metrics (see their
        attributes), quantiles of curvature, `status`, `unit_activation`, and `tip` [m] if clouds
        were kept; as coordinates the parameters, the `length` [m], and the `number` of each design
        with the `message` that says why it has no metrics.

    Raises:
        InvalidInput: There is no atlas.
        DamagedStore: What all designs share is damaged; tips raise it when they are read.

    Warns:
        SoftreachWarning: Designs are damaged; they are NaN, and their status says so.
    """
    return _opened(a_store("store", store), metrics=True)


def over_length(atlas: Dataset, metric: str) -> DataArray:
    """A metric relative to each design's own length: V / L³, heights over L, curvatures times L.

    Args:
        atlas: From `open_atlas`.
        metric: Which one; without a length in its unit it stays as it is.

    Raises:
        InvalidInput: No atlas, or a metric that it does not have.
    """
    atlas = arguments.as_dataset("atlas", atlas, "length", what="an atlas")
    if arguments.as_text("metric", metric) not in atlas:
        raise InvalidInput("metric", metric, f"one of {', '.join(map(str, atlas.data_vars))}")
    values = atlas[metric]
    power = _POWERS.get(values.attrs.get("units", "1"), 0)
    if not power:
        return values
    relative = (values / atlas["length"] ** power).transpose(*values.dims)
    return relative.assign_attrs({**values.attrs, "units": "1"})


@dataclass(frozen=True, kw_only=True)
class AtlasStatus:
    """Status of an atlas: numbers of its designs."""

    designs: int
    """Number of designs, gaps among them."""
    done: int
    """Designs whose cloud and metrics are stored."""
    failed: int
    """Designs that failed; `messages` says why."""
    gaps: int
    """Combinations of parameters that no arm can have."""
    unstable: int
    """Designs of which no activation has a stable equilibrium."""
    damaged: int
    """Designs of which a stored chunk is damaged; the command that built them does so again."""
    todo: int
    """Designs that are still to be computed."""
    tips_verified: bool = field(compare=False)
    """True if stored tips were read too, or there are none."""
    messages: dict[int, str]
    """Messages of designs that failed, cannot exist, are nowhere stable or damaged, by number."""

    def __str__(self) -> str:
        counts = ("designs", "done", "todo", "failed", "gaps", "unstable", "damaged")
        rows = [(name, f"{getattr(self, name):,}") for name in counts]
        verified = "yes" if self.tips_verified else "no: softreach atlas status --verify"
        rows.append(("tips verified", verified))
        rows += [(f"number {k}", text) for k, text in self.messages.items()][:_MOST_MESSAGES]
        return "\n".join(columns(rows))


def atlas_status(atlas: AtlasLike) -> AtlasStatus:
    """Number of designs of an atlas that are done, and faults of the others.

    Metrics are verified, and tips on disk that take a second at most; `verify_atlas` reads all.

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
    """Read all of an atlas: what is damaged, which its command repairs, and how much is done.

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


def atlas_cloud(atlas: AtlasLike, **at: float) -> Dataset:
    """The cloud of the design at, or nearest to, these parameters, like those of `compute_cloud`.

    Stored tips are rounded to 1e-5 of the shortest length; without them, and of loaded designs,
    whose samples have a status, the cloud is computed again, exactly as it was.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        **at: Every parameter [SI units], or `design` and its number.

    Raises:
        InvalidInput: A parameter is missing or unknown, or the design is not done.
    """
    opened = opened_atlas(atlas, metrics=False)
    command = command_of(opened)
    row = _nearest(opened[[name for name in ("status", "number", "tip") if name in opened]], at)
    if (status := int(row["status"])) not in KNOWN:
        raise InvalidInput("design", at, "done", f"its status is {status}")
    arm = command.space.design(int(row["number"]))
    rod = as_tip_map(arm, command.tol)
    activation = activations_of(rod, opened["unit_activation"].values)
    drawn: Any = {"seed": command.seed, "sampler": command.sampler, "tol": command.tol}
    if rod.supports_unstable:
        tip, stability = with_unstable(rod).tips_and_status(activation)
        return with_status(cloud_dataset(arm, activation, tip, **drawn), stability)
    kept = "tip" in opened
    tip = np.ascontiguousarray(row["tip"].values.T, float) if kept else rod.tips(activation)
    return cloud_dataset(arm, activation, tip, **drawn)


def best_designs(
    atlas: AtlasLike,
    metric: str,
    *,
    smallest: bool = False,
    where: str | Sequence[str] = (),
    count: int = 1,
) -> Dataset:
    """The designs with the largest or smallest metric among those that meet the constraints.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        metric: What to compare.
        smallest: Whether smaller values are better.
        where: Constraints that all hold, such as `unreachability<=0.4`, or `taper_deg<=1` in the
            units of the command line.
        count: How many designs at most.

    Returns:
        All metrics and parameters over `rank`, the best first; empty if no design qualifies.

    Raises:
        InvalidInput: No such metric or parameter, or an argument of another kind.

    Examples:
        >>> space = sr.DesignSpace.grid(sr.designs.minimal_trunk(), taper=[0.0, 0.03])
        >>> atlas = sr.build_atlas(space, "tapers.zarr", n=500, metrics=["convex"])
        >>> sr.atlas.best_designs(atlas, "convex_volume").taper.values
        array([0.])
    """
    metric, smallest = arguments.as_text("metric", metric), arguments.as_flag("smallest", smallest)
    count, opened = arguments.as_integer("count", count, 1), opened_atlas(atlas)
    limits = list(_limits(arguments.as_names("where", where), opened))
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


class Contents(NamedTuple):
    """Contents of an atlas but its tips, each chunk checked."""

    status: NDArray[np.uint8]  # DAMAGED for designs of which a chunk is, shape (designs,)
    messages: dict[int, str]  # As `AtlasStatus` has them
    tables: dict[str, Any]  # Arrays `metrics` and `curvature`; fill values where they are damaged

    def warn_of_damage(self, then: str) -> None:
        """Say how many designs are damaged, and what is wrong with the first of them."""
        if damaged := np.flatnonzero(self.status == DAMAGED).tolist():
            first = f"first number {damaged[0]}: {self.messages[damaged[0]]}"
            are = "is" if len(damaged) == 1 else "are"
            warn(f"{counted(len(damaged), 'design')} {are} damaged, {first}{then}")


def contents(store: AtlasStore, *, metrics: bool = True, tips_of: Iterable[int] = ()) -> Contents:
    """Read and check what an atlas holds of its designs; it misses their chunks from now on.

    Without `metrics` only the status and messages are checked; tips are read, but not kept.
    """
    damaged: dict[int, str] = {}

    def read(name: str, place: Any = ...) -> NDArray[Any]:
        array = store.array(name)
        with store.opened.noting() as noted:
            values = np.array(array[place])
        for chunk, error in noted.items():
            damaged.setdefault(store.number(chunk), str(error))
        return values

    place_of, command = store.command.space.place, store.command
    status = read("status").ravel()
    known, explained = np.isin(status, KNOWN), np.isin(status, EXPLAINED)

    def required(chunk: Chunk) -> bool:
        if chunk.array not in PER_DESIGN:
            return True
        of_designs = explained if chunk.array == "message" else known
        return chunk.array != "status" and bool(of_designs[store.number(chunk)])

    store.opened.required = required
    names = ["metrics", *["curvature"] * bool(command.profiles)] if metrics else []
    tables = {x: read(x) if known.any() else np.full(store.array(x).shape, np.nan) for x in names}
    for index in tips_of if command.keep_clouds else ():
        if known[index]:
            read("tip", place_of(index))
    numbers = np.flatnonzero(explained).tolist()
    texts = {index: str(read("message", place_of(index)).item()) for index in numbers}
    status[[*damaged]] = DAMAGED
    return Contents(status, dict(sorted((texts | damaged).items())), tables)


def a_store(name: str, value: Any, allowed: str = "a path, a URL or a Zarr store") -> Any:
    """A place where an atlas may be."""
    if isinstance(value, str | os.PathLike):
        return arguments.as_path(name, value)
    if isinstance(value, dict) and all(hasattr(content, "to_bytes") for content in value.values()):
        return value  # a store in memory
    return arguments.as_instance(name, value, (Store, StorePath), allowed)


def opened_atlas(atlas: AtlasLike, *, metrics: bool = True) -> Dataset:
    """The dataset that answers questions; reading all metrics of a large store takes time."""
    import xarray as xr

    allowed = "a store, or a dataset from open_atlas"
    if not isinstance(atlas, xr.Dataset):
        return _opened(a_store("atlas", atlas, allowed), metrics=metrics)
    if "command" not in atlas.attrs or "status" not in atlas:
        raise InvalidInput("atlas", "another Dataset", allowed)
    return atlas


def command_of(atlas: Dataset) -> Command:
    """Command that built the atlas."""
    return Command.from_json(atlas.attrs["command"])


def _limits(where: Sequence[str], atlas: Dataset) -> Iterator[tuple[str, float, float]]:
    """Variable, lowest and highest value allowed, in SI units."""
    units = {str(name): x.attrs.get("units", "1") for name, x in atlas.variables.items()}
    written = {written_name(name, unit): (name, unit) for name, unit in units.items() if unit}
    for text in where:
        given, sign, number = (*re.split("([<>]=?)", text, maxsplit=1), "", "")[:3]
        if (values := numbers_in(number, 1)) is None:
            raise InvalidInput("where", text or "''", "a name, <= or >=, and a finite number")
        name, unit = written.get(given.strip(), (given.strip(), "1"))
        limit = from_written(values[0], unit)
        yield (name, -math.inf, limit) if "<" in sign else (name, limit, math.inf)


def _verified(store: AtlasStore, *, tips: bool) -> AtlasStatus:
    for name in store.opened.digests.keys() - {*PER_DESIGN}:
        _ = store.array(name)[...]
    content = contents(store, tips_of=range(store.command.space.size) if tips else ())
    return _counted(content.status, content.messages, tips)


def _counted(status: np.ndarray, messages: dict[int, str], tips_verified: bool) -> AtlasStatus:
    names = ("todo", "done", "failed", "gaps", "unstable", "damaged")  # in the order of the status
    counts: Any = zip(names, np.bincount(status, minlength=len(names)).tolist(), strict=True)
    known = {"tips_verified": tips_verified, "messages": messages}
    return AtlasStatus(designs=status.size, **dict(counts), **known)


def _nearest(atlas: Dataset, at: Mapping[str, float]) -> Dataset:
    dims = [str(dim) for dim in atlas["number"].dims]
    if set(at) != set(dims):
        raise InvalidInput("parameters", ", ".join(at) or "none", f"all of {', '.join(dims)}")
    if "design" in at:
        last = atlas.sizes["design"] - 1
        return atlas.isel(design=arguments.as_integer("design", at["design"], 0, last))
    place = {name: arguments.as_number(name, value) for name, value in at.items()}
    return atlas.sel(place, method="nearest")


def _check_known(name: str, known: list[str]) -> None:
    if name not in known:
        hint = did_you_mean(name, known)
        raise InvalidInput("metric", name, f"one of {', '.join(dict.fromkeys(known))}", hint)


def _opened(location: StoreLike, *, metrics: bool) -> Dataset:
    import xarray as xr

    store = AtlasStore.open(location, "r")
    content, space = contents(store, metrics=metrics), store.command.space
    then = "left out; run the command that built the atlas to compute them again"
    content.warn_of_damage(f" ({then})")
    with storage_errors(f"{store.location} cannot be read"):
        raw = xr.open_zarr(store.opened.place, drop_variables=_READ_HERE, **READING)
        length = ((), space.length_range[0], {"units": "m"})
        coordinates: dict[str, Any] = {"length": length} | {x: raw[x] for x in space.names}
    for variable in (raw, *raw.variables.values()):
        for name in (ARRAYS, DIGEST, OF):
            variable.attrs.pop(name, None)
    numbers = np.arange(space.size, dtype=np.uint32).reshape(space.shape)
    coordinates["number"] = space.dims, numbers, {"long_name": "number of the design"}
    opened = raw.assign(_variables(store, content)).assign_coords(coordinates)
    opened = stored_names(opened).set_coords("message")
    opened.encoding["source"] = str(store.location)
    return opened


def _variables(store: AtlasStore, content: Contents) -> dict[str, Any]:
    command, shape, dims = store.command, store.command.space.shape, store.command.space.dims
    texts = np.full(command.space.size, "", dtype=object)
    texts[[*content.messages]] = [*content.messages.values()]
    variables: dict[str, Any] = {"status": (dims, content.status.reshape(shape), ABOUT["status"])}
    variables["message"] = dims, texts.reshape(shape), ABOUT["message"]
    done = np.isin(content.status, KNOWN).reshape(shape)
    for name, metrics in (("metrics", command.numbers), ("curvature", command.profiles)):
        for k, metric in enumerate(metrics if name in content.tables else ()):
            table = np.moveaxis(content.tables[name], len(dims), 0)[k]
            known = np.expand_dims(done, (*range(done.ndim, table.ndim),))
            values = np.where(known, table, np.nan)
            about: dict[str, Any] = {"units": metric.unit, "long_name": metric.meaning}
            if Need.ALPHA in metric.needs:
                about["alpha_over_length"] = command.alpha_over_length
            variables[metric.name] = (*dims, *metric.over), values, about
    return variables
