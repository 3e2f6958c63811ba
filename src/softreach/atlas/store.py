"""The Zarr v3 store of an atlas: one chunk is one design, and its status is written last.

The tasks of a job array may all create a store at once and be killed anywhere: chunks and the root,
which holds the command and lists what describes the arrays, are whole or absent, and of several
roots the first stays; then come the arrays, whose bytes do not depend on the writer. Each carries
the digest of the command, so that the same command, and no other, writes a lost root again.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib.metadata import version
from typing import Any, Self

import numpy as np
import zarr  # noqa: TID253  (imported where stores are)
from numpy.typing import ArrayLike, NDArray
from zarr.codecs import BloscCodec, Crc32cCodec  # noqa: TID253
from zarr.errors import ContainsArrayError  # noqa: TID253
from zarr.storage import MemoryStore, StoreLike, WrapperStore  # noqa: TID253

from softreach.atlas.metrics import Metric
from softreach.atlas.space import Command
from softreach.sampling import sample_cube
from softreach.schema import AXES
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, warn
from softreach.support.files import stores

CUBE = "unit_activation"  # The array of activations that all designs share
PER_DESIGN = ("status", "message", "curvature", "tip", "metrics")  # Arrays whose chunks are designs
OF = "command_sha256"  # Attribute of each array: digest of the command
CUBE_DIGEST = "unit_activation_sha256"  # Attribute of the root: digest of the activations
TODO, DONE, FAILED, GAP, UNSTABLE, DAMAGED = range(6)
KNOWN = (DONE, UNSTABLE)  # The status of designs of which metrics are stored
EXPLAINED = (FAILED, GAP, UNSTABLE)  # The status of designs that have a message
_RESOLUTION = 1e-5  # step of stored tips over the shortest length: off by no more than half of it
_MISSING = int(np.iinfo(np.int32).min)  # in place of a tip that is NaN, or not stored
_CHUNK = 1 << 20  # numbers of a chunk that all designs share
_BOX = "place in the activation box of each design: 0 is its lower bound, 1 its upper"
_STATION = {"units": "1", "long_name": "station Z before activation, over the design's length"}
_NUMBERS = {"flag_values": [*range(6)], "flag_meanings": "to_do done failed gap unstable damaged"}
ABOUT: dict[str, dict[str, Any]] = {"message": {"long_name": "why a design has no numbers"}}
ABOUT["status"] = {"long_name": "status of the design", **_NUMBERS}

Plan = tuple[str, dict[str, Any], Any]  # Array's name, options of `create_array`, values if any


def array_plans(command: Command) -> Iterator[Plan]:
    """Every array of an atlas; activations are drawn, and others brought by designs."""

    def labels(name: str, texts: Sequence[str]) -> Plan:
        data = np.array(texts, dtype=np.dtypes.StringDType())
        return plan(name, str, {name: len(data)}, {}, "", data)

    space, numbers, profiles = command.space, command.numbers, command.profiles
    plan, varied = partial(_plan, command), space.varied()
    designs = dict(zip(space.dims, space.shape, strict=True))
    for name, entries in space.parameters:
        parameter, values = varied[name], np.array(entries)
        about: dict[str, Any] = {
            "units": parameter.unit,
            "long_name": parameter.meaning,
            "symbol": parameter.symbol,
            "part": parameter.owner,
        }
        dim = name if space.layout == "grid" else "design"
        fill = 0 if values.dtype == int else np.nan
        yield plan(name, values.dtype, {dim: len(values)}, about, fill, values)
    yield labels("metric", [metric.name for metric in numbers])
    yield labels("axis", AXES)
    about = {"units": "1", "long_name": _BOX}
    yield plan(CUBE, float, {"sample": command.n, "bundle": space.bundles}, about)
    yield plan("status", np.uint8, designs, ABOUT["status"], 0)
    yield plan("message", str, designs, ABOUT["message"], "")
    if profiles:
        yield labels("quantity", [metric.name for metric in profiles])
        for name, values in (("station", command.stations), ("quantile", command.quantiles)):
            about = _STATION if name == "station" else {"units": "1"}
            yield plan(name, float, {name: len(values)}, about, data=np.array(values))
        about = {"long_name": "metrics over stations and quantiles", "metrics": _meanings(profiles)}
        sizes = designs | {"quantity": len(profiles)} | command.profile_sizes
        yield plan("curvature", float, sizes, about)
    if command.keep_clouds:  # as fixed-point numbers: half the size, and the same error everywhere
        step = _RESOLUTION * space.length_range[0]
        about = {"units": "m", "long_name": "tip position", "scale_factor": step}
        about["_FillValue"] = _MISSING
        sizes = designs | {"axis": len(AXES), "sample": command.n}
        yield plan("tip", np.int32, sizes, about, _MISSING)
    about = {"long_name": "metrics of the designs", "metrics": _meanings(numbers)}
    about["alpha_over_length"] = command.alpha_over_length
    yield plan("metrics", float, designs | {"metric": len(numbers)}, about)


def _plan(
    command: Command,
    name: str,
    dtype: Any,
    sizes: dict[str, int],
    attrs: dict[str, Any],
    fill: Any = np.nan,
    data: Any = None,
) -> Plan:
    """With codecs of the Zarr v3 core, which every reader has; a checksum comes last."""
    if name in PER_DESIGN:
        chunks = [1 if dim in command.space.dims else size for dim, size in sizes.items()]
    else:
        chunks = [min(size, _CHUNK) for size in sizes.values()]
    options = {
        "shape": tuple(sizes.values()),
        "dtype": dtype,
        "fill_value": fill,
        "chunks": tuple(max(size, 1) for size in chunks),
        "compressors": (Crc32cCodec(),),
        "dimension_names": tuple(sizes),
        "attributes": attrs | {OF: stores.sha256(command.to_json().encode())},
    }
    if name == "tip":  # activations are random bits, and the same bytes anywhere
        blosc = BloscCodec(cname="zstd", clevel=5, shuffle="bitshuffle")
        options["compressors"] = blosc, Crc32cCodec()
    return name, options, data


def _meanings(metrics: Sequence[Metric]) -> str:
    return "; ".join(f"{metric.name} [{metric.unit}]: {metric.meaning}" for metric in metrics)


@dataclass(frozen=True, eq=False)
class AtlasStore:
    """An atlas on disk, or behind a URL, that designs are written to."""

    location: StoreLike
    command: Command
    opened: stores.Opened = field(repr=False)
    _arrays: dict[str, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def begin(cls, location: StoreLike, command: Command) -> Self:
        """Create the store, or open one that the same command began, and mend what is damaged."""
        location = stores.absolute(location)
        opened, open_it = None, partial(stores.opened_store, location, "atlas")
        with stores.writing(location):
            with suppress(stores.DamagedStore):
                opened = open_it("r+")
            if opened is None:
                _write_root(location, command)
                opened = open_it("r+")
        allowed = "a new folder, or an atlas; this one holds other files"
        opened, stored = _with_command(opened, location, allowed)
        if (begun := stored.softreach_version) != (now := command.softreach_version):
            command = command.continuing(stored)
            warn(f"{location} was begun by softreach {begun}; softreach {now} goes on with it")
        if differences := command.differences(stored):
            hint = f"this one differs in {'; '.join(differences)}"
            raise InvalidInput("store", location, "new, or begun by the same command", hint)
        store = cls(location, command, opened)  # this command has all functions
        with stores.writing(location), opened.noting():  # what is damaged counts as missing
            _complete(store)
        return store

    @classmethod
    def open(cls, location: StoreLike, mode: stores.Mode = "r+") -> Self:
        """Open an atlas, in mode "r" at a place that cannot be written to."""
        location = stores.absolute(location)
        opened = stores.opened_store(location, "atlas", mode)
        lacks = f"it does not exist, or has no {stores.ROOT}"
        allowed = f"an atlas written by build_atlas; {'this is no atlas' if opened else lacks}"
        opened, command = _with_command(opened, location, allowed)
        opened.check_arrays()
        return cls(location, command, opened)

    def array(self, name: str) -> Any:
        """One of the arrays, which writes also chunks that are empty."""
        if name not in self._arrays:
            # No message is no chunk; all else is written, so that what is missing is damaged.
            config: Any = {"write_empty_chunks": name != "message"}
            array: Any = self.opened.group[name]
            self._arrays[name] = array.with_config(config)
        return self._arrays[name]

    def status(self) -> NDArray[np.uint8]:
        """The status of every design, TODO to DAMAGED, in C order, shape (designs,)."""
        with self.opened.noting() as noted:
            status = np.array(self.array("status")[...]).ravel()
        status[[self.number(chunk) for chunk in noted]] = DAMAGED
        return status

    def number(self, chunk: stores.Chunk) -> int:
        """The design that a chunk belongs to."""
        shape = self.command.space.shape
        return int(np.ravel_multi_index((chunk.place or ())[: len(shape)], shape))

    def message(self, index: int) -> str:
        """Why a design has no numbers; empty if there is no reason."""
        return str(np.asarray(self.array("message")[self.command.space.place(index)]).item())

    @cached_property
    def cube(self) -> Array:
        """Unit activations that all designs share, shape (n, bundles)."""
        with stores.storage_errors(f"{self.location} cannot be read"):
            return np.asarray(self.array(CUBE)[...])

    def write(
        self,
        index: int,
        metrics: Mapping[str, ArrayLike],
        tips: Array | None,
        status: int = DONE,
        message: str = "",
    ) -> None:
        """Store metrics by name and tips [m], shape (n, 3), of a design; its status comes last.

        Tips are NaN without equilibrium, and None if clouds are not kept.
        """
        place, command = self.command.space.place(index), self.command
        with stores.writing(self.location):
            self.array("metrics")[place] = np.array([metrics[m.name] for m in command.numbers])
            if command.profiles:
                self.array("curvature")[place] = [metrics[m.name] for m in command.profiles]
            if tips is not None:
                tip = self.array("tip")
                tip[place] = fixed_point(tips, float(str(tip.attrs["scale_factor"])))
            self.write_status(index, message, status)

    def write_status(self, index: int, message: str, status: int = FAILED) -> None:
        """Store how a design ended, and why."""
        place = self.command.space.place(index)
        with stores.writing(self.location):
            self.array("message")[place] = np.array(message, dtype=np.dtypes.StringDType())
            self.array("status")[place] = status


def fixed_point(tips: Array, scale: float) -> NDArray[np.int32]:
    """Tips as whole multiples of the scale, shape (3, n); NaN as what fills missing ones."""
    steps = np.rint(tips.T / scale)
    return np.where(np.isnan(steps), _MISSING, steps).astype(np.int32)


def _with_command(
    opened: stores.Opened | None, location: StoreLike, allowed: str
) -> tuple[stores.Opened, Command]:
    """A store and its command; what all designs share must be there from now on."""
    text = None if opened is None else opened.group.attrs.get("command")
    if opened is None or not isinstance(text, str):
        raise InvalidInput("store", location, allowed)
    opened.required = lambda chunk: chunk.array not in PER_DESIGN
    return opened, Command.from_json(text)


def _write_root(location: StoreLike, command: Command) -> None:
    place = stores.place_of(location, "r+")
    lost = False  # of a store that this command began, whose root is damaged or gone
    for name, _, _ in array_plans(command):
        with suppress(Exception):  # each kind of store has its own for what is missing or damaged
            array = zarr.open_array(place / name, mode="r", zarr_format=3)
            lost = array.attrs[OF] == stores.sha256(command.to_json().encode())
            break

    class Root(WrapperStore):
        """Zarr's groups have no exclusive mode, but its stores set a key only if it is missing."""

        async def get(self, key: str, prototype: Any, byte_range: Any = None) -> None:
            return None

        async def set(self, key: str, value: Any) -> None:
            value = type(value).from_bytes(stores.sealed(value.to_bytes()))
            if lost:
                return await super().set(key, value)
            names = [name async for name in self.list_dir(key.rpartition("/")[0])]
            # In this order: files of a claim made in between are not foreign.
            if not all(name.endswith(".partial") for name in names) and not await self.exists(key):
                raise InvalidInput("store", location, "a new folder, or an atlas")
            return await self.set_if_not_exists(key, value)

    attributes = _attributes(command)
    zarr.create_group(Root(place.store), path=place.path, zarr_format=3, attributes=attributes)


