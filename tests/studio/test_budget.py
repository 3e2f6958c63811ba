"""What a computation of the studio may use, and the figures beside the scene."""

import re
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from softreach import reachable_set, tip_positions
from softreach.arm.parameters import changed
from softreach.geometry.surface import section_area
from softreach.studio import figures
from softreach.studio import reach as reaching
from softreach.studio import work as budget
from softreach.studio.markup import bar
from softreach.studio.reach import Quality, Reach, stages
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import MOST_POINTS, Slice, TipPath
from softreach.studio.work import Budget, Dropped, OverBudget, all_cores
from softreach.support.errors import InvalidInput, SoftreachError

SMALL = Quality(coarse_level=10, fine_level=12, coarse_accuracy=0.1, fine_accuracy=0.05)


def nothing() -> None:
    """Everything is wanted."""


def test_a_computation_ends_when_its_time_is_over_or_memory_runs_out_meanwhile(monkeypatch):
    spent = Budget(nothing, 0.0)
    time.sleep(0.01)
    with pytest.raises(OverBudget, match="more than 0 s"):
        spent()
    monkeypatch.setattr(budget, "free_memory", lambda: 10e9)
    running = Budget(nothing, 60.0)
    assert running.memory < 5e9
    running()
    monkeypatch.setattr(budget, "free_memory", lambda: 1e9)
    time.sleep(0.25)
    with pytest.raises(OverBudget, match="memory"):
        running()


def test_a_set_without_time_keeps_what_was_known_or_says_why_there_is_none(trunk, monkeypatch):
    exact, calls = reaching.reachable_set, []

    def only_once(*given, **options):
        calls.append(options["accuracy"])
        if len(calls) > 1:
            raise OverBudget("more than 30 s")
        return exact(*given, **options)

    monkeypatch.setattr(reaching, "reachable_set", only_once)
    coarse, fine = reaching.stages(trunk, 12, SMALL, nothing)
    assert fine.exact is coarse.exact is not None
    assert fine.notes == ("exact set coarser than asked: to 5 % it needs more than 30 s",)
    *_, none = reaching.stages(trunk, 12, SMALL, nothing)
    assert none.exact is None
    assert none.refusal == "to 10 % it needs more than 30 s"


def test_five_bundles_show_a_cloud_before_their_set_within_their_memory(trunk, monkeypatch):
    exact, given = reaching.reachable_set, []

    def noted(*arguments, **options):
        given.append(options["memory"])
        return exact(*arguments, **options)

    monkeypatch.setattr(reaching, "reachable_set", noted)
    monkeypatch.setattr(budget, "free_memory", lambda: 2e9)
    arm = changed(trunk, {"longitudinal.bundles": 3})
    first, coarse, fine = reaching.stages(arm, 12, SMALL, nothing)
    assert first.exact is None
    assert coarse.volume == pytest.approx(fine.volume, rel=0.1)
    assert set(given) == {0.2 * 2e9}


def test_no_stage_keeps_the_turn_while_its_reach_is_drawn(trunk):
    for arm in (trunk, changed(trunk, {"longitudinal.bundles": 2})):
        for _ in reaching.stages(arm, 10, SMALL, nothing):
            assert not all_cores.is_taken()


# The bars under the sliders: how the volume changes with each, exactly and on one scale

QUALITY = Quality(coarse_level=10, fine_level=10, coarse_accuracy=0.02, fine_accuracy=0.01)


def reach_of(arm) -> Reach:
    return list(stages(arm, 10, QUALITY, nothing))[-1]


def test_one_parameter_that_cannot_be_differentiated_leaves_the_others(trunk, monkeypatch):
    plain = figures.gradient_of

    def without_taper(solid, names, *rest):
        if "taper" in names:
            raise InvalidInput("taper", 0.0, "one that holds no bundle")
        return plain(solid, names, *rest)

    monkeypatch.setattr(figures, "gradient_of", without_taper)
    slopes = figures.volume_slopes(reach_of(trunk), QUALITY, nothing).slopes
    assert "taper" not in slopes
    assert len(slopes) > 5


def test_a_set_that_is_flat_or_torn_has_no_slopes_and_what_takes_too_long_is_left_out(trunk):
    flat = trunk.replace(actuators=trunk.actuators[1:])
    assert figures.volume_slopes(reach_of(flat), QUALITY, nothing).slopes == {}
    reach = reach_of(trunk)
    torn = SimpleNamespace(dimension=3, volume=1.0, lost_share=0.1, is_torn=False)
    assert figures.volume_slopes(replace(reach, exact=torn), QUALITY, nothing).slopes == {}
    assert figures.volume_slopes(reach, replace(QUALITY, most_seconds=0.0), nothing).slopes == {}


