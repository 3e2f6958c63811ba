"""Laws of the atlas: interrupted, shared or retried, it holds the same numbers."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach.atlas import (
    DesignSpace,
    atlas_cloud,
    atlas_design,
    atlas_status,
    best_designs,
    build_atlas,
    open_atlas,
    parameter_units,
    worker_processes,
)
from softreach.atlas import metrics as atlas_metrics
from softreach.atlas.command import Command
from softreach.atlas.space_file import parse_space
from softreach.atlas.store import AtlasStore, Result, StoreFailed
from softreach.cli import atlas as atlas_command
from softreach.errors import InvalidInput, SoftreachError, SoftreachWarning
from softreach.picture.projection import view_axes
from softreach.plot import box_over_length, plot_metric_map
from softreach.plot.sheet import panel_extent

SMALL = {"n": 2_000, "alpha": 0.5, "metrics": ("extent", "convex", "concave", "curvature")}

# What the subprocesses run; the test that starts them runs it too, as the truth.
SCRIPT = """
    import os
    import signal
    import sys
    from pathlib import Path
    import numpy as np
    from softreach.arm import designs
    from softreach.atlas import DesignSpace, build_atlas, design_task, worker_processes

    def build(store, n=3_000, alpha=0.3, accuracy=0.2, **options):
        turns, tapers = np.radians([0, 36, 72, 108]), np.radians([0, 1, 2, 3])
        space = DesignSpace.grid(designs.minimal_trunk(), revolution=turns, taper=tapers)
        return build_atlas(space, store, n, seed=1, alpha=alpha, accuracy=accuracy, **options)

    def die():
        os.kill(os.getpid(), signal.SIGKILL)
"""
PATIENCE = 300.0  # seconds that a script may take on a loaded machine
scope: dict = {}
exec(textwrap.dedent(SCRIPT), scope)
build16 = scope["build"]


@pytest.fixture(scope="module")
def paper(tmp_path_factory) -> xr.Dataset:
    """A coarse atlas of the paper's designs."""
    store = tmp_path_factory.mktemp("atlas") / "paper.zarr"
    return build16(store, n=20_000, alpha=0.1, accuracy=0.02).load()


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> xr.Dataset:
    """The atlas of the subprocesses, without interruption."""
    return build16(tmp_path_factory.mktemp("atlas") / "whole.zarr").load()


def assert_same(found: xr.Dataset, truth: xr.Dataset) -> None:
    """Value for value, to the last bit."""
    xr.testing.assert_identical(found, truth)


def small_space(**more) -> DesignSpace:
    tapers = np.radians([0.0, 2.0])
    return DesignSpace.grid(sr.designs.minimal_trunk(), revolution=[0.5, 1.5], taper=tapers, **more)


def run_script(folder: Path, body: str, *arguments: str) -> subprocess.Popen:
    script = folder / "task.py"
    script.write_text(textwrap.dedent(SCRIPT) + "\n" + textwrap.dedent(body))
    command = [sys.executable, "-W", "error", str(script), *arguments]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen) -> tuple[None, str]:
    """What a script says until its end, which must come."""
    try:
        return process.communicate(timeout=PATIENCE)
    finally:
        process.kill()


# Designs


def test_a_grid_has_every_combination_in_c_order():
    space = small_space()
    assert (space.dims, space.shape, space.size) == (("revolution", "taper"), (2, 2), 4)
    assert space.values(1) == {"revolution": 0.5, "taper": np.radians(2.0)}
    arm = space.design(1)
    assert arm.taper == np.radians(2.0)
    np.testing.assert_allclose(np.abs(arm.revolutions[:2]), 0.5)


def test_a_list_takes_values_together():
    space = DesignSpace.listed(sr.designs.minimal_trunk(), taper=[0.0, 0.01], offset_left=[1, 2])
    assert (space.dims, space.size) == (("design",), 2)
    assert space.design(1).fibers[0].offset == 2


@pytest.mark.parametrize("method", ["sobol", "latin"])
def test_sampled_designs_fill_each_stratum_once(method):
    arm = sr.designs.minimal_trunk()
    space = DesignSpace.sampled(arm, 16, method=method, taper=(0.0, 0.04), extent=(0.5, 1.0))
    for name, values in space.parameters:
        low, high = {"taper": (0.0, 0.04), "extent": (0.5, 1.0)}[name]
        strata = np.floor((np.array(values) - low) / (high - low) * 16)
        assert sorted(strata) == list(range(16))


