"""Everything of an atlas but its designs, written where it is missing or damaged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.atlas.layout import CUBE, SEAL, Plan, array_plans
from softreach.atlas.store import GAP, AtlasStore, digest, drawn_cube
from softreach.errors import InvalidInput
from softreach.stores.damage import StoreFailed

__all__ = ["complete"]


def complete(store: AtlasStore) -> None:
    """Write what all designs share, the gaps, and the seal last, as far as they lack or err.

    Raises:
        InvalidInput: Arrays of another command.
        StoreFailed: This machine draws other activations than the one that began the store.
    """
    *plans, seal = array_plans(store.command)
    with store.watch.noting():  # what is damaged counts as missing
        for plan in plans:
            if not _is_stored(store, plan):
                _create_array(store, plan)
        _write_gaps(store)
        if SEAL not in store.group:
            _create_array(store, seal)


def _is_stored(store: AtlasStore, plan: Plan) -> bool:
    """Whether an array is there, with the values that all designs share."""
    if plan.name not in store.group:
        return False
    if plan.name == CUBE:
        return digest(np.asarray(store.array(CUBE)[...])) == store.cube_digest
    return plan.data is None or bool(np.array_equal(store.array(plan.name)[...], plan.data))


def _create_array(store: AtlasStore, plan: Plan) -> None:
    from zarr.errors import ContainsArrayError

    data = _drawn(store) if plan.name == CUBE else plan.data
    try:
        array: Any = store.group.create_array(
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
    except ContainsArrayError:  # begun by another task, or by a run that was killed
        array = store.array(plan.name)
        if array.shape != plan.shape or array.attrs.asdict() != plan.attrs:
            allowed = "a new folder, or an atlas; it holds one that was never finished: remove it"
            raise InvalidInput("store", store.location, allowed) from None
    if data is not None:
        array[...] = data


def _drawn(store: AtlasStore) -> NDArray[np.float64]:
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
