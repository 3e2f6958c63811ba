"""Interrupted or refused, failed or retried, an atlas ends with the same numbers."""

from __future__ import annotations

import signal

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import DesignSpace, StoreFailed, atlas_status, build_atlas
from softreach.atlas.intermediates import Intermediates
from softreach.atlas.store import AtlasStore
from softreach.rod import TipMap
from softreach.support.errors import InvalidInput, SoftreachWarning
from softreach.support.interruption import INTERRUPTED
from tests.atlas.families import SMALL, assert_same, command, small_space
from tests.atlas.scripts import build16, ended, run_script, stored_files
from tests.laws import of_length


@pytest.mark.parametrize("kills", [2, pytest.param(30, marks=pytest.mark.large)])
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
    build16(tmp_path / "whole.zarr")
    store, drawn = tmp_path / "killed.zarr", np.random.default_rng(kills)
    for operation in drawn.integers(1, 7 if kills > 2 else 45, kills):
        process = run_script(tmp_path, body, str(store), str(operation))
        ended(process)
        assert process.returncode == -signal.SIGKILL
    assert_same(build16(store).load(), whole)
    found, right = (stored_files(tmp_path / f"{name}.zarr") for name in ("killed", "whole"))
    assert found == right


def test_ctrl_c_ends_a_process_with_a_line_and_the_same_call_continues(whole, tmp_path):
    body = """
        from softreach.support.interruption import run_stoppable
        run_stoppable(
            lambda: build(sys.argv[1], progress=lambda _: os.kill(os.getpid(), signal.SIGINT))
        )
    """
    process = run_script(tmp_path, body, str(tmp_path / "a.zarr"))
    said = ended(process)[1]
    assert (process.returncode, said) == (130, f"{INTERRUPTED}\n")
    assert 0 < atlas_status(tmp_path / "a.zarr").done < 16
    assert_same(build16(tmp_path / "a.zarr").load(), whole)


def test_a_second_call_computes_nothing(tmp_path, monkeypatch):
    first = build_atlas(small_space(), tmp_path / "a.zarr", **SMALL).load()
    monkeypatch.setattr(TipMap, "tips_and_status", lambda *_: 1 / 0)
    assert build_atlas(small_space(), tmp_path / "a.zarr", **SMALL).identical(first)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n": 3_000}, "n: 2000 there, 3000 here"),
        ({"seed": 1}, "seed: 0 there, 1 here"),
        ({"alpha_over_length": 0.4}, "alpha_over_length: 0.5 there, 0.4 here"),
        ({"keep_clouds": False}, "keep_clouds: True there, False here"),
        ({"metrics": ("extent",)}, "metrics: convex_volume, volume, .* there and not here"),
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
            DesignSpace.grid(of_length(base, 1.5), revolution=[0.5, 1.5]),
            "length_m = 1.0 there, length_m = 1.5 here",
        ),
    ]:
        with pytest.raises(InvalidInput, match=message):
            build_atlas(space, tmp_path / "a.zarr", **SMALL)


def test_gaps_are_told_before_anything_runs_and_stay_gaps(tmp_path):
    base = sr.designs.minimal_trunk()
    space = DesignSpace.grid(base, taper=np.radians([2.0, 4.0]), outer_radius=[1 / 16, 0.1])
    assert list(space.gaps) == [2]
    with pytest.warns(
        SoftreachWarning, match="1 of 4 designs cannot exist and stays a gap, .*leaves no tip"
    ):
        atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    assert np.isfinite(atlas.volume.values).tolist() == [[True, True], [False, True]]
    status = atlas_status(tmp_path / "a.zarr")
    assert (status.done, status.gaps) == (3, 1)
    assert "leaves no tip" in status.messages[2]


def test_a_space_of_gaps_alone_is_refused(tmp_path):
    space = DesignSpace.grid(sr.designs.minimal_trunk(), taper=[0.1, 0.2])
    with pytest.raises(InvalidInput, match=r"valid for at least one design; .*leaves no tip"):
        build_atlas(space, tmp_path / "a.zarr", **SMALL)


def test_a_failing_design_is_recorded_and_tried_again_later(tmp_path, monkeypatch):
    store = tmp_path / "a.zarr"

    def fails_for_taper(arm, *rest):
        if arm.profile.taper > 0 and abs(sr.describe(arm).revolutions[0]) > 1:
            raise RuntimeError("no hull today")
        return Intermediates(arm, *rest)

    with monkeypatch.context() as patch:
        patch.setattr("softreach.atlas.design_task.Intermediates", fails_for_taper)
        with pytest.warns(SoftreachWarning, match="1 design failed, .*no hull today"):
            atlas = build_atlas(small_space(), store, **SMALL)
    assert np.isfinite(atlas.volume.values).tolist() == [[True, True], [True, False]]
    assert atlas_status(store).messages == {3: "RuntimeError: no hull today"}
    assert np.isfinite(build_atlas(small_space(), store, **SMALL).volume).all()
    assert atlas_status(store).messages == {}


@pytest.mark.large
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
        from softreach.support.errors import SoftreachError
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