@pytest.mark.parametrize("name", list(parameter_units(sr.designs.minimal_trunk())))
def test_every_parameter_changes_the_design_and_its_own_value_changes_nothing(name):
    base = sr.designs.minimal_trunk()
    value = {"bundles": 2, "lower": -1.0, "upper": 0.5, "length": 1.1, "outer_radius": 0.07}
    new = next((v for key, v in value.items() if name.startswith(key)), 0.3)
    new = {"taper": 0.01}.get(name, new)
    changed = DesignSpace.listed(base, **{name: [new]}).design(0)
    assert changed != base
    same = {"taper": base.taper, "poisson_ratio": 0.5, "length": 1.0, "radius_ratio": 0.75}
    if name in same:
        np.testing.assert_allclose(
            sr.tip_positions(
                DesignSpace.listed(base, **{name: [same[name]]}).design(0), [[-1] * 3]
            ),
            sr.tip_positions(base, [[-1] * 3]),
            atol=1e-12,
        )


def test_a_valid_design_behind_an_invalid_one_is_found():
    base = sr.designs.minimal_trunk(taper=np.radians(3))
    space = DesignSpace.listed(base, outer_radius=[0.01], taper=[0.0])
    assert space.design(0).outer_radius == 0.01


def test_bounds_of_one_fiber_follow_its_bundles():
    base = sr.designs.minimal_trunk()
    space = DesignSpace.listed(base, bundles_left=[2], lower_left=[-1.0], upper=[0.1])
    expected = [[-1, 0.1], [-1, 0.1], [-5 / 3, 0.1], [-5 / 3, 0.1]]
    np.testing.assert_allclose(space.design(0).bounds, expected)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "parameters = none"),
        ({"tapper": [0]}, "parameter = tapper: must be one of revolution, taper"),
        ({"taper": []}, "taper = .*: must be one finite value"),
        ({"taper": [np.nan]}, "taper = .*: must be one finite value"),
        ({"taper": [0.01, 0.01]}, "taper = .*: must be values that differ"),
    ],
)
def test_faulty_spaces_are_refused_in_one_line(values, message):
    with pytest.raises(InvalidInput, match=message) as caught:
        DesignSpace.grid(sr.designs.minimal_trunk(), **values)
    assert "\n" not in str(caught.value)


def test_a_space_survives_being_written():
    space = small_space(offset_left=[1.0, 2.0])
    assert DesignSpace.from_dict(space.to_dict()) == space


# What it shows


def test_volume_grows_with_revolution_for_every_taper(paper):
    assert (paper.volume.diff("revolution") > 0).all()
    assert (paper.exact_volume.diff("revolution") > 0).all()


def test_largest_volume_is_at_full_revolution_and_two_degrees(paper):
    for name in ("volume", "exact_volume"):
        best = best_designs(paper, name)
        np.testing.assert_allclose(np.degrees(best.revolution), 108)
        np.testing.assert_allclose(np.degrees(best.taper), 2)


def test_unreachability_falls_with_revolution_and_taper(paper):
    for dim in ("revolution", "taper"):
        assert (paper.exact_unreachability.diff(dim) < 0).all()
        assert (paper.unreachability.diff(dim) < 0.02).all()  # sampled, with a coarse radius
    np.testing.assert_allclose(
        paper.exact_unreachability.isel(revolution=0, taper=0), 0.69, atol=0.01
    )
    np.testing.assert_allclose(
        paper.exact_unreachability.isel(revolution=3, taper=3), 0.29, atol=0.01
    )


def test_metrics_agree_with_those_of_the_cloud_alone(paper):
    at = {"revolution": np.radians(72), "taper": np.radians(1)}
    alone = sr.compute_cloud(atlas_design(paper, **at), n=20_000, seed=1)
    row = paper.sel(**at, method="nearest")
    np.testing.assert_allclose(row.convex_volume, sr.convex_hull(alone.tip).volume, rtol=1e-9)
    np.testing.assert_allclose(row.volume, sr.concave_hull(alone.tip, 0.1).volume, rtol=1e-12)
    np.testing.assert_allclose(row.reach_height, alone.tip[:, 2].max())
    np.testing.assert_allclose(
        row.reach_radius, np.hypot(alone.tip[:, 0], alone.tip[:, 1]).max(), rtol=1e-12
    )


