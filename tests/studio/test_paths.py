"""Paths of the tip as values: kept in a state, refused."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.studio.settings import MOST_POINTS, PlotSettings, TipPath
from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput


def test_a_state_keeps_its_path_and_its_plots():
    path = TipPath.through([[0, 0, 1.0], [0.1, 0, 0.9]], (-0.5, 0.0, 0.0))
    state = StudioState(design=designs.minimal_trunk(), path=path).showing(
        plots=PlotSettings(shown=("section",), parameter="taper")
    )
    assert StudioState.from_json(state.to_json()) == state


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 1]],
        [[0, 0, 1]] * (MOST_POINTS + 1),
        [[0, 0, 1], [0, 0, np.inf]],
        [[0, 0], [1, 1]],
        [["a", 0, 0], [0, 0, 0]],
    ],
)
def test_a_path_that_cannot_be_followed_is_refused(points):
    with pytest.raises(InvalidInput, match="path"):
        TipPath.through(points)


@pytest.mark.parametrize("changes", [{"shown": (1,)}, {"parameter": None}])
def test_plot_settings_of_another_kind_are_refused(changes):
    with pytest.raises(InvalidInput, match="plots"):
        PlotSettings(**changes)