def _attributes(command: Command) -> dict[str, Any]:
    """Attributes of the root, in which what describes the arrays is listed before it is written."""
    memory: dict[str, Any] = {}
    group = zarr.create_group(MemoryStore(memory), zarr_format=3)
    digests: dict[str, str] = {}
    for name, options, _ in array_plans(command):
        group.create_array(name, **options)
        digests[name] = stores.sha256(memory[f"{name}/{stores.ROOT}"].to_bytes())
    versions = {name: version(name) for name in ("numpy", "scipy", "zarr", "xarray", "numba")}
    about: dict[str, Any] = {
        "title": "reachability cloud atlas",
        "design": command.space.base.to_toml(),
        CUBE_DIGEST: drawn_cube(command)[1],
        "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
    }
    return about | {
        "command": command.to_json(),
        stores.ARRAYS: digests,
        stores.DIGEST: stores.BLANK,
    }


def _complete(store: AtlasStore) -> None:
    """Write what all designs share, and the gaps, where they lack or err."""
    for name, options, data in array_plans(store.command):
        with store.opened.noting() as noted:
            there = name in store.opened.group
            if there and name not in PER_DESIGN:
                _ = store.array(name)[...]
        if there and not noted:
            continue
        with suppress(ContainsArrayError):  # begun by another task, or only its values are lost
            store.opened.group.create_array(name, **options)
        if name == CUBE:
            data, drawn = drawn_cube(store.command)
            if drawn != store.opened.group.attrs[CUBE_DIGEST]:
                other = "this machine draws other activations than the one that began it"
                raise stores.StoreFailed(f"{store.location}: {other}")
        if data is not None:
            store.array(name)[...] = data
    gaps = store.command.space.gaps
    status = store.status() if gaps else np.empty(0)
    for index, reason in gaps.items():
        if status[index] != GAP or store.message(index) != reason:
            store.write_status(index, reason, GAP)


def drawn_cube(command: Command) -> tuple[Array, str]:
    """The activations that the command draws on this machine, and their SHA-256."""
    cube = sample_cube(command.sampler, command.n, command.space.bundles, command.seed)
    return cube, stores.sha256(np.ascontiguousarray(cube).tobytes())