def test_stored_clouds_are_those_of_the_cloud_alone_to_half_a_step(paper):
    at = {"revolution": 0.0, "taper": np.radians(3)}
    stored = atlas_cloud(paper, **at)
    alone = sr.compute_cloud(sr.design_of(stored), n=20_000, seed=1)
    assert stored.activation.equals(alone.activation)
    assert np.abs(stored.tip.values - alone.tip.values).max() <= 0.5e-5 * (1 + 1e-9)
    assert stored.attrs == alone.attrs


def test_clouds_that_were_not_kept_are_computed_again(tmp_path):
    atlas = build_atlas(small_space(), tmp_path / "a.zarr", keep_clouds=False, **SMALL)
    assert "tip" not in atlas
    again = atlas_cloud(atlas, revolution=0.5, taper=0.0)
    alone = sr.compute_cloud(sr.design_of(again), n=2_000)
    assert again.tip.equals(alone.tip)


def test_any_reader_of_zarr_and_cf_understands_the_store(tmp_path):
    build_atlas(small_space(length=[1.0, 1.5]), tmp_path / "a.zarr", **SMALL)
    raw = xr.open_zarr(tmp_path / "a.zarr", consolidated=False, zarr_format=3, chunks=None)
    tips = raw.tip.isel(revolution=1, taper=1, length=1).T.values
    alone = sr.compute_cloud(sr.designs.minimal_trunk(1.5).replace(length=1.5), n=2_000)
    np.testing.assert_allclose(tips, alone.tip, atol=0.6e-5)
    assert raw.taper.attrs["units"] == "rad"
    assert raw.status.attrs["flag_meanings"].split()[1] == "done"


def test_designs_with_more_bundles_share_the_activations_of_the_others(tmp_path):
    space = DesignSpace.listed(sr.designs.minimal_trunk(), bundles_left=[1, 2])
    atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    few, more = atlas_cloud(atlas, design=0), atlas_cloud(atlas, design=1)
    assert (few.sizes["fiber"], more.sizes["fiber"]) == (3, 4)
    np.testing.assert_array_equal(few.activation, more.activation[:, :3])


# Resuming


@pytest.mark.slow
def test_three_kills_leave_the_same_numbers_as_no_kill(whole, tmp_path):
    store = tmp_path / "killed.zarr"
    body = """
        from softreach.atlas import store as stores
        left, place = int(sys.argv[2]), sys.argv[3]

        def count_down(*_):
            global left
            left -= 1
            if not left:
                die()

        if place == "within a write":
            right = stores.fixed_point
            stores.fixed_point = lambda *given: (count_down(), right(*given))[1]
        build(sys.argv[1], report=count_down if place == "after a design" else None)
    """
    done = 0
    for count, place in ((2, "after a design"), (5, "within a write"), (3, "after a design")):
        process = run_script(tmp_path, body, str(store), str(count), place)
        assert ended(process) == (None, "")
        assert process.returncode == -signal.SIGKILL
        assert done < atlas_status(store).done < 16
        done = atlas_status(store).done
    assert_same(build16(store).load(), whole)


class Interrupted(Exception):
    """Stands for the end of a process."""


def interrupting_store(place: Path, write: int, interruption):
    """A store that calls something else before a write, counted from 0."""
    from zarr.storage import LocalStore, WrapperStore

    class Store(WrapperStore):
        count = 0

        async def _pause(self):
            if self.count == write:
                await asyncio.to_thread(interruption)
            self.count += 1

        async def set(self, key, value):
            await self._pause()
            await super().set(key, value)

        async def set_if_not_exists(self, key, value):
            if not self.count:  # Zarr tries to write the root again with each array
                await self._pause()
            await super().set_if_not_exists(key, value)

    return Store(LocalStore(place))


TINY = {"n": 10, "alpha": 0.5, "metrics": ("extent", "curvature")}


def gapped_space() -> DesignSpace:
    taper, radius = np.radians([2.0, 4.0]), [1 / 16, 0.1]
    return DesignSpace.grid(sr.designs.minimal_trunk(), taper=taper, outer_radius=radius)


