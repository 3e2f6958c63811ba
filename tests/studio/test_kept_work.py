"""Work and snapshots come back from their files, and files that are none of ours are refused."""

from __future__ import annotations

import json
import threading
from contextlib import suppress

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.cli.studio import _start, _work
from softreach.studio.files import LARGEST
from softreach.studio.reach import Size
from softreach.studio.snapshots import Numbers, Snapshot, Snapshots
from softreach.studio.start import KeptWork, work_on
from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput

TRUNK = designs.minimal_trunk()
STATE = StudioState(design=TRUNK)


def numbers(volume, unr=0.3):
    return Numbers(Size("volume", volume, 1e-4, 3), unr)


def snapshot(name="first", taken=1.0, **changes):
    return Snapshot(name=name, state=STATE, taken=taken, **changes)


@pytest.mark.parametrize("known", [None, numbers(0.7), numbers(0.7, float("nan"))])
def test_a_snapshot_comes_back_from_its_text(known):
    kept = snapshot(numbers=known)
    back = Snapshot.from_json(kept.to_json())
    assert (back.name, back.state, back.taken) == (kept.name, kept.state, kept.taken)
    np.testing.assert_equal(back.numbers, known)


def broken(**changes):
    return json.dumps(json.loads(snapshot(numbers=numbers(0.7)).to_json()) | changes)


BROKEN = {
    "empty": "",
    "list": "[]",
    "object": "{}",
    "nested": "[" * 100_000,
    "version": broken(softreach_snapshot=2),
    "nameless": broken(name=""),
    "two lines": broken(name="two\nlines"),
    "number": broken(name=7),
    "long": broken(name="x" * 100),
    "soon": broken(taken="soon"),
    "never": broken(taken=float("inf")),
    "size of a number": broken(numbers=3),
    "empty size": broken(numbers={"size": {}}),
    "object as a state": broken(state={}),
    "empty state": broken(state="{}"),
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
def test_what_is_no_snapshot_is_refused_in_one_line(text, tmp_path):
    with pytest.raises(InvalidInput):
        Snapshot.from_json(text)
    (tmp_path / "snapshot-0.json").write_text(text)
    (tmp_path / "latest.json").write_text(text)
    work = KeptWork(tmp_path)
    assert work.latest is None
    assert work.snapshots() == ()
    assert "snapshot-0.json" in work.complaint
    assert len(work.complaint.splitlines()) == 1


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    (tmp_path / "latest.json").write_text(STATE.to_json() + " " * LARGEST)
    assert "at most" in KeptWork(tmp_path).complaint


def test_names_of_snapshots_are_taken_once():
    snapshots = Snapshots()
    snapshots.add(snapshot(snapshots.free_name()))
    with pytest.raises(InvalidInput, match="taken"):
        snapshots.add(snapshot("design 1"))
    assert snapshots.free_name() == "design 2"


def test_tabs_that_take_a_snapshot_of_one_name_at_the_same_time_keep_one():
    class SlowStore:
        """Waits in the midst of writing for whoever else would write."""

        meeting = threading.Barrier(2)

        def snapshots(self):
            return ()

        def put(self, _):
            with suppress(threading.BrokenBarrierError):
                self.meeting.wait(0.3)

        def remove(self, _):
            pass

    snapshots, refused = Snapshots(SlowStore()), []

    def take():
        try:
            snapshots.add(snapshot("same"))
        except InvalidInput as error:
            refused.append(error)

    tabs = [threading.Thread(target=take) for _ in range(2)]
    for tab in tabs:
        tab.start()
    for tab in tabs:
        tab.join()
    assert len(refused) == 1
    assert [one.name for one in snapshots.all] == ["same"]


def test_work_is_found_again(tmp_path):
    work = KeptWork(tmp_path / "new")
    snapshots = Snapshots(work)
    snapshots.add(snapshot("second", taken=2.0))
    snapshots.add(snapshot("first", taken=1.0))
    snapshots.measure("first", numbers(0.7))
    work.keep(STATE.replace(activation=(-0.5, 0.0, 0.0)))
    again = KeptWork(tmp_path / "new")
    assert again.latest == work.latest
    found = Snapshots(again)
    assert [one.name for one in found.all] == ["first", "second"]
    assert found.all[0].numbers == numbers(0.7)
    found.remove("second")
    assert [one.name for one in KeptWork(tmp_path / "new").snapshots()] == ["first"]
    assert KeptWork(tmp_path / "new", goes_on=False).latest is None


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    work = KeptWork(tmp_path / "file" / "below")
    work.keep(STATE)
    assert "below" in work.complaint
    assert work.latest == STATE


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def test_the_command_goes_on_with_the_work_on_its_design_unless_it_is_to_begin_afresh(home):
    bent = STATE.replace(activation=(-0.5, 0.0, 0.0))
    work_on(TRUNK).keep(bent)
    start = _start("minimal_trunk")
    assert _work(start, "minimal_trunk", fresh=False).latest == bent
    assert _work(start, "minimal_trunk", fresh=True).latest is None
    assert home in next(home.rglob("latest.json")).parents


def test_a_state_that_is_opened_by_its_file_is_shown_as_it_is(home, tmp_path):
    work_on(TRUNK).keep(STATE.replace(activation=(-0.5, 0.0, 0.0)))
    file = tmp_path / "state.json"
    file.write_text(STATE.to_json())
    assert _work(_start(str(file)), str(file), fresh=False).latest is None


@pytest.mark.usefixtures("home")
def test_every_design_has_work_of_its_own():
    work_on(TRUNK).keep(STATE)
    assert work_on(changed(TRUNK, {"taper": 0.0})).latest is None
