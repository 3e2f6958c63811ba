"""A tab without a browser: what a click hits, and what its panels are told."""

import sys
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.cli.studio import begun
from softreach.rod.rods import as_tip_map
from softreach.studio.fields import Attribute, Fields
from softreach.studio.reach import Quality, Reach, cloud_points, count_activations, stages
from softreach.studio.scene.colors import key_html, sample_colors, sample_values
from softreach.studio.session import Session
from softreach.studio.start import KeptWork, work_on
from softreach.studio.state import StudioState
from softreach.studio.tabs import click
from softreach.studio.work import Dropped
from softreach.support.units import UNITS
from tests.sets import trunk_at
from tests.studio.sockets import page


@pytest.fixture
def session(studio) -> Iterator[Session]:
    with page(studio) as opened:
        yield opened


def test_a_click_for_a_path_hits_no_point_that_is_cut_away(session):
    session.update(lambda state: state.showing(cloud=True, mouse="path"))
    assert session.settle()
    points = cloud_points(session.found.reach, session.state.appearance.level)
    hidden = session.scene.hidden(points)
    eye = np.asarray(session.client.camera.position)
    distance = np.linalg.norm(points - eye, axis=1)
    target = points[np.argmin(np.where(hidden, distance, np.inf))]
    click(session, eye, target - eye)
    assert session.settle()
    path, length = session.state.path, session.state.design.length
    assert path is None or not session.scene.hidden(np.array(path.points[-1:]) / length).any()


def test_a_tab_at_rest_is_told_again_without_looking_up_any_parameter_of_its_design(session):
    calls: list[str] = []

    def watch(frame, event, argument) -> None:
        if event == "call" and "parameter" in frame.f_globals.get("__name__", ""):
            calls.append(frame.f_code.co_qualname)

    sys.setprofile(watch)
    try:
        session.show()
    finally:
        sys.setprofile(None)
    assert len(calls) < 10  # all sliders took a hundred


class Menu(SimpleNamespace):
    """What a binding sees of a menu, and when the page reports a choice."""

    def on_update(self, report):
        self.report = report


def test_a_choice_is_kept_while_a_new_design_loads(session):
    unit = Attribute(lambda s: s.design.length_unit.name, lambda s, name: s.showing(unit=name))
    names = {name: name for name in UNITS}
    panel, menu = Fields(session), Menu(value="m", options=tuple(names))
    panel.bind(menu, unit, lambda _: names)
    session.panels.append(panel.show)
    session.update(lambda state: state.replace(design=designs.lce_arm()))
    assert menu.value == session.state.design.length_unit.name == "mm"
    menu.value = "in"  # by hand, while the next design is made
    session.update(lambda state: state.replace(design=designs.minimal_trunk()))
    menu.report(SimpleNamespace(client_id=0))
    assert menu.value == session.state.design.length_unit.name == "in"


# How many activations reach a shown point: what the inverse finds, and the volume tells

SMALL = Quality(coarse_level=8, fine_level=13, fine_accuracy=0.01)
LEVEL = 13


def fine_reach(revolution: float, taper: float) -> Reach:
    """Of a design whose map folds."""
    return [*stages(trunk_at(revolution, taper), LEVEL, SMALL, lambda: None)][-1]


@pytest.fixture(scope="module")
def folded() -> Reach:
    return fine_reach(36.0, 3.0)


@pytest.mark.parametrize(
    ("revolution", "taper"), [(75.0, 3.0), pytest.param(0.0, 3.0, marks=pytest.mark.large)]
)
def test_places_counted_once_for_every_activation_make_up_the_volume(revolution, taper):
    # V = ∫ |det ∂r/∂γ| / m dγ over the box, if every place counts m activations.
    reach = fine_reach(revolution, taper)
    counts = sample_values(reach, LEVEL, "multiplicity")
    assert counts.min() >= 1
    assert counts.max() >= 2
    _, slopes = as_tip_map(reach.arm).tips_and_slopes(reach.cloud.activation.values)
    stretch = np.abs(np.linalg.det(slopes)) * np.prod(np.ptp(reach.arm.bounds, axis=1))
    volume, error = reach.exact.volume, reach.exact.volume_error
    assert (stretch / counts).mean() == pytest.approx(volume, abs=error + 0.003 * volume)


def test_the_key_has_the_color_and_the_share_of_each_number_of_activations(folded):
    counts = sample_values(folded, LEVEL, "multiplicity").values
    rgb, key = sample_colors(folded, LEVEL, "multiplicity")
    known = np.unique(counts)
    assert 1 < len(known) <= len(key.names)
    for count, name, color in zip(known, key.names, key.colors, strict=True):
        number, share = name.removesuffix(" %").split(": ")
        assert int(number) == count
        assert float(share) == pytest.approx(100 * (counts == count).mean(), rel=0.1)
        assert (rgb[counts == count] == color).all()
    assert "activations" in key_html(key)


def test_coarse_clouds_are_not_counted_and_what_was_before_it_was_stopped_is_kept(folded):
    coarse = next(stages(folded.arm, LEVEL, SMALL, lambda: None))
    assert isinstance(sample_values(coarse, 8, "multiplicity"), str)  # colored by activations
    reach = fine_reach(36.0, 3.0)
    rows = np.arange(1 << LEVEL)

    def stop(doing: str) -> None:
        raise Dropped

    with pytest.raises(Dropped):
        count_activations(reach, rows[:5000], report=stop)
    assert np.isnan(reach.counts[rows]).sum() == len(rows) - 5000


# Work comes back from its file, and files that are none of ours are refused

TRUNK = designs.minimal_trunk()
STATE = StudioState(design=TRUNK)


@pytest.mark.parametrize("text", ["", "[]", "{}", "[" * 100_000])
def test_kept_work_that_is_none_of_ours_is_named_in_one_line(text, tmp_path):
    (tmp_path / "latest.json").write_text(text)
    work = KeptWork(tmp_path)
    assert work.latest is None
    assert "latest.json" in work.complaint
    assert len(work.complaint.splitlines()) == 1


def test_work_is_found_again_and_a_folder_that_cannot_be_written_is_named(tmp_path):
    work = KeptWork(tmp_path / "new")
    work.keep(STATE.replace(activation=(-0.5, 0.0, 0.0)))
    assert KeptWork(tmp_path / "new").latest == work.latest
    assert KeptWork(tmp_path / "new", goes_on=False).latest is None
    (tmp_path / "file").write_text("")
    work = KeptWork(tmp_path / "file" / "below")
    work.keep(STATE)
    assert "below" in work.complaint
    assert work.latest == STATE


def test_the_command_goes_on_with_work_on_its_design_unless_it_begins_afresh(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    bent = STATE.replace(activation=(-0.5, 0.0, 0.0))
    work_on(TRUNK).keep(bent)
    for fresh, latest in ((False, bent), (True, None)):
        assert begun("minimal_trunk", fresh=fresh)[1].latest == latest
    assert tmp_path in next(tmp_path.rglob("latest.json")).parents
    file = tmp_path / "state.json"
    file.write_text(STATE.to_json())  # is shown as it is
    assert begun(str(file), fresh=False)[1].latest is None
    assert work_on(changed(TRUNK, {"taper": 0.0})).latest is None  # each has work of its own
