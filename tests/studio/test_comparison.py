"""Designs side by side, without a server."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.errors import InvalidInput
from softreach.studio.comparison import Candidate, compared, comparison_csv, comparison_html
from softreach.studio.kept_work import KeptWork
from softreach.studio.reach import Size
from softreach.studio.snapshots import Numbers, Snapshot, Snapshots
from softreach.studio.state import StudioState

TRUNK = designs.minimal_trunk()
STATE = StudioState(design=TRUNK)


def numbers(volume, unr=0.3):
    return Numbers(Size("volume", volume, 1e-4, "L³"), unr)


def snapshot(name="first", taken=1.0, **changes):
    return Snapshot(name=name, state=STATE, taken=taken, **changes)


def trio():
    flat = changed(TRUNK, {"taper": 0.0})
    turned = changed(TRUNK, {"revolution": 1.0})
    return compared(
        [
            Candidate("a", TRUNK, numbers(0.7)),
            Candidate("b", flat, numbers(0.5, 0.4)),
            Candidate("c", turned, None),
        ]
    )


def test_only_the_parameters_that_differ_have_columns():
    table = trio()
    assert table.titles == (
        "volume [L³]",
        "UNR [%]",
        "revolution Ω [deg]",
        "taper φ [deg]",
    )
    assert not table.differ_otherwise


def test_differences_are_from_the_first_design():
    table = trio()
    assert table.difference(1, 0) == pytest.approx(-0.2)
    assert table.difference(1, 1) == pytest.approx(10)
    assert table.difference(1, 3) == pytest.approx(-2)
    assert table.difference(2, 0) is None
    assert table.difference(2, 2) == pytest.approx(np.degrees(1.0) - 108)


def test_designs_that_differ_in_more_than_sliders_say_so():
    other = designs.redundant_trunk()
    table = compared([Candidate("a", TRUNK, None), Candidate("b", other, None)])
    assert table.differ_otherwise
    assert "more than these numbers" in comparison_html(table)


def test_the_table_as_text_has_every_number():
    rows = list(csv.DictReader(io.StringIO(comparison_csv(trio()))))
    assert [row["design"] for row in rows] == ["a", "b", "c"]
    assert float(rows[1]["volume [L³]"]) == 0.5
    assert float(rows[1]["volume [L³] error"]) == 1e-4
    assert float(rows[1]["volume [L³] difference"]) == pytest.approx(-0.2)
    assert rows[2]["volume [L³]"] == ""


def test_no_name_is_a_formula_of_a_spreadsheet_or_markup():
    table = compared([Candidate("=1+1", TRUNK, None), Candidate("<b>x", TRUNK, None)])
    assert comparison_csv(table).splitlines()[1].startswith("'=1+1")
    assert "<b>x" not in comparison_html(table)


@pytest.mark.parametrize("known", [None, numbers(0.7), numbers(0.7, float("nan"))])
def test_a_snapshot_comes_back_from_its_text(known):
    kept = snapshot(numbers=known)
    back = Snapshot.from_json(kept.to_json())
    assert (back.name, back.state, back.taken) == (kept.name, kept.state, kept.taken)
    np.testing.assert_equal(back.numbers, known)


def broken(**changes):
    return json.dumps(json.loads(snapshot(numbers=numbers(0.7)).to_json()) | changes)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "[" * 100_000,
        broken(softreach_snapshot=2),
        broken(name=""),
        broken(name="two\nlines"),
        broken(name=7),
        broken(name="x" * 100),
        broken(taken="soon"),
        broken(taken=float("inf")),
        broken(numbers=3),
        broken(numbers={"size": {}}),
        broken(state={}),
        broken(state="{}"),
    ],
    ids=[
        "empty",
        "list",
        "object",
        "nested",
        "version",
        "nameless",
        "two-lines",
        "number",
        "long",
        "soon",
        "never",
        "size-number",
        "size-empty",
        "state-object",
        "state-empty",
    ],
)
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
    (tmp_path / "latest.json").write_text(STATE.to_json() + " " * (1 << 20))
    assert "at most" in KeptWork(tmp_path).complaint


def test_names_of_snapshots_are_taken_once():
    snapshots = Snapshots()
    snapshots.add(snapshot(snapshots.free_name()))
    with pytest.raises(InvalidInput, match="taken"):
        snapshots.add(snapshot("design 1"))
    assert snapshots.free_name() == "design 2"


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