def stored_files(place: Path) -> dict[str, bytes]:
    files = (file for file in place.rglob("*") if file.is_file() and file.suffix != ".partial")
    return {str(file.relative_to(place)): file.read_bytes() for file in files}


class Begun(NamedTuple):
    """A store that is begun."""

    files: dict[str, bytes]
    writes: int


@pytest.fixture(scope="module")
def begun(tmp_path_factory) -> Begun:
    """As one creator leaves it whom nobody disturbs."""
    place = tmp_path_factory.mktemp("begun")
    store = interrupting_store(place, -1, None)
    AtlasStore.begin(store, command(gapped_space(), **TINY))
    return Begun(stored_files(place), store.count)


def test_a_creator_killed_at_any_write_leaves_a_store_that_another_completes(begun, tmp_path):
    def dies():
        raise Interrupted

    for write in range(begun.writes):
        place = tmp_path / f"{write}.zarr"
        store = interrupting_store(place, write, dies)
        with pytest.raises(StoreFailed) as caught:
            AtlasStore.begin(store, command(gapped_space(), **TINY))
        assert isinstance(caught.value.__cause__, Interrupted)
        with pytest.raises(InvalidInput, match="written by build_atlas"):
            open_atlas(place)
        (place / "zarr.0123.partial").touch()  # what a write leaves that is killed itself
        AtlasStore.begin(place, command(gapped_space(), **TINY))
        assert stored_files(place) == begun.files


def test_whoever_overtakes_a_creator_between_two_writes_keeps_its_designs(begun, tmp_path):
    result = Result({"reach_height": 1.0}, np.ones((3, 6, 7)), np.ones((10, 3)))

    def overtakes():
        other = AtlasStore.begin(place, command(gapped_space(), **TINY))
        other.write(1, result)
        other.write_failure(3, "no luck")

    for write in range(begun.writes):
        place = tmp_path / f"{write}.zarr"
        slow = interrupting_store(place, write, overtakes)
        AtlasStore.begin(slow, command(gapped_space(), **TINY))
        store = AtlasStore.open(place)
        assert store.status().tolist() == [0, 1, 3, 2]
        assert store.messages()[3] == "no luck"
        assert begun.files.items() <= stored_files(place).items()


def test_of_two_different_commands_at_one_moment_one_is_refused(begun, tmp_path):
    def begin(store, n):
        try:
            AtlasStore.begin(store, command(gapped_space(), **TINY | {"n": n}))
        except InvalidInput as error:
            return str(error)
        accepted.append(n)
        return ""

    for write in range(begun.writes):
        accepted, place = [], tmp_path / f"{write}.zarr"
        said = begin(interrupting_store(place, write, lambda at=place: begin(at, 11)), 10)
        assert ("n: 11 there, 10 here" in said) == (write == 0)
        assert accepted == ([11] if write == 0 else [10])
        assert AtlasStore.open(place).command.n == accepted[0]


def test_many_creators_may_start_at_one_moment(begun, tmp_path):
    start = Barrier(8)

    def begin(place: Path) -> None:
        start.wait()
        AtlasStore.begin(place, command(gapped_space(), **TINY))

    for turn in range(5):
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(begin, [tmp_path / f"{turn}.zarr"] * 8))
        assert stored_files(tmp_path / f"{turn}.zarr") == begun.files


# URLs and other stores


@pytest.fixture(params=["a URL", "a URL of a file", "a Zarr store"])
def elsewhere(request, tmp_path) -> Any:
    """Places that are no paths."""
    if request.param == "a URL of a file":
        return f"file://{tmp_path}/a.zarr"
    if request.param == "a Zarr store":
        from zarr.storage import MemoryStore

        return MemoryStore()
    fsspec = pytest.importorskip("fsspec")
    fsspec.filesystem("memory").store.clear()
    return "memory://folder/a.zarr"


def test_an_atlas_elsewhere_is_built_resumed_and_asked_as_one_on_disk(elsewhere, tmp_path):
    here = build_atlas(small_space(), tmp_path / "here.zarr", **SMALL)
    build_atlas(small_space(), elsewhere, shard=(0, 2), **SMALL)
    assert atlas_status(elsewhere).todo == 2
    assert_same(build_atlas(small_space(), elsewhere, **SMALL).load(), here.load())
    assert atlas_status(elsewhere).done == 4
    at = {"revolution": 1.5, "taper": 0.0}
    assert_same(atlas_cloud(open_atlas(elsewhere), **at), atlas_cloud(here, **at))
    with pytest.raises(InvalidInput, match="n: 2000 there, 3000 here"):
        build_atlas(small_space(), elsewhere, **SMALL | {"n": 3_000})


