"""Snapshots are taken in the page, compared in a table, restored and deleted."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.studio.captions import size_text

images = pytest.importorskip("PIL.Image")

TRUNK = designs.minimal_trunk()


def cells(tab):
    """Texts of the table, row by row."""
    text = "tables => tables.flatMap(t => [...t.rows].map(r => [...r.cells].map(c => c.innerText)))"
    return tab.page.locator("table").evaluate_all(text)


def shown(size, arm) -> str:
    """The number of a size, to the first digit of its error."""
    return size_text(size, arm).split()[1]


def take(tab) -> str:
    known = tab.session.snapshots.free_name()
    tab.press("Take snapshot")
    tab.wait(lambda: tab.session.snapshots.named(known), "the snapshot is taken")
    return known


def become(tab, **values):
    tab.session.update(lambda s: s.replace(design=changed(TRUNK, values)))
    tab.settle()


@pytest.mark.large
def test_snapshots_are_taken_compared_restored_and_deleted(tab):
    tab.open("Compare")
    first, wide = tab.session.reach.size, take(tab)
    become(tab, taper=0.01, revolution=1.0)
    second, narrow = tab.session.reach.size, take(tab)
    tab.wait(lambda: len(cells(tab)) == 4, "two snapshots and the design have rows")
    head, one, other, now = cells(tab)
    assert head[:3] == ["design", "volume [m³]", "UNR [%]"]
    assert set(head[3:]) == {"revolution Ω [deg]", "taper φ [deg]"}
    assert one[:2] == [wide, shown(first, TRUNK)]
    volume, difference = other[1].split("\n")
    assert other[0] == narrow
    assert volume == shown(second, TRUNK)
    assert float(difference.split()[0].replace("\N{MINUS SIGN}", "-")) == pytest.approx(
        second.value - first.value, abs=first.error + second.error
    )
    assert now[0] == "now"

    become(tab, taper=0.02)
    wanted = shown(tab.session.reach.size, TRUNK)
    tab.wait(lambda: cells(tab)[-1][1].startswith(wanted), "the row shows the new volume")

    before = tab.session.state.design
    tab.choose("snapshot", wide)
    tab.press("Restore")
    tab.wait(lambda: tab.session.state.design == TRUNK, "the design is back")
    tab.settle()
    tab.press("Undo")
    tab.wait(lambda: tab.session.state.design == before, "the restoring is undone")
    tab.settle()
    for name in (narrow, wide):
        tab.choose("snapshot", name)
        tab.press("Delete")
        tab.wait(lambda name=name: tab.session.snapshots.named(name) is None, "it is gone")
    tab.wait(lambda: not cells(tab), "the table is gone")


def far(tab, eye) -> bool:
    return np.linalg.norm(np.array(tab.session.camera.actual().position) - eye) > 0.2


def test_a_snapshot_is_drawn_around_the_design_beside_it_or_not_at_all(tab):
    tab.open("Compare")
    become(tab, taper=0.017)
    known = tab.session.reach
    kept = take(tab)
    tab.choose("draw", "in gray around this design")
    tab.wait(lambda: tab.drawn("/reference"), "the snapshot is drawn")
    assert tab.session.reference is known
    become(tab, taper=0.015)
    eye = np.array(tab.session.camera.actual().position)
    tab.choose("draw", "beside this design")
    beside = "/reference/arm", "/reference/name"
    tab.wait(lambda: all(map(tab.drawn, beside)), "it stands beside")
    assert tab.session.reference is known
    assert tab.drawn("/reference/name").text == kept
    tab.wait(lambda: far(tab, eye), "the eye steps back")
    tab.press("Delete")
    tab.wait(lambda: not tab.drawn("/reference"), "what is deleted is not drawn")
    tab.wait(lambda: not far(tab, eye), "the eye is back")
    assert tab.session.state.reference is None
