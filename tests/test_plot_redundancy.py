"""Pictures of redundancy: what they show, what they say of it, what they refuse."""

from __future__ import annotations

import numpy as np
import pytest

from softreach import designs
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.redundancy import activation_distance
from softreach.plot import (
    plot_distance,
    plot_distance_histograms,
    plot_redundancy,
    plot_slab,
)
from softreach.support.errors import InvalidInput
from tests.test_redundancy import made_up

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def drawn():
    cloud = compute_cloud(designs.redundant_trunk(), n=3000)
    return cloud, activation_distance(cloud, 1 / 60)


def image_colors(ax) -> set[tuple[int, ...]]:
    rgba = np.asarray(ax.images[0].get_array())
    return {tuple(int(c) for c in rgb) for rgb in rgba[rgba[..., 3] == 255][:, :3]}


def shown_pixels(ax) -> int:
    return int(np.count_nonzero(np.asarray(ax.images[0].get_array())[..., 3]))


def test_a_slice_shows_the_slab_and_states_it(drawn):
    ax = plot_slab(drawn[0], view="side", thickness=0.1, color=3)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("y / L", "z / L")
    assert "|x| ≤ 0.05 L" in [text.get_text() for text in ax.texts]
    whole = plot_slab(drawn[0], view="side", thickness=10.0, size=1.0, key=False)
    thin = plot_slab(drawn[0], view="side", thickness=0.01, size=1.0, key=False)
    assert 0 < shown_pixels(thin) < 0.2 * shown_pixels(whole)


def test_isolated_points_are_gray_and_never_hide_others(drawn):
    cloud, distance = drawn
    colors = image_colors(plot_distance(cloud, distance, key=False))
    assert (190, 190, 190) in colors
    # one known point behind an isolated one
    pair = made_up([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.5, 0.0, 0.5]])
    values = distance[:3].copy(data=[1.0, np.nan, 1.0]).assign_coords(sample=[0, 1, 2])
    assert (190, 190, 190) not in image_colors(plot_distance(pair, values, key=False))


def test_histograms_share_their_scale_and_count_every_point(drawn):
    _, distance = drawn
    figure = plot_distance_histograms({"some": distance[:500], "all": distance}, bins=20)
    some, every = figure.axes
    assert (some.get_title(), every.get_title()) == ("some", "all")
    assert some.get_xlim() == every.get_xlim()
    drawn_share = sum(bar.get_height() for bar in every.patches)
    assert drawn_share == pytest.approx(100 * float(distance.notnull().mean()))


def test_all_designs_stand_in_one_figure_at_one_scale(drawn):
    cloud, distance = drawn
    small = cloud.assign(tip=cloud.tip.copy(data=0.5 * cloud.tip.values))
    figure = plot_redundancy({"a": cloud, "b": small}, {"a": distance, "b": 0.5 * distance})
    panels = np.reshape([ax for ax in figure.axes if ax.images], (2, 4))
    assert [ax.get_xlabel() for ax in panels[1]] == ["x / L", "x / L", "y / L", "x / L"]
    assert [ax.get_ylabel() for ax in panels[:, 0]] == ["a\nz / L", "b\nz / L"]
    for above, below in panels.T:
        assert above.get_xlim() == below.get_xlim()
        assert above.get_ylim() == below.get_ylim()
    left, right = panels[1, 0].get_xlim()
    assert left < float(cloud.tip[:, 0].min())
    assert right > float(cloud.tip[:, 0].max())
    # The scale of D̄ is shared as well: half of the largest is green, not yellow.
    yellow = [{c for c in image_colors(ax) if c[0] > 150 and c[2] < 100} for ax in panels[:, 3]]
    assert yellow[0]
    assert not yellow[1]


def test_what_cannot_be_drawn_is_refused(drawn):
    cloud, distance = drawn
    with pytest.raises(InvalidInput, match="view = oblique"):
        plot_slab(cloud, view="oblique")
    with pytest.raises(InvalidInput, match=r"thickness = -1\.0: must be a finite number > 0 m"):
        plot_slab(cloud, thickness=-1.0)
    with pytest.raises(InvalidInput, match="distances = none"):
        plot_distance_histograms({})
    with pytest.raises(InvalidInput, match=r"distances = \['b'\]: must be of the clouds"):
        plot_redundancy({"a": cloud}, {"b": distance})