def test_a_url_that_holds_other_things_is_left_alone():
    memory = pytest.importorskip("fsspec").filesystem("memory")
    memory.pipe("/other/thesis.tex", b"precious")
    with pytest.raises(InvalidInput, match="a new folder, or an atlas"):
        build_atlas(small_space(), "memory://other", **SMALL)
    assert memory.find("/other") == ["/other/thesis.tex"]


def test_what_cannot_be_reached_is_said_in_one_line(tmp_path):
    pytest.importorskip("fsspec")
    (tmp_path / "file").touch()
    for place in ("nothing://a.zarr", str(tmp_path / "file")):
        for ask in (open_atlas, lambda at: build_atlas(small_space(), at, **SMALL)):
            with pytest.raises(SoftreachError, match="an atlas") as caught:
                ask(place)
            assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_workers_refuse_a_store_in_the_memory_of_another_process():
    from zarr.storage import MemoryStore

    with pytest.raises(StoreFailed, match="in the memory of another process"):
        build_atlas(small_space(), MemoryStore(), executor=worker_processes(1), **SMALL)


def test_a_second_call_computes_nothing(tmp_path, monkeypatch):
    first = build_atlas(small_space(), tmp_path / "a.zarr", **SMALL).load()
    monkeypatch.setattr("softreach.atlas.design_task.tip_positions", lambda *_: 1 / 0)
    assert build_atlas(small_space(), tmp_path / "a.zarr", **SMALL).identical(first)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n": 3_000}, "n: 2000 there, 3000 here"),
        ({"seed": 1}, "seed: 0 there, 1 here"),
        ({"alpha": 0.4}, "alpha: 0.5 there, 0.4 here"),
        ({"keep_clouds": False}, "keep_clouds: True there, False here"),
        ({"metrics": ("extent",)}, "metrics: .*'concave'.* there, .'extent',. here"),
    ],
)
def test_another_command_is_refused_with_what_differs(tmp_path, change, message):
    store = tmp_path / "a.zarr"
    AtlasStore.begin(store, command(small_space(), **SMALL))
    with pytest.raises(InvalidInput, match=message) as caught:
        build_atlas(small_space(), store, **SMALL | change)
    assert "\n" not in str(caught.value)


def test_another_space_is_refused_with_what_differs(tmp_path):
    AtlasStore.begin(tmp_path / "a.zarr", command(small_space(), **SMALL))
    base = sr.designs.minimal_trunk()
    for space, message in [
        (DesignSpace.grid(base, revolution=[0.5, 1.0], taper=[0.0, np.radians(2)]), "revolution: "),
        (DesignSpace.grid(base, revolution=[0.5, 1.5]), "taper: .* there, none here"),
        (
            DesignSpace.grid(base.replace(length=1.5), revolution=[0.5, 1.5]),
            "length_m = 1.0 there, length_m = 1.5 here",
        ),
    ]:
        with pytest.raises(InvalidInput, match=message):
            build_atlas(space, tmp_path / "a.zarr", **SMALL)


def command(space: DesignSpace, **options) -> Command:
    rest = {"seed": 0, "sampler": "uniform", "tol": 1e-6, "accuracy": 3e-3, "keep_clouds": True}
    return Command(space=space, **rest | options)


def test_a_folder_with_other_things_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InvalidInput, match="a new folder, or an atlas"):
        build_atlas(small_space(), tmp_path, **SMALL)
    cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=100)
    sr.save_cloud(cloud, tmp_path / "cloud.zarr")
    with pytest.raises(InvalidInput, match="holds something else"):
        build_atlas(small_space(), tmp_path / "cloud.zarr", **SMALL)


def test_damaged_activations_are_noticed(tmp_path):
    store = AtlasStore.begin(tmp_path / "a.zarr", command(small_space(), **SMALL))
    store.group["unit_activation"][0, 0] = 0.5
    with pytest.raises(SoftreachError, match="damaged"):
        build_atlas(small_space(), tmp_path / "a.zarr", **SMALL)


# Faults


