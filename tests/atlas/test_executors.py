"""Whoever computes an atlas, threads, processes or a cluster, the numbers are the same."""

import os
import signal
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

from softreach.atlas import Metric, Need, StoreFailed, atlas_status, build_atlas, open_atlas
from softreach.support.errors import InvalidInput, SoftreachError, SoftreachWarning
from tests.atlas.families import SMALL, assert_same, small_space
from tests.atlas.scripts import build16, ended, run_script


def test_shards_share_a_store_and_together_make_the_whole(whole, tmp_path):
    store = tmp_path / "a.zarr"
    part = build16(store, shard=(0, 2))
    assert int(part.volume.notnull().sum()) == 8
    assert_same(build16(store, shard=(1, 2)).load(), whole)
    with pytest.raises(InvalidInput, match="shard = 2/2"):
        build16(store, shard=(2, 2))


def test_an_executor_of_threads_gives_the_same_numbers(whole, tmp_path):
    with ThreadPoolExecutor(2) as pool:
        assert_same(build16(tmp_path / "a.zarr", executor=pool).load(), whole)


DIED = "SOFTREACH_TEST_DIED"


def deadly_length(arm):
    if arm.profile.taper > 0.01 and not (mark := Path(os.environ[DIED])).exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return arm.length


ABOUT = {"name": "deadly", "unit": "m", "meaning": "length"}
DEADLY_LENGTH = Metric(**ABOUT, needs=(Need.ARM,), compute=deadly_length)


def test_a_pool_that_loses_a_worker_ends_in_one_line_and_another_continues(tmp_path, monkeypatch):
    monkeypatch.setenv(DIED, str(tmp_path / "died"))
    asked = SMALL | {"metrics": ["extent", DEADLY_LENGTH]}
    store = tmp_path / "a.zarr"
    said = r"a worker died and broke its executor; .* continues"
    spawned = ProcessPoolExecutor(1, get_context("spawn"))
    with spawned as pool, pytest.raises(SoftreachError, match=said):
        build_atlas(small_space(), store, executor=pool, **asked)
    assert atlas_status(store).done == 1
    with ThreadPoolExecutor(1) as pool:
        found = build_atlas(small_space(), store, executor=pool, **asked).load()
    assert_same(found, build_atlas(small_space(), tmp_path / "b.zarr", **asked).load())


class KilledWorker(Exception):
    """What Dask raises for a task over which several workers died."""


class KillingPool(ThreadPoolExecutor):
    """Workers that die over design number 3."""

    def submit(self, call, remote, index):
        return super().submit(call, remote, index) if index != 3 else super().submit(self.killed)

    def killed(self):
        raise KilledWorker


def test_a_design_that_kills_its_workers_is_given_up_and_the_rest_goes_on(tmp_path):
    with KillingPool(1) as pool, pytest.warns(SoftreachWarning, match="1 design failed"):
        build_atlas(small_space(), tmp_path / "a.zarr", executor=pool, **SMALL)
    status = atlas_status(tmp_path / "a.zarr")
    assert (status.done, status.messages) == (3, {3: "its worker died repeatedly"})


ON_DASK = """
    right = building.Intermediates

    def deadly(arm, *rest):
        guilty = arm.profile.taper > 0.05 and abs(describe(arm).revolutions[0]) < 1e-9
        mark = Path(sys.argv[0]).with_suffix(".died")
        if guilty and not mark.exists():
            mark.touch()
            die()
        return right(arm, *rest)

    building.Intermediates = deadly

    if __name__ == "__main__":
        from distributed import Client, LocalCluster
        options = {"dashboard_address": ":0", "silence_logs": 50}
        with LocalCluster(2, threads_per_worker=1, **options) as cluster:
            with Client(cluster) as client:
                build(sys.argv[1], executor=client)
"""


@pytest.mark.large
def test_dask_workers_survive_the_death_of_one(whole, tmp_path):
    pytest.importorskip("distributed")
    store = tmp_path / "a.zarr"
    process = run_script(tmp_path, ON_DASK, str(store))
    ended(process)
    assert process.returncode == 0
    assert (tmp_path / "task.died").exists()
    assert_same(open_atlas(store).load(), whole)


def test_memory_of_another_process_and_what_is_no_executor_are_refused(process, tmp_path):
    from zarr.storage import MemoryStore

    with pytest.raises(StoreFailed, match="in the memory of another process"):
        build_atlas(small_space(), MemoryStore(), executor=process, **SMALL)
    with pytest.raises(InvalidInput, match=r"executor = 3: must be a concurrent\.futures executor"):
        build_atlas(small_space(), tmp_path / "a.zarr", executor=3, **SMALL)


def test_progress_counts_every_design_once(tmp_path):
    seen = []
    build_atlas(small_space(), tmp_path / "a.zarr", progress=seen.append, **SMALL)
    assert seen == [1] * 4
