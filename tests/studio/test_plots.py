"""Plots beside the scene and paths of the tip, as values."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from softreach import reachable_set, tip_positions
from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.inverse.path import PathStatus, end_text
from softreach.studio.figures import enclosed_area, section_curves, swept_volumes
from softreach.studio.reach import Quality, stages
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import MOST_POINTS, Slice, StudioState, TipPath
from softreach.support.errors import InvalidInput, SoftreachError

STATE = StudioState(design=designs.minimal_trunk())
QUICK = Quality(coarse_level=10, fine_level=10, coarse_accuracy=0.1, fine_accuracy=0.02, tol=1e-4)


def swept(arm, name):
    parameter = next(each for each in slider_parameters(arm) if each.name == name)
    return dict(swept_volumes(arm, parameter, QUICK))


def test_a_sweep_has_the_volumes_of_the_designs_and_none_where_there_is_no_design():
    volumes = swept(STATE.design, "taper")
    assert next(iter(volumes)) == 2.0  # of the design itself
    for taper, volume in volumes.items():
        if volume is None:
            with pytest.raises(SoftreachError):
                tip_positions(changed(STATE.design, {"taper": np.radians(taper)}), [[0, 0, 0]])
        else:
            made = changed(STATE.design, {"taper": np.radians(taper)})
            exact = reachable_set(made, accuracy=QUICK.coarse_accuracy, tol=QUICK.tol)
            assert volume == exact.volume
    assert None in volumes.values()


def test_a_sweep_of_a_design_on_the_same_curve_computes_its_own_volume_alone(monkeypatch):
    swept(STATE.design, "taper")
    computed = []
    monkeypatch.setattr(
        "softreach.studio.figures.exact_set",
        lambda arm, *_: computed.append(arm) or SimpleNamespace(volume=1.0),
    )
    arm = changed(STATE.design, {"taper": np.radians(0.95)})
    assert swept(arm, "taper")[0.95] == 1.0
    assert computed == [arm]


def test_the_areas_of_sections_sum_up_to_the_volume(trunk):
    *_, reach = stages(trunk, 10, QUICK, lambda: None)
    heights = reach.exact.surface().vertices[:, 2] / trunk.length
    edges = np.linspace(heights.min(), heights.max(), 41)
    middles, width = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    cuts = (Slice(axis="z", center=float(at)) for at in middles)
    areas = [enclosed_area(section_curves(reach, cut), 2) for cut in cuts]
    assert sum(areas) * width == pytest.approx(reach.volume / trunk.length**3, rel=0.02)


# Paths of the tip as values: kept in a state, refused


@pytest.mark.parametrize(
    "points",
    [[[0, 0, 1]], [[0, 0, 1]] * (MOST_POINTS + 1), [[0, 0, 1], [0, 0, np.inf]], [[0, 0], [1, 1]]],
)
def test_a_path_that_cannot_be_followed_is_refused(points):
    with pytest.raises(InvalidInput, match="path"):
        TipPath.through(points)


@pytest.mark.parametrize("end", [status for status in PathStatus if status > 0])
def test_every_end_of_a_path_is_said_in_words(end):
    status = "point", [PathStatus.FOLLOWED, end]
    known = {"status": status, "end_length": 0.2, "end_length_error": 1e-3}
    about = {"end": end.name.lower(), "end_bundle": "left", "end_bound": "lower"}
    text = end_text(xr.Dataset(known, attrs=about), STATE.design.length_unit)
    assert text.endswith(".")
    assert "{" not in text
