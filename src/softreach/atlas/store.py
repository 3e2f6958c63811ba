"""The Zarr v3 store of an atlas: one chunk is one design, and its status is written last.

No two tasks ever write to the same chunk. Zarr's local store writes every chunk beside its place
and renames it, so a killed writer leaves chunks whole or absent; a design whose status is missing
is computed again, whatever else of it exists. The chunk before the last binds the others to their
design and to the root, so that one of another design or store is damage too; what all designs share
is listed in the root.

A store is created in three steps, so that the tasks of a job array may all do it at once and be
killed anywhere: its root, which holds the command, appears at once and is never written again, so
that everybody knows whose store it is; then come the arrays, whose bytes are the same whoever
writes them, so that a late creator changes nothing; `metrics` is the last of them, and nobody
reads a store or adds designs without it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.atlas.binding import bind, binding_of
from softreach.atlas.command import Command
from softreach.atlas.layout import CHECKSUM, CUBE, FILES, MISSING, SEAL, Plan, array_plans
from softreach.sampling import sample_cube
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.files.damage import Chunk, StoreFailed, Watch, storage_errors, writing
from softreach.support.files.documents import ARRAYS, CHUNKS
from softreach.support.files.stores import (
    REMEDY,
    CheckedStore,
    Opened,
    absence,
    absolute,
    checked_place,
    checksums_by_key,
    opened_root,
)

if TYPE_CHECKING:
    import zarr
    from zarr.abc.store import Store
    from zarr.storage import StoreLike


TODO, DONE, FAILED, GAP, UNSTABLE, DAMAGED = range(6)
KNOWN = (DONE, UNSTABLE)
"""The status of designs of which metrics are stored."""

PER_DESIGN = (*FILES, CHECKSUM)
"""The arrays whose chunks are designs."""


class Result(NamedTuple):
    """Stored result of one design."""

    metrics: Mapping[str, ArrayLike]
    """Every metric of the command by name."""
    tips: Array | None
    """Tips [m], shape (n, 3), NaN without equilibrium; None if clouds are not kept."""


@dataclass(frozen=True, eq=False)
class AtlasStore:
    """An atlas on disk, or behind a URL, that designs are written to."""

    location: StoreLike
    command: Command
    opened: Opened = field(repr=False)

    @classmethod
    def begin(cls, location: StoreLike, command: Command, *, durable: bool = False) -> Self:
        """Create the store, or open one that the same command began, and mend what is damaged.

        Args:
            location: Where it is.
            command: What it holds.
            durable: Whether a power cut may lose nothing that was written.

        Raises:
            InvalidInput: The place holds something else, or an atlas of another command, and how
                that differs.
            DamagedStore: Its root is damaged, so that nobody knows whose store it is.
            StoreFailed: It cannot be written to.
        """
        location = absolute(location)
        with writing(location):
            if opened_root(location, "atlas", "r+") is None:
                _claim(location, command, durable=durable)
        opened, begun = cls._begun(location, durable)
        if differences := command.differences(begun):
            hint = f"it differs in {'; '.join(differences)}"
            raise InvalidInput("store", location, "new, or begun by the same command", hint)
        store = cls(location, command, opened)  # this command has all functions
        with writing(location):
            _complete(store)
        return store

    @classmethod
    def open(
        cls, location: StoreLike, mode: Literal["r", "r+"] = "r+", *, durable: bool = False
    ) -> Self:
        """Open an atlas.

        Args:
            location: Where it is.
            mode: "r" for a place that cannot be written to.
            durable: Whether a power cut may lose nothing that is written.

        Raises:
            InvalidInput: There is none, or of another version.
            DamagedStore: What describes it, or one of its arrays, is damaged.
        """
        location = absolute(location)
        opened = opened_root(location, "atlas", mode, durable=durable)
        text = None if opened is None else opened.group.attrs.get("command")
        if opened is None or not isinstance(text, str):
            hint = absence(location) if opened is None else "this is no atlas"
            raise InvalidInput("store", location, "an atlas written by build_atlas", hint)
        if SEAL not in opened.group:
            hint = "it is not complete: the command that began it goes on"
            raise InvalidInput("store", location, "an atlas written by build_atlas", hint)
        store = cls(location, Command.from_json(text), opened)
        opened.watch.required = _is_shared
        for plan in store.plans:
            store.check(plan.name, plan.shape, plan.dims, plan.dtype)
        return store

    @classmethod
    def _begun(cls, location: StoreLike, durable: bool) -> tuple[Opened, Command]:
        """The store and its command, though its arrays may be missing."""
        opened = opened_root(location, "atlas", "r+", durable=durable)
        text = None if opened is None else opened.group.attrs.get("command")
        if opened is None or not isinstance(text, str):
            allowed = "a new folder, or an atlas; it holds something else"
            raise InvalidInput("store", location, allowed)
        opened.watch.required = _is_shared
        return opened, Command.from_json(text)

    @property
    def group(self) -> zarr.Group:
        """The arrays."""
        return self.opened.group

    @property
    def is_bound(self) -> bool:
        """True if chunks are bound to their designs; those of earlier versions are not."""
        return CHECKSUM in self.watch.digests

    @property
    def plans(self) -> list[Plan]:
        """Plans of its arrays, the seal last."""
        plans = array_plans(self.command)
        return [plan for plan in plans if plan.name != CHECKSUM or self.is_bound]

    @property
    def watch(self) -> Watch:
        """Watch over damage that is found."""
        return self.opened.watch

    @property
    def durable(self) -> bool:
        """True if a power cut may lose nothing that was written."""
        return self.opened.durable

    def check(self, name: str, shape: tuple[int, ...], dims: tuple[str, ...], dtype: Any) -> None:
        """Check that an array is there and of this kind.

        Raises:
            DamagedStore: It is not.
        """
        array = self.array(name)
        actual = array.shape, array.metadata.dimension_names, _kind(array.dtype)
        expected = shape, dims, _kind(dtype)
        if actual != expected:
            shown, allowed = (f"of shape {s} over {d} of {k}" for s, d, k in (actual, expected))
            self.watch.report(Chunk(name, None), shown, allowed)

    def array(self, name: str) -> Any:
        """One of the arrays, which writes also chunks that are empty.

        Raises:
            DamagedStore: It is missing, or what describes it is damaged.
        """
        if name not in self._arrays:
            try:
                array: Any = self.group[name]
            except KeyError:
                self.watch.report(Chunk(name, None), "missing")
                raise
            # No message is no chunk; all else is written, so that what is missing is damaged.
            empty = name != "message"
            self._arrays[name] = array.with_config({"write_empty_chunks": empty})
        return self._arrays[name]

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        return {}

    def status(self) -> NDArray[np.uint8]:
        """The status of every design, TODO to DAMAGED, in C order, shape (designs,)."""
        array = self.array("status")
        with self.watch.noting() as noted:
            status = np.array(array[...]).ravel()
        damaged = [self.number(chunk) for chunk in noted]
        if self.is_bound:
            damaged += bind(self, status, np.isin(status, KNOWN))
        status[damaged] = DAMAGED
        return status

    def number(self, chunk: Chunk) -> int:
        """The design that a chunk belongs to."""
        shape = self.command.space.shape
        return int(np.ravel_multi_index((chunk.place or ())[: len(shape)], shape))

    def messages(self) -> dict[int, str]:
        """Messages of designs that failed, cannot exist or are nowhere stable, by number."""
        told = np.flatnonzero(np.isin(self.status(), (FAILED, GAP, UNSTABLE))).tolist()
        return {index: self.message(index) for index in told}

    def message(self, index: int) -> str:
        """Message of a design that has no numbers; empty if there is no reason."""
        return str(np.asarray(self.array("message")[self.command.space.place(index)]).item())

    @cached_property
    def cube(self) -> Array:
        """Unit activations that all designs share, shape (n, bundles).

        Raises:
            DamagedStore: They are not what they were when the store was created.
        """
        array = self.array(CUBE)
        with storage_errors(f"{self.location} cannot be read"):
            cube = np.asarray(array[...])
        if digest(cube) != self.cube_digest:
            self.watch.report(Chunk(CUBE, None), "with other activations")
        return cube

    @property
    def cube_digest(self) -> object:
        """Digest of the activations."""
        return self.group.attrs["unit_activation_sha256"]

    def write(self, index: int, result: Result, status: int = DONE, message: str = "") -> None:
        """Store a design; its status comes last.

        Raises:
            StoreFailed: It cannot be written.
        """
        place = self.command.space.place(index)
        numbers = [result.metrics[metric.name] for metric in self.command.numbers]
        profiles = [result.metrics[metric.name] for metric in self.command.profiles]
        with writing(self.location):
            self.array("metrics")[place] = np.array(numbers, float)
            if profiles:
                self.array("curvature")[place] = np.array(profiles, float)
            if result.tips is not None:
                tip = self.array("tip")
                tip[place] = fixed_point(result.tips, float(str(tip.attrs["scale_factor"])))
            self.write_status(index, message, status)

    def write_failure(self, index: int, message: str, status: int = FAILED) -> None:
        """Store why a design has no numbers.

        Raises:
            StoreFailed: It cannot be written.
        """
        with writing(self.location):
            self.write_status(index, message, status)

    def write_status(self, index: int, message: str, status: int) -> None:
        """Store how a design ended, and why."""
        place = self.command.space.place(index)
        self.array("message")[place] = np.array(message, dtype=np.dtypes.StringDType())
        if self.is_bound:
            self.array(CHECKSUM)[place] = binding_of(self, place, status)
        self.array("status")[place] = status


def fixed_point(tips: Array, scale: float) -> NDArray[np.int32]:
    """Tips as whole multiples of the scale, shape (3, n); NaN as what fills missing ones."""
    steps = np.rint(tips.T / scale)
    return np.where(np.isnan(steps), MISSING, steps).astype(np.int32)


def drawn_cube(command: Command) -> Array:
    """The activations that the command draws on this machine."""
    return sample_cube(command.sampler, command.n, command.space.bundles, command.seed)


def digest(cube: Array) -> str:
    """SHA-256 of activations."""
    return hashlib.sha256(np.ascontiguousarray(cube).tobytes()).hexdigest()


def _attributes(command: Command) -> dict[str, Any]:
    """Attributes of the root."""
    versions = {name: version(name) for name in ("numpy", "scipy", "zarr", "xarray", "numba")}
    cube = drawn_cube(command)
    return {
        "title": "reachability cloud atlas",
        "design": command.space.base.to_toml(),
        "unit_activation_sha256": digest(cube),
        "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
        "command": command.to_json(),
        **_lists(command, cube),
    }


def _lists(command: Command, cube: Array) -> dict[str, Any]:
    """Digest of what describes each array, and checksums of what all designs share.

    They are known before any of it is written, as its bytes are the same whoever writes them.
    """
    import zarr
    from zarr.storage import MemoryStore

    watch = Watch(location="memory", remedy="")
    group = zarr.create_group(CheckedStore(MemoryStore(), watch, ""), zarr_format=3)
    plans = {plan.name: plan for plan in array_plans(command)}
    for name, plan in plans.items():
        array, data = _described(group, plan), cube if name == CUBE else plan.data
        if data is not None:
            array[...] = data
    shared = [name for name in plans if name not in PER_DESIGN]
    return {ARRAYS: watch.digests, CHUNKS: checksums_by_key(watch, *shared)}


def _is_shared(chunk: Chunk) -> bool:
    return chunk.array not in PER_DESIGN


def _kind(dtype: Any) -> str:
    """Name of a type of numbers, or str."""
    kind = np.dtype(dtype)
    return "str" if kind.kind in "UTO" else kind.name


def _claim(location: StoreLike, command: Command, *, durable: bool = False) -> None:
    """Write the root of a store, whole and only once: of several who try, the first succeeds.

    Raises:
        InvalidInput: The place holds something else.
    """
    import zarr
    from zarr.errors import ContainsGroupError

    watch = Watch(location=location, remedy=REMEDY["atlas"])
    place = checked_place(location, watch, mode="r+", durable=durable)
    store = _first_wins(place.store, location)
    with suppress(ContainsGroupError):
        zarr.create_group(store, path=place.path, zarr_format=3, attributes=_attributes(command))


def _first_wins(store: Store, location: StoreLike) -> Store:
    """The same store, to which only what is missing is written, and nothing beside other files.

    Zarr's groups have no exclusive mode, but its stores do: a key is set only if it is missing.
    """
    from zarr.storage import WrapperStore

    class FirstWins(WrapperStore):
        async def set(self, key: str, value: Any) -> None:
            folder = key.rpartition("/")[0]
            names = [name async for name in self.list_dir(folder)]
            # In this order: files of a claim made in between are not foreign.
            if any(map(_is_foreign, names)) and not await self.exists(key):
                raise InvalidInput("store", location, "a new folder, or an atlas")
            await self.set_if_not_exists(key, value)

    return FirstWins(store)


def _is_foreign(name: str) -> bool:
    """True for any file but what a killed writer leaves behind."""
    return not name.endswith(".partial")


def _complete(store: AtlasStore) -> None:
    """Write what all designs share, the gaps, and the seal last, as far as they lack or err.

    Raises:
        StoreFailed: This machine draws other activations than the one that began the store.
    """
    *plans, seal = store.plans
    with store.watch.noting():  # what is damaged counts as missing
        for plan in plans:
            if not _is_stored(store, plan):
                _create_array(store, plan)
        _write_gaps(store)
        if SEAL not in store.group:
            _create_array(store, seal)


def _is_stored(store: AtlasStore, plan: Plan) -> bool:
    """True if an array is there, with the values that all designs share."""
    if plan.name not in store.group:
        return False
    if plan.name == CUBE:
        return digest(np.asarray(store.array(CUBE)[...])) == store.cube_digest
    return plan.data is None or bool(np.array_equal(store.array(plan.name)[...], plan.data))


def _create_array(store: AtlasStore, plan: Plan) -> None:
    from zarr.errors import ContainsArrayError

    data = _drawn(store) if plan.name == CUBE else plan.data
    try:
        array = _described(store.group, plan)
    except ContainsArrayError:  # begun by another task, or by a run that was killed
        array = store.array(plan.name)
    if data is not None:
        array[...] = data


def _described(group: zarr.Group, plan: Plan) -> Any:
    """A new array without values."""
    return group.create_array(
        plan.name,
        shape=plan.shape,
        dtype=plan.dtype,
        chunks=plan.chunks,
        fill_value=plan.fill,
        compressors=plan.compressors(),
        dimension_names=plan.dims,
        attributes=plan.attrs,
        config={"write_empty_chunks": True},
    )


def _drawn(store: AtlasStore) -> Array:
    cube = drawn_cube(store.command)
    if digest(cube) != store.cube_digest:
        raise StoreFailed(
            f"{store.location}: this machine draws other activations than the one that began it"
        )
    return cube


def _write_gaps(store: AtlasStore) -> None:
    """Write which designs cannot exist, and why."""
    gaps = store.command.space.gaps
    status = store.status() if gaps else np.empty(0)
    for index, reason in gaps.items():
        if status[index] != GAP or store.message(index) != reason:
            store.write_status(index, reason, GAP)