def test_gaps_are_told_before_anything_runs_and_stay_gaps(tmp_path):
    base = sr.designs.minimal_trunk()
    space = DesignSpace.grid(base, taper=np.radians([2.0, 4.0]), outer_radius=[1 / 16, 0.1])
    assert list(space.gaps) == [2]
    with pytest.warns(SoftreachWarning, match="1 of 4 designs cannot exist .*leaves no tip"):
        atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    assert np.isfinite(atlas.volume.values).tolist() == [[True, True], [False, True]]
    status = atlas_status(tmp_path / "a.zarr")
    assert (status.done, status.gaps) == (3, 1)
    assert "leaves no tip" in status.messages[2]


def test_a_space_of_gaps_alone_is_refused(tmp_path):
    space = DesignSpace.grid(sr.designs.minimal_trunk(), taper=[0.1, 0.2])
    with pytest.raises(InvalidInput, match=r"valid for one at least; .*leaves no tip"):
        build_atlas(space, tmp_path / "a.zarr", **SMALL)


def test_a_failing_design_is_recorded_and_tried_again_later(tmp_path, monkeypatch):
    store, right = tmp_path / "a.zarr", atlas_metrics.hull_metrics

    def fails_for_taper(arm, *rest):
        if arm.taper > 0 and abs(arm.revolutions[0]) > 1:
            raise RuntimeError("no hull today")
        return right(arm, *rest)

    with monkeypatch.context() as patch:
        patch.setattr("softreach.atlas.design_task.hull_metrics", fails_for_taper)
        with pytest.warns(SoftreachWarning, match="1 designs failed, .*no hull today"):
            atlas = build_atlas(small_space(), store, **SMALL)
    assert np.isfinite(atlas.volume.values).tolist() == [[True, True], [True, False]]
    assert atlas_status(store).messages == {3: "RuntimeError: no hull today"}
    assert np.isfinite(build_atlas(small_space(), store, **SMALL).volume).all()
    assert atlas_status(store).messages == {}


@pytest.mark.slow
def test_a_full_disk_costs_one_line_and_the_rest_can_be_resumed(tmp_path):
    store = tmp_path / "a.zarr"
    body = """
        import resource
        store = sys.argv[1]
        if len(sys.argv) > 2:  # tips no longer fit into any file
            from softreach.atlas.store import AtlasStore
            AtlasStore.open(store).cube
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, -1))
        shard = (0, 1) if len(sys.argv) > 2 else (0, 8)
        from softreach.errors import SoftreachError
        try:
            build(store, shard=shard)
        except SoftreachError as error:
            sys.exit(str(error))
    """
    assert ended(run_script(tmp_path, body, str(store))) == (None, "")
    _, said = ended(run_script(tmp_path, body, str(store), "full"))
    assert said.count("\n") == 1
    assert "cannot be written: File too large; what is done is safe" in said
    assert atlas_status(store).done == 2
    assert build16(store).volume.notnull().all()


