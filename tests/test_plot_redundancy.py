"""Pictures of redundancy: what they show, what they say of it, what they refuse."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.cloud import compute_cloud
from softreach.errors import InvalidInput
from softreach.plot.redundancy import (
    plot_distance,
    plot_distance_histograms,
    plot_redundancy,
    plot_slab,
)
from softreach.redundancy import activation_distance
from tests.test_redundancy import made_up

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def drawn():
    cloud = compute_cloud(designs.redundant_trunk(), n=3000)
    return cloud, activation_distance(cloud, 1 / 60)


@pytest.fixture(autouse=True)
def few_pixels(monkeypatch):
    """No law here depends on their number."""
    monkeypatch.setattr("softreach.plot.frame.DPI", 60)
    yield
    plt.close("all")


def image_colors(ax) -> set[tuple[int, ...]]:
    rgba = np.asarray(ax.images[0].get_array())
    return {tuple(int(c) for c in rgb) for rgb in rgba[rgba[..., 3] == 255][:, :3]}


def shown_pixels(ax) -> int:
    return int(np.count_nonzero(np.asarray(ax.images[0].get_array())[..., 3]))


def test_a_slice_shows_the_slab_and_states_it(drawn):
    ax = plot_slab(drawn[0], plane="right", thickness=0.1, color=3)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("y / L", "z / L")
    assert "|x| ≤ 0.05 L" in [text.get_text() for text in ax.texts]
    whole = plot_slab(drawn[0], plane="right", thickness=10.0, size=1.0, key=False)
    thin = plot_slab(drawn[0], plane="right", thickness=0.01, size=1.0, key=False)
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
    axes = plot_distance_histograms({"some": distance[:500], "all": distance}, bins=20)
    assert axes["some"].get_xlim() == axes["all"].get_xlim()
    drawn_share = sum(bar.get_height() for bar in axes["all"].patches)
    assert drawn_share == pytest.approx(100 * float(distance.notnull().mean()))


def test_all_designs_stand_in_one_figure_at_one_scale(drawn):
    cloud, distance = drawn
    small = cloud.assign(tip=cloud.tip * 0.5)
    axes = plot_redundancy({"a": cloud, "b": small}, {"a": distance, "b": 0.5 * distance})
    assert list(axes["b"]) == ["cloud", "front", "right", "distance"]
    for name, large in axes["a"].items():
        assert large.get_xlim() == axes["b"][name].get_xlim()
        assert large.get_ylim() == axes["b"][name].get_ylim()
    left, right = axes["b"]["cloud"].get_xlim()
    assert left < float(cloud.tip[:, 0].min())
    assert right > float(cloud.tip[:, 0].max())
    # The scale of D̄ is shared as well: half of the largest is green, not yellow.
    yellow = {
        title: {(r, g, b) for r, g, b in image_colors(row["distance"]) if r > 150 and b < 100}
        for title, row in axes.items()
    }
    assert yellow["a"]
    assert not yellow["b"]


def test_what_cannot_be_drawn_is_refused(drawn):
    cloud, distance = drawn
    with pytest.raises(InvalidInput, match="plane = 'top'"):
        plot_slab(cloud, plane="top")
    with pytest.raises(InvalidInput, match="a tip lies in the slab"):
        plot_slab(cloud, thickness=-1.0)
    with pytest.raises(InvalidInput, match="distances = none"):
        plot_distance_histograms({})
    with pytest.raises(InvalidInput, match=r"distances = \['b'\]: must be of the clouds"):
        plot_redundancy({"a": cloud}, {"b": distance})
