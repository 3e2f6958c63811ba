"""The Zarr v3 store of an atlas: one chunk is one design, and its status is written last.

No two tasks ever write to the same chunk. Zarr's local store writes every chunk beside its place
and renames it, so a killed writer leaves chunks whole or absent; a design whose status is missing
is computed again, whatever else of it exists. Creating a store writes the same bytes whoever does
it and deletes nothing, so the tasks of a job array may all try; the command is written last.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from softreach.atlas.command import Command
from softreach.atlas.layout import Plan, array_plans
from softreach.errors import InvalidInput, SoftreachError
from softreach.sampling import sample_cube

if TYPE_CHECKING:
    import zarr
    from zarr.storage import StoreLike

__all__ = ["DONE", "FAILED", "GAP", "TODO", "AtlasStore", "Result", "StoreFailed"]

TODO, DONE, FAILED, GAP = range(4)


class StoreFailed(SoftreachError):
    """The store cannot be written to, because the disk is full for instance; it can be resumed."""


class Result(NamedTuple):
    """What is stored of one design."""

    metrics: Mapping[str, float]
    """Single numbers by name; absent ones are NaN."""
    quantiles: NDArray[np.float64] | None
    """Quantiles of curvature, shape (quantity, station, quantile)."""
    tips: NDArray[np.float64] | None
    """Tips [m], shape (n, 3); None if clouds are not kept."""


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
        import zarr

        location = absolute(location)
        _refuse_strangers(location)
        with writing(location):
            group = zarr.open_group(location, mode="a", zarr_format=3)
            if "command" not in group.attrs:
                _create(location, group, command)
        store = cls.open(location)
        if differences := command.differences(store.command):
            hint = f"it differs in {'; '.join(differences)}"
            raise InvalidInput("store", location, "new, or begun by the same command", hint)
        return store

    @classmethod
    def open(cls, location: StoreLike) -> Self:
        """Open an atlas.

        Raises:
            InvalidInput: There is none, or of another version.
        """
        import zarr

        location = absolute(location)
        try:
            group = zarr.open_group(location, mode="r+", zarr_format=3)
        except FileNotFoundError:
            raise InvalidInput("store", location, "an atlas written by build_atlas") from None
        text = group.attrs.get("command")
        if not isinstance(text, str):
            raise InvalidInput("store", location, "an atlas written by build_atlas")
        return cls(location, Command.from_json(text), group)

    def status(self) -> NDArray[np.uint8]:
        """TODO, DONE, FAILED or GAP of every design, in C order, shape (designs,)."""
        return np.asarray(self._array("status")[...]).ravel()

    def messages(self) -> dict[int, str]:
        """Why designs failed or cannot exist: number -> message."""
        texts = np.asarray(self._array("message")[...]).ravel()
        told = np.flatnonzero(np.isin(self.status(), (FAILED, GAP))).tolist()
        return {index: str(texts[index]) for index in told}

    @cached_property
    def cube(self) -> NDArray[np.float64]:
        """Unit activations that all designs share, shape (n, bundles).

        Raises:
            StoreFailed: They are not what they were when the store was created.
        """
        cube = np.asarray(self._array("unit_activation")[...])
        if _digest(cube) != self.group.attrs["unit_activation_sha256"]:
            raise StoreFailed(f"{self.location}: the stored activations are damaged; remove it")
        return cube

    def write(self, index: int, result: Result) -> None:
        """Store a design; its status comes last.

        Raises:
            StoreFailed: It cannot be written.
        """
        place = np.unravel_index(index, self.command.space.shape)
        row = [result.metrics.get(name, np.nan) for name in self._metric_names]
        with writing(self.location):
            self._array("metrics")[place] = np.array(row, float)
            if result.quantiles is not None:
                self._array("curvature")[place] = result.quantiles
            if result.tips is not None:
                tip = self._array("tip")
                tip[place] = fixed_point(result.tips, float(str(tip.attrs["scale_factor"])))
            self._array("status")[place] = DONE

    def write_failure(self, index: int, message: str, status: int = FAILED) -> None:
        """Store why a design has no numbers.

        Raises:
            StoreFailed: It cannot be written.
        """
        with writing(self.location):
            _tell(self.group, self.command, index, message, status)

    @cached_property
    def _metric_names(self) -> tuple[str, ...]:
        return tuple(map(str, self._array("metric")[...]))

    def _array(self, name: str) -> Any:
        return self.group[name]


def fixed_point(tips: NDArray[np.float64], scale: float) -> NDArray[np.int32]:
    """Tips as whole multiples of the scale, shape (3, n)."""
    return np.rint(tips.T / scale).astype(np.int32)


def absolute(location: StoreLike) -> StoreLike:
    """The same place for a process elsewhere."""
    if isinstance(location, os.PathLike) or (isinstance(location, str) and "://" not in location):
        return str(Path(location).absolute())
    return location


@contextmanager
def writing(location: StoreLike) -> Iterator[None]:
    """Turn trouble of the disk into one line that says what to do."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise StoreFailed(
            f"{location} cannot be written: {reason}; what is done is safe, and the same command "
            "continues once that is mended"
        ) from error


def _refuse_strangers(location: StoreLike) -> None:
    """A folder with other things in it is nobody's to write to."""
    if not isinstance(location, str) or not Path(location).exists():
        return
    found = Path(location)
    if not found.is_dir() or (any(found.iterdir()) and not (found / "zarr.json").is_file()):
        raise InvalidInput("store", location, "a new folder, or an atlas")


def _create(location: StoreLike, group: zarr.Group, command: Command) -> None:
    """Write everything but the designs, and the command last."""
    if group.attrs:
        raise InvalidInput("store", location, "a new folder, or an atlas; it holds something else")
    cube = sample_cube(command.sampler, command.n, command.space.bundles, command.seed)
    for plan in array_plans(command, cube):
        _create_array(location, group, plan)
    for index, reason in command.space.gaps.items():
        _tell(group, command, index, reason, GAP)
    versions = {name: version(name) for name in ("numpy", "scipy", "zarr", "xarray", "numba")}
    group.attrs.update(
        {
            "title": "reachability cloud atlas",
            "design": command.space.base.to_toml(),
            "length": command.space.base.length,
            "unit_activation_sha256": _digest(cube),
            "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
            "command": command.to_json(),
        }
    )


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


def _tell(group: Any, command: Command, index: int, message: str, status: int) -> None:
    place = np.unravel_index(index, command.space.shape)
    group["message"][place] = np.array(message, dtype=np.dtypes.StringDType())
    group["status"][place] = status


def _digest(cube: NDArray[np.float64]) -> str:
    return hashlib.sha256(np.ascontiguousarray(cube).tobytes()).hexdigest()
