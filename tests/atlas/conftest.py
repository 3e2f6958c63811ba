"""Atlases that several tests ask."""

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest
import xarray as xr

from tests.atlas.scripts import build16


@pytest.fixture(scope="session")
def paper(tmp_path_factory) -> xr.Dataset:
    store = tmp_path_factory.mktemp("atlas") / "paper.zarr"
    return build16(store, n=20_000, alpha_over_length=0.1, accuracy=0.02).load()


@pytest.fixture(scope="session")
def whole(tmp_path_factory) -> xr.Dataset:
    """The atlas of the subprocesses, without interruption."""
    return build16(tmp_path_factory.mktemp("atlas") / "whole.zarr").load()


@pytest.fixture(scope="module")
def process() -> Iterator[ProcessPoolExecutor]:
    """A worker process that has imported nothing of this one."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        yield pool