def test_work_that_is_no_longer_wanted_ends_before_the_next_parameter_or_stage(trunk):
    reach, calls = reach_of(trunk), []

    def check() -> None:
        calls.append(None)
        if len(calls) >= 5:
            raise Dropped

    with pytest.raises(Dropped):
        figures.volume_slopes(reach, QUALITY, check)
    assert len(calls) == 5
    with pytest.raises(Dropped):
        next(stages(trunk, 11, SMALL, check))


def share_of(html: str) -> float:
    """Signed length of a bar over that of half of its track."""
    side, width = re.search(r"(left|right):50%;width:([\d.]+)%", html).groups()
    return float(width) / 50 * (1 if side == "left" else -1)


def test_bars_are_on_one_scale_and_say_number_unit_and_error(trunk):
    sliders = {each.name: (each, each.high - each.low) for each in slider_parameters(trunk)}
    taper, extent = figures.Slope(-0.1, 0.001), figures.Slope(0.01, 0.0)
    slopes = {"taper": taper, "extent": extent, "upper": figures.Slope(0, 0)}
    found = figures.VolumeSlopes(trunk, 0.7, slopes)
    told = figures.slope_bars(found, sliders)
    bars = {name: each.html(old=False) for name, each in told.items()}
    assert list(bars) == [name for name in sliders if name in found.slopes]
    changes = np.array([found.slopes[name].value * sliders[name][1] for name in bars])
    shares = np.array([share_of(html) for html in bars.values()])
    assert np.abs(shares).max() == 1
    np.testing.assert_allclose(shares, changes / np.abs(changes).max(), atol=1e-3)
    of_taper = "\N{MINUS SIGN}1.00 ± 0.01 %", "∂V/∂(taper) = -0.100 ± 0.001 m³ per deg", "0.07 deg"
    assert all(text in bars["taper"] for text in of_taper)  # of V for 0.07 of its 7 degrees
    assert "+1.686 ± 0.001 %" in bars["extent"]
    old = told["taper"].html(old=True)
    assert "of the design before" in old
    assert "opacity:0.4" in old


def test_a_bar_never_leaves_its_track_and_its_text_is_no_markup():
    html = bar(-3.0, "<b>", '"><b>')
    assert share_of(html) == -1
    assert "<b>" not in html


# Plots beside the scene and paths of the tip, as values

QUICK = Quality(coarse_level=10, fine_level=10, coarse_accuracy=0.1, fine_accuracy=0.02, tol=1e-4)


def test_a_sweep_has_the_volumes_of_the_designs_and_none_where_there_is_no_design(trunk):
    parameter = next(each for each in slider_parameters(trunk) if each.name == "taper")
    volumes = dict(figures.swept_volumes(trunk, parameter, QUICK))
    assert next(iter(volumes)) == 2.0  # of the design itself
    for taper, volume in volumes.items():
        if volume is None:
            with pytest.raises(SoftreachError):
                tip_positions(changed(trunk, {"taper": np.radians(taper)}), [[0, 0, 0]])
        else:
            made = changed(trunk, {"taper": np.radians(taper)})
            exact = reachable_set(made, accuracy=QUICK.coarse_accuracy, tol=QUICK.tol)
            assert volume == (exact.volume, exact.volume_error)
    assert None in volumes.values()


def test_the_areas_of_sections_sum_up_to_the_volume(trunk):
    *_, reach = stages(trunk, 10, QUICK, nothing)
    heights = reach.exact.surface().vertices[:, 2] / trunk.length
    edges = np.linspace(heights.min(), heights.max(), 41)
    middles, width = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    cuts = (Slice(axis="z", center=float(at)) for at in middles)
    areas = [section_area(figures.section_curves(reach, cut), 2) for cut in cuts]
    assert sum(areas) * width == pytest.approx(reach.volume / trunk.length**3, rel=0.02)


# Paths of the tip as values: kept in a state, refused


@pytest.mark.parametrize(
    "points",
    [[[0, 0, 1]], [[0, 0, 1]] * (MOST_POINTS + 1), [[0, 0, 1], [0, 0, np.inf]], [[0, 0], [1, 1]]],
)
def test_a_path_that_cannot_be_followed_is_refused(points):
    with pytest.raises(InvalidInput, match="path"):
        TipPath.through(points)
