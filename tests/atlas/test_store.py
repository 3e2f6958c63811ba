"""The store of an atlas: begun by several at once, killed, elsewhere, damaged."""

import asyncio
import re
import shutil
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Barrier
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import DesignSpace, StoreFailed, atlas_cloud, atlas_status, build_atlas
from softreach.atlas.metrics import Intermediates
from softreach.atlas.space import Command
from softreach.atlas.store import AtlasStore
from softreach.rod import TipMap
from softreach.support.errors import InvalidInput, SoftreachError, SoftreachWarning
from tests.atlas.families import SMALL, TINY, assert_same, command, gapped_space, small_space
from tests.atlas.scripts import build16, ended, run_script, stored_files
from tests.laws import of_length


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


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A store as one creator leaves it whom nobody disturbs: its files and how many writes."""
    place = tmp_path_factory.mktemp("begun")
    store = interrupting_store(place, -1, None)
    AtlasStore.begin(store, command(gapped_space(), **TINY))
    return SimpleNamespace(files=stored_files(place), writes=store.count)


def test_a_creator_killed_at_any_write_leaves_a_store_that_another_completes(begun, tmp_path):
    def dies():
        raise Interrupted

    for write in range(0, begun.writes, 5):
        place = tmp_path / f"{write}.zarr"
        store = interrupting_store(place, write, dies)
        with pytest.raises(StoreFailed) as caught:
            AtlasStore.begin(store, command(gapped_space(), **TINY))
        assert isinstance(caught.value.__cause__, Interrupted)
        with suppress(InvalidInput):  # else all arrays are there, and the gap is still to do
            assert not sr.open_atlas(place).status.any()
        (place / "zarr.0123.partial").touch()  # what a write leaves that is killed itself
        AtlasStore.begin(place, command(gapped_space(), **TINY))
        assert stored_files(place) == begun.files


def test_whoever_overtakes_a_creator_between_two_writes_keeps_its_designs(begun, tmp_path):
    asked = command(gapped_space(), **TINY)
    sizes = asked.profile_sizes
    ones = {m.name: np.ones([sizes[dim] for dim in m.over]) for m in asked.metrics}

    def overtakes():
        other = AtlasStore.begin(place, command(gapped_space(), **TINY))
        other.write(1, ones, np.ones((10, 3)))
        other.write_status(3, "no luck")

    for write in range(0, begun.writes, 5):
        place = tmp_path / f"{write}.zarr"
        slow = interrupting_store(place, write, overtakes)
        AtlasStore.begin(slow, command(gapped_space(), **TINY))
        store = AtlasStore.open(place)
        assert store.status().tolist() == [0, 1, 3, 2]
        assert store.message(3) == "no luck"
        assert begun.files.items() <= stored_files(place).items()


def test_of_two_different_commands_at_one_moment_one_is_refused(begun, tmp_path):
    def begin(store, n):
        try:
            AtlasStore.begin(store, command(gapped_space(), **TINY | {"n": n}))
        except InvalidInput as error:
            return str(error)
        accepted.append(n)
        return ""

    for write in range(0, begun.writes, 5):
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

    for turn in range(2):
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(begin, [tmp_path / f"{turn}.zarr"] * 8))
        assert stored_files(tmp_path / f"{turn}.zarr") == begun.files


@pytest.fixture(params=["a URL", "a URL of a file", "a Zarr store", "a place in a Zarr store"])
def elsewhere(request, tmp_path) -> Any:
    if request.param == "a URL of a file":
        return f"file://{tmp_path}/a.zarr"
    if "Zarr" in request.param:
        from zarr.storage import MemoryStore, StorePath

        store = MemoryStore()
        return store if request.param == "a Zarr store" else StorePath(store, "folder/a")
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
    assert_same(atlas_cloud(sr.open_atlas(elsewhere), **at), atlas_cloud(here, **at))
    with pytest.raises(InvalidInput, match="n: 2000 there, 3000 here"):
        build_atlas(small_space(), elsewhere, **SMALL | {"n": 3_000})


def test_what_cannot_be_reached_is_said_in_one_line(tmp_path):
    pytest.importorskip("fsspec")
    (tmp_path / "file").touch()
    for place in ("nothing://a.zarr", str(tmp_path / "file")):
        for ask in (sr.open_atlas, lambda at: build_atlas(small_space(), at, **SMALL)):
            with pytest.raises(SoftreachError, match="an atlas") as caught:
                ask(place)
            assert "\n" not in str(caught.value)


def test_a_folder_with_other_things_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InvalidInput, match="a new folder, or an atlas"):
        build_atlas(small_space(), tmp_path, **SMALL)
    cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=100)
    sr.save_cloud(cloud, tmp_path / "cloud.zarr")
    with pytest.raises(InvalidInput, match="holds other files"):
        build_atlas(small_space(), tmp_path / "cloud.zarr", **SMALL)


def test_a_machine_that_draws_other_activations_does_not_mend_them(tmp_path, monkeypatch):
    asked = command(small_space(), **SMALL)
    AtlasStore.begin(tmp_path / "a.zarr", asked)
    (tmp_path / "a.zarr/unit_activation/c/0/0").unlink()
    monkeypatch.setattr("softreach.atlas.store.sample_cube", lambda *_: np.zeros((2_000, 3)))
    with pytest.raises(StoreFailed, match="this machine draws other activations"):
        AtlasStore.begin(tmp_path / "a.zarr", asked)


def test_designs_of_the_same_atlas_built_in_two_folders_may_be_copied_together(folder):
    for name, shard in {"a": (0, 2), "b": (1, 2), "whole": (0, 1)}.items():
        build_atlas(small_space(), name, shard=shard, **SMALL)
    shutil.copytree("b", "a", dirs_exist_ok=True)
    assert stored_files(folder / "a") == stored_files(folder / "whole")


def test_only_public_names_of_zarr_are_used():
    """Private ones would tie softreach to one release of Zarr."""
    private = re.compile(r"(?m)^ *(from|import) zarr([\w.]*\._|\.core|[\w.]* import \(?\s*_)")
    files = Path(sr.__file__).parent.rglob("*.py")
    assert [file.name for file in files if private.search(file.read_text())] == []


def test_a_store_of_another_version_is_refused():
    text = command(small_space(), **SMALL).to_json()
    with pytest.raises(InvalidInput, match="version of the atlas = 1: must be 5; build"):
        Command.from_json(text.replace('"atlas_version": 5', '"atlas_version": 1'))


def test_a_store_says_how_long_each_design_is_and_steps_by_the_shortest(tmp_path):
    space = DesignSpace.grid(sr.designs.minimal_trunk(), length=[0.0, 0.8, 1.5])
    with pytest.warns(SoftreachWarning, match="1 of 3 designs"):
        atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    assert atlas.length.values.tolist() == [0.0, 0.8, 1.5]
    for length in (0.8, 1.5):
        alone = sr.compute_cloud(of_length(space.base, length), n=2_000)
        off = np.abs(atlas_cloud(atlas, length=length).tip.values - alone.tip.values).max()
        assert 0 < off <= 0.5e-5 * 0.8 * (1 + 1e-9)


# Interrupted or refused, failed or retried, an atlas ends with the same numbers


@pytest.mark.parametrize("kills", [1, pytest.param(30, marks=pytest.mark.large)])
def test_kills_leave_the_same_bits_as_no_kill(kills, whole, tmp_path):
    """Before a file is opened to be written, or is renamed; a build has about 100 such moments."""
    body = """
        left = int(sys.argv[2])

        def count_down(event, given):
            global left
            if event in ("os.rename", "os.link") or (event == "open" and given[1] == "wb"):
                left -= STORE in str(given)
                if not left:
                    die()

        STORE = sys.argv[1]
        sys.addaudithook(count_down)
        build(STORE)
    """
    store, drawn = tmp_path / "killed.zarr", np.random.default_rng(kills)
    for operation in drawn.integers(1, 7 if kills > 2 else 45, kills):
        process = run_script(tmp_path, body, str(store), str(operation))
        ended(process)
        assert process.returncode == -signal.SIGKILL
    assert_same(build16(store).load(), whole)
    assert stored_files(store) == stored_files(Path(whole.encoding["source"]))


def test_an_interrupted_build_is_continued_by_the_same_call(whole, tmp_path):
    """In Python, where Ctrl-C raises; `tests/abuse/test_interruption.py` has it of commands."""

    def interrupts(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build16(tmp_path / "a.zarr", progress=interrupts)
    assert 0 < atlas_status(tmp_path / "a.zarr").done < 16
    assert_same(build16(tmp_path / "a.zarr").load(), whole)


def test_a_second_call_computes_nothing(tmp_path, monkeypatch):
    first = build_atlas(small_space(), tmp_path / "a.zarr", **SMALL).load()
    monkeypatch.setattr(TipMap, "tips_and_status", lambda *_: 1 / 0)
    assert build_atlas(small_space(), tmp_path / "a.zarr", **SMALL).identical(first)


BASE = sr.designs.minimal_trunk()
NEW = {
    "n: 2000 there, 3000 here": {"n": 3_000},
    "seed: 0 there, 1 here": {"seed": 1},
    "alpha_over_length: 0.5 there, 0.4 here": {"alpha_over_length": 0.4},
    "keep_clouds: True there, False here": {"keep_clouds": False},
    "metrics: convex_volume, volume, .* there and not here": {"metrics": ("extent",)},
    "revolution: ": {"space": DesignSpace.grid(BASE, revolution=[0.5, 1.0], taper=[0.0, 0.03])},
    "taper: .* there, none here": {"space": DesignSpace.grid(BASE, revolution=[0.5, 1.5])},
    "length_m = 1.0 there, length_m = 1.5 here": {
        "space": DesignSpace.grid(of_length(BASE, 1.5), revolution=[0.5, 1.5])
    },
}


@pytest.mark.parametrize("message", NEW)
def test_another_command_or_space_is_refused_with_what_differs(tmp_path, message):
    store = tmp_path / "a.zarr"
    AtlasStore.begin(store, command(small_space(), **SMALL))
    with pytest.raises(InvalidInput, match=message) as caught:
        build_atlas(**{"space": small_space(), "store": store} | SMALL | NEW[message])
    assert "\n" not in str(caught.value)


def test_gaps_are_told_before_anything_runs_and_stay_gaps(tmp_path):
    assert list(gapped_space().gaps) == [2]
    said = "1 of 4 designs cannot exist and stays a gap, .*leaves no tip"
    with pytest.warns(SoftreachWarning, match=said):
        atlas = build_atlas(gapped_space(), tmp_path / "a.zarr", **SMALL)
    assert np.isfinite(atlas.volume.values).tolist() == [[True, True], [False, True]]
    status = atlas_status(tmp_path / "a.zarr")
    assert (status.done, status.gaps) == (3, 1)
    assert "leaves no tip" in status.messages[2]


def test_a_space_of_gaps_alone_and_lengths_that_cannot_share_a_step_are_refused(tmp_path):
    space = DesignSpace.grid(sr.designs.minimal_trunk(), taper=[0.1, 0.2])
    with pytest.raises(InvalidInput, match=r"valid for at least one design; .*leaves no tip"):
        build_atlas(space, tmp_path / "a.zarr", **SMALL)
    space = DesignSpace.grid(sr.designs.minimal_trunk(taper=0.0), length=[0.01, 1000.0])
    with pytest.raises(InvalidInput, match=r"length = 0\.01 to 1000 m: .*pass keep_clouds=False"):
        build_atlas(space, tmp_path / "a.zarr", **SMALL)


def test_a_failing_design_is_recorded_and_tried_again_later(tmp_path, monkeypatch):
    store = tmp_path / "a.zarr"

    def fails_for_taper(arm, *rest):
        if arm.profile.taper > 0 and abs(sr.describe(arm).revolutions[0]) > 1:
            raise RuntimeError("no hull today")
        return Intermediates(arm, *rest)

    with monkeypatch.context() as patch:
        patch.setattr("softreach.atlas.build.Intermediates", fails_for_taper)
        with pytest.warns(SoftreachWarning, match="1 design failed, .*no hull today"):
            atlas = build_atlas(small_space(), store, **SMALL)
    assert np.isfinite(atlas.volume.values).tolist() == [[True, True], [True, False]]
    assert atlas_status(store).messages == {3: "RuntimeError: no hull today"}
    assert np.isfinite(build_atlas(small_space(), store, **SMALL).volume).all()
    assert atlas_status(store).messages == {}


def test_trouble_of_the_disk_is_not_blamed_on_the_design(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("softreach.atlas.store.fixed_point", full)
    with pytest.raises(StoreFailed, match=r"No space left on device; .* same command continues"):
        build_atlas(small_space(), tmp_path / "a.zarr", **SMALL)
    assert atlas_status(tmp_path / "a.zarr").failed == 0