def test_trouble_of_the_disk_is_not_blamed_on_the_design(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("softreach.atlas.store.fixed_point", full)
    with pytest.raises(StoreFailed, match=r"No space left on device; .* same command continues"):
        build_atlas(small_space(), tmp_path / "a.zarr", **SMALL)
    assert atlas_status(tmp_path / "a.zarr").failed == 0


# Execution


def test_shards_share_a_store_and_together_make_the_whole(whole, tmp_path):
    store = tmp_path / "a.zarr"
    part = build16(store, shard=(0, 2))
    assert int(part.volume.notnull().sum()) == 8
    assert_same(build16(store, shard=(1, 2)).load(), whole)
    with pytest.raises(InvalidInput, match="shard = 2/2"):
        build16(store, shard=(2, 2))


@pytest.mark.slow
def test_shards_may_start_at_the_same_moment(whole, tmp_path):
    store = tmp_path / "a.zarr"
    body = "build(sys.argv[1], shard=(int(sys.argv[2]), 2))"
    tasks = [run_script(tmp_path, body, str(store), str(k)) for k in range(2)]
    assert [ended(task)[1] for task in tasks] == ["", ""]
    assert_same(open_atlas(store).load(), whole)


def test_an_executor_of_threads_gives_the_same_numbers(whole, tmp_path):
    with ThreadPoolExecutor(2) as pool:
        assert_same(build16(tmp_path / "a.zarr", executor=pool).load(), whole)


# Workers import the script too, so this is what they run.
DEADLY = """
    right = design_task.hull_metrics

    def deadly(arm, *rest):
        guilty = arm.taper > 0.05 and abs(arm.revolutions[0]) < 1e-9
        mark = Path(sys.argv[0]).with_suffix(".died")
        if guilty and (ALWAYS or not mark.exists()):
            mark.touch()
            die()
        return right(arm, *rest)

    design_task.hull_metrics = deadly
"""


def deadly(body: str, always: bool = False) -> str:
    """A script in which a worker dies over design number 3, once or always."""
    return f"ALWAYS = {always}\n" + textwrap.dedent(DEADLY) + textwrap.dedent(body)


@pytest.mark.slow
def test_worker_processes_survive_the_death_of_one(whole, tmp_path):
    store = tmp_path / "a.zarr"
    body = """
        if __name__ == "__main__":
            build(sys.argv[1], executor=worker_processes(2))
    """
    assert ended(run_script(tmp_path, deadly(body), str(store))) == (None, "")
    assert (tmp_path / "task.died").exists()
    assert_same(open_atlas(store).load(), whole)


@pytest.mark.slow
def test_a_design_that_kills_its_workers_is_given_up_and_the_rest_goes_on(tmp_path):
    store = tmp_path / "a.zarr"
    body = """
        if __name__ == "__main__":
            import warnings
            warnings.simplefilter("ignore")
            build(sys.argv[1], executor=worker_processes(2), metrics=("extent",))
    """
    assert ended(run_script(tmp_path, deadly(body, True), str(store))) == (None, "")
    status = atlas_status(store)
    assert (status.done, status.messages) == (15, {3: "its worker died, time after time"})


@pytest.mark.slow
def test_dask_workers_survive_the_death_of_one(whole, tmp_path):
    pytest.importorskip("distributed")
    store = tmp_path / "a.zarr"
    body = """
        if __name__ == "__main__":
            from distributed import Client, LocalCluster
            options = {"dashboard_address": None, "silence_logs": 50}
            with LocalCluster(2, threads_per_worker=1, **options) as cluster:
                with Client(cluster) as client:
                    build(sys.argv[1], executor=client)
    """
    process = run_script(tmp_path, deadly(body), str(store))
    ended(process)
    assert process.returncode == 0
    assert (tmp_path / "task.died").exists()
    assert_same(open_atlas(store).load(), whole)


SBATCH = """#!/bin/sh
while [ $# -gt 1 ]; do shift; done
cp "$1" "$0.job"  # as SLURM does: who submits removes the script at once
setsid sh "$0.job" > "$0.log" 2>&1 &
echo $! > "$0.pid"
echo Submitted batch job 1
"""


@pytest.mark.slow
def test_workers_may_come_from_a_job_queue(whole, tmp_path, monkeypatch):
    """A SLURM of this machine stands in for a cluster."""
    pytest.importorskip("dask_jobqueue")
    commands = tmp_path / "bin"
    commands.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", "#!/bin/sh\nexit 0\n")):
        (commands / name).write_text(text)
        (commands / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(commands), prepend=":")
    body = """
        if __name__ == "__main__":
            from dask_jobqueue import SLURMCluster
            from distributed import Client
            options = {"log_directory": sys.argv[2], "local_directory": sys.argv[2]}
            options |= {"scheduler_options": {"dashboard_address": None}, "interface": "lo"}
            queue = SLURMCluster(cores=2, processes=2, memory="4GB", walltime="1:00:00", **options)
            queue.scale(2)
            with queue, Client(queue) as client:
                build(sys.argv[1], executor=client)
    """
    process = run_script(tmp_path, body, str(tmp_path / "a.zarr"), str(tmp_path / "jobs"))
    try:
        said = ended(process)[1]
    finally:
        with contextlib.suppress(OSError):
            os.killpg(int((commands / "sbatch.pid").read_text()), signal.SIGKILL)
    assert process.returncode == 0, said
    assert_same(open_atlas(tmp_path / "a.zarr").load(), whole)


def test_what_is_no_executor_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match=r"executor = 3: must be a concurrent\.futures executor"):
        build_atlas(small_space(), tmp_path / "a.zarr", executor=3, **SMALL)
    assert worker_processes(1)  # makes nothing until it is called


