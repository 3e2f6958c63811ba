"""The Zarr v3 store of an atlas: one chunk is one design, and its status is written last.

No two tasks ever write to the same chunk. Zarr's local store writes every chunk beside its place
and renames it, so a killed writer leaves chunks whole or absent; a design whose status is missing
is computed again, whatever else of it exists.

A store is created in three steps, so that the tasks of a job array may all do it at once and be
killed anywhere: its root, which holds the command, appears at once and is never written again, so
that everybody knows whose store it is; then come the arrays, whose bytes are the same whoever
writes them, so that a late creator changes nothing; the last of them is the seal, and nobody reads
a store or adds designs without it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.atlas.command import Command
from softreach.atlas.layout import MISSING, SEAL, Plan, array_plans
from softreach.atlas.store_root import (
    StoreFailed,
    absolute,
    claim,
    opened_root,
    storage_errors,
    writing,
)
from softreach.errors import InvalidInput
from softreach.sampling import sample_cube

if TYPE_CHECKING:
    import zarr
    from zarr.storage import StoreLike

__all__ = ["DONE", "FAILED", "GAP", "KNOWN", "TODO", "UNSTABLE", "AtlasStore", "Result"]

TODO, DONE, FAILED, GAP, UNSTABLE = range(5)

KNOWN = (DONE, UNSTABLE)
"""The status of designs of which metrics are stored."""


class Result(NamedTuple):
    """What is stored of one design."""

    metrics: Mapping[str, ArrayLike]
    """Every metric of the command by name."""
    tips: NDArray[np.float64] | None
    """Tips [m], shape (n, 3), NaN without equilibrium; None if clouds are not kept."""


@dataclass(frozen=True, eq=False)
class AtlasStore:
    """An atlas on disk, or behind a URL, that designs are written to."""

    location: StoreLike
    command: Command
    group: zarr.Group = field(repr=False)

    @classmethod
    def begin(cls, location: StoreLike, command: Command) -> Self:
        """Create the store, or open one that the same command began.

        Raises:
            InvalidInput: The place holds something else, or an atlas of another command, and how
                that differs.
            StoreFailed: It cannot be written to.
        """
        location = absolute(location)
        with writing(location):
            if opened_root(location) is None:
                claim(location, _attributes(command))
        begun = cls._begun(location)
        if differences := command.differences(begun.command):
            hint = f"it differs in {'; '.join(differences)}"
            raise InvalidInput("store", location, "new, or begun by the same command", hint)
        store = cls(location, command, begun.group)  # this command has all functions
        if SEAL not in store.group:
            with writing(location):
                store._complete()
        return store

    @classmethod
    def open(cls, location: StoreLike, mode: Literal["r", "r+"] = "r+") -> Self:
        """Open an atlas.

        Args:
            location: Where it is.
            mode: "r" for a place that cannot be written to.

        Raises:
            InvalidInput: There is none, or of another version.
        """
        location = absolute(location)
        group = opened_root(location, mode)
        text = None if group is None or SEAL not in group else group.attrs.get("command")
        if group is None or not isinstance(text, str):
            raise InvalidInput("store", location, "an atlas written by build_atlas")
        return cls(location, Command.from_json(text), group)

    @classmethod
    def _begun(cls, location: StoreLike) -> Self:
        """The store, though its arrays may be missing."""
        group = opened_root(location)
        text = None if group is None else group.attrs.get("command")
        if group is None or not isinstance(text, str):
            allowed = "a new folder, or an atlas; it holds something else"
            raise InvalidInput("store", location, allowed)
        return cls(location, Command.from_json(text), group)

    def _complete(self) -> None:
        """Write everything but the designs, or what is missing of it, and the seal last."""
        cube = _cube(self.command)
        self._check_cube(cube, "this machine draws other activations than the one that began it")
        *plans, seal = array_plans(self.command, cube)
        for plan in plans:
            _create_array(self.location, self.group, plan)
        for index, reason in self.command.space.gaps.items():
            _write_status(self.group, self.command, index, reason, GAP)
        _create_array(self.location, self.group, seal)

    def status(self) -> NDArray[np.uint8]:
        """TODO, DONE, FAILED, GAP or UNSTABLE of every design, in C order, shape (designs,)."""
        return np.asarray(self._array("status")[...]).ravel()

    def messages(self) -> dict[int, str]:
        """Why designs failed, cannot exist or are nowhere stable: number -> message."""
        texts = np.asarray(self._array("message")[...]).ravel()
        told = np.flatnonzero(np.isin(self.status(), (FAILED, GAP, UNSTABLE))).tolist()
        return {index: str(texts[index]) for index in told}

    @cached_property
    def cube(self) -> NDArray[np.float64]:
        """Unit activations that all designs share, shape (n, bundles).

        Raises:
            StoreFailed: They are not what they were when the store was created.
        """
        with storage_errors(f"{self.location} cannot be read"):
            cube = np.asarray(self._array("unit_activation")[...])
        self._check_cube(cube, "the stored activations are damaged; remove it")
        return cube

    def _check_cube(self, cube: NDArray[np.float64], otherwise: str) -> None:
        if _digest(cube) != self.group.attrs["unit_activation_sha256"]:
            raise StoreFailed(f"{self.location}: {otherwise}")

    def write(self, index: int, result: Result, status: int = DONE, message: str = "") -> None:
        """Store a design; its status comes last.

        Raises:
            StoreFailed: It cannot be written.
        """
        place = np.unravel_index(index, self.command.space.shape)
        numbers = [result.metrics[metric.name] for metric in self.command.numbers]
        profiles = [result.metrics[metric.name] for metric in self.command.profiles]
        with writing(self.location):
            self._array("metrics")[place] = np.array(numbers, float)
            if profiles:
                self._array("curvature")[place] = np.array(profiles, float)
            if result.tips is not None:
                tip = self._array("tip")
                tip[place] = fixed_point(result.tips, float(str(tip.attrs["scale_factor"])))
            _write_status(self.group, self.command, index, message, status)

    def write_failure(self, index: int, message: str, status: int = FAILED) -> None:
        """Store why a design has no numbers.

        Raises:
            StoreFailed: It cannot be written.
        """
        with writing(self.location):
            _write_status(self.group, self.command, index, message, status)

    def _array(self, name: str) -> Any:
        return self.group[name]


def fixed_point(tips: NDArray[np.float64], scale: float) -> NDArray[np.int32]:
    """Tips as whole multiples of the scale, shape (3, n); NaN as what fills missing ones."""
    whole = np.rint(tips.T / scale)
    return np.where(np.isnan(whole), MISSING, whole).astype(np.int32)


def _attributes(command: Command) -> dict[str, str]:
    """What the root says about the atlas."""
    versions = {name: version(name) for name in ("numpy", "scipy", "zarr", "xarray", "numba")}
    return {
        "title": "reachability cloud atlas",
        "design": command.space.base.to_toml(),
        "unit_activation_sha256": _digest(_cube(command)),
        "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
        "command": command.to_json(),
    }


def _cube(command: Command) -> NDArray[np.float64]:
    return sample_cube(command.sampler, command.n, command.space.bundles, command.seed)


def _create_array(location: StoreLike, group: zarr.Group, plan: Plan) -> None:
    from zarr.errors import ContainsArrayError

    try:
        array = group.create_array(
            plan.name,
            shape=plan.shape,
            dtype=plan.dtype,
            chunks=plan.chunks,
            fill_value=plan.fill,
            compressors=plan.compressor(),
            dimension_names=plan.dims,
            attributes=plan.attrs,
        )
    except ContainsArrayError:  # begun by another task, or by a run that was killed
        array: Any = group[plan.name]
        if array.shape != plan.shape or array.attrs.asdict() != plan.attrs:
            allowed = "a new folder, or an atlas; it holds one that was never finished: remove it"
            raise InvalidInput("store", location, allowed) from None
    if plan.data is not None:
        array[...] = plan.data


def _write_status(group: Any, command: Command, index: int, message: str, status: int) -> None:
    place = np.unravel_index(index, command.space.shape)
    group["message"][place] = np.array(message, dtype=np.dtypes.StringDType())
    group["status"][place] = status


def _digest(cube: NDArray[np.float64]) -> str:
    return hashlib.sha256(np.ascontiguousarray(cube).tobytes()).hexdigest()