def test_progress_counts_every_design_once(tmp_path):
    seen = []
    build_atlas(small_space(), tmp_path / "a.zarr", report=seen.append, **SMALL)
    assert seen == [1] * 4


# Questions


def test_best_designs_are_the_best_that_meet_the_constraints(paper):
    found = best_designs(paper, "volume", where={"taper": (None, 0.01)}, count=3)
    truth = np.sort(paper.volume.sel(taper=0.0).values)[::-1]
    np.testing.assert_array_equal(found.volume, truth[:3])
    least = best_designs(paper, "unreachability", smallest=True)
    np.testing.assert_allclose(least.unreachability, [paper.unreachability.min()])
    assert best_designs(paper, "volume", where={"volume": (9.0, None)}).sizes["rank"] == 0
    with pytest.raises(InvalidInput, match="metric = volumes: must be one of"):
        best_designs(paper, "volumes")


def test_sparse_clouds_are_warned_of(tmp_path):
    with pytest.warns(SoftreachWarning, match="below three mean spacings of the points of 4"):
        build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"alpha": 0.05})


def test_what_is_not_there_is_not_opened(tmp_path):
    with pytest.raises(InvalidInput, match="an atlas written by build_atlas"):
        open_atlas(tmp_path / "nothing.zarr")
    assert not (tmp_path / "nothing.zarr").exists()


# Files, flags and figures


def test_written_spaces_speak_in_degrees_and_ranges():
    text = """
        design = "minimal_trunk"
        [parameters]
        revolution_deg = "0:108:4"
        taper_deg = [0, 1.5]
        outer_radius_m = 0.0625
    """
    space = parse_space(text, lambda name: getattr(sr.designs, name)())
    assert space.shape == (4, 2, 1)
    np.testing.assert_allclose(np.degrees(space.values(3)["revolution"]), 36)
    np.testing.assert_allclose(np.degrees(space.values(3)["taper"]), 1.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'layout = "circle"\n[parameters]\ntaper_deg = [0]',
            "layout = circle: must be one of grid",
        ),
        (
            "[parameters]\ntaper = [0]",
            "parameter = taper: must be one of revolution_deg, taper_deg",
        ),
        ('[parameters]\ntaper_deg = "0:3"', "taper_deg = 0:3: must be numbers"),
        ('layout = "sobol"\n[parameters]\ntaper_deg = [0]', "taper = .*: must be two ends"),
        ("lay_out = 1", "key = lay_out: must be one of design"),
        ("=", "must be valid TOML"),
    ],
)
def test_faulty_space_files_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        parse_space(text, lambda name: getattr(sr.designs, name)())


def test_sampled_spaces_can_be_written_too():
    text = 'layout = "latin"\ndesigns = 5\n[parameters]\ntaper_deg = [0, 3]'
    space = parse_space(text, lambda name: getattr(sr.designs, name)())
    assert (space.dims, space.shape) == (("design",), (5,))


@pytest.mark.slow
def test_every_figure_is_written_as_png_and_pdf(paper, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    atlas_command.figures(paper.encoding["source"], out=tmp_path, panels=2)
    capsys.readouterr()
    names = {"clouds", "hulls", "corners", "curvature", "map_volume", "map_exact_unreachability"}
    assert names <= {path.stem for path in tmp_path.glob("*.png")}
    assert {p.stem for p in tmp_path.glob("*.png")} == {p.stem for p in tmp_path.glob("*.pdf")}


def test_no_tip_lies_outside_its_panel_of_the_sheet(paper):
    pytest.importorskip("matplotlib")
    extent = panel_extent(box_over_length(paper), "oblique")
    seen = np.moveaxis(paper.tip.values, 2, -1).reshape(-1, 3) @ view_axes("oblique")[:2].T
    assert extent.left < seen[:, 0].min() < seen[:, 0].max() < extent.right
    assert extent.bottom < seen[:, 1].min() < seen[:, 1].max() < extent.top


def test_maps_need_two_parameters(paper):
    pytest.importorskip("matplotlib")
    with pytest.raises(InvalidInput, match="a grid of two parameters"):
        plot_metric_map(paper.isel(taper=0), "volume")
    with pytest.raises(InvalidInput, match="metric = volumes"):
        plot_metric_map(paper, "volumes")
