"""Laws of pictures: what a color says, and that data lie where the axes say."""

import numpy as np
import pytest

import softreach as sr
from softreach import plot
from softreach.arm import designs
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.redundancy import activation_distance
from softreach.plot.atlas import evenly
from softreach.plot.coloring import BundleKey, ScalarKey, color_samples
from softreach.support.errors import InvalidInput
from softreach.support.palette import activation_colors, bundle_color
from tests.test_redundancy import made_up

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def cloud(trunk):
    return sr.compute_cloud(trunk, n=2000, seed=1)


@pytest.fixture(scope="module")
def four():
    return sr.compute_cloud(sr.designs.redundant_trunk(), n=500)


@pytest.fixture(scope="module")
def bent(trunk):
    return sr.configuration(trunk, [-1.2, -0.3, -0.8], stations=31)


@pytest.mark.parametrize(
    ("size", "places"),
    [(16, [0, 3, 6, 9, 12, 15]), (7, range(7)), (14, [0, 2, 4, 6, 9, 11, 13]), (1, [0])],
)
def test_a_sheet_of_seven_shows_the_ends_and_takes_equal_steps_where_it_can(size, places):
    assert evenly(size, 7).tolist() == [*places]


class TestColors:
    def test_color_is_relative_magnitude(self, rng):
        gamma = rng.uniform(-1.5, 1, (50, 3))
        expected = 255 * np.abs(gamma) / np.abs(gamma).max()
        np.testing.assert_allclose(activation_colors(gamma), expected, atol=0.501)

    @pytest.mark.parametrize("bundles", [1, 2, 4, 8, 12])
    def test_any_number_of_bundles_stays_in_range_and_rest_is_black(self, bundles):
        gamma = np.concatenate([-np.ones((1, bundles)), np.zeros((1, bundles))])
        full, rest = activation_colors(gamma).astype(int)
        assert full.max() == 255
        assert not rest.any()

    def test_a_bundle_goes_by_name_or_index_from_zero_up(self, cloud):
        by_name, by_index = color_samples(cloud, "longitudinal"), color_samples(cloud, 2)
        np.testing.assert_array_equal(by_name.rgb, by_index.rgb)
        largest = np.abs(cloud.activation.values[:, 2]).max()
        assert by_name.key == ScalarKey("|γ| longitudinal", 0.0, largest)

    def test_rgb_explains_its_bundles(self, cloud):
        key = color_samples(cloud).key
        assert isinstance(key, BundleKey)
        assert key.names == ("left", "right", "longitudinal")
        np.testing.assert_array_equal(key.colors, 255 * np.eye(3))

    def test_a_cloud_names_the_symbols_of_actuators_that_units_do_not_tell(self, trunk):
        first, *others = trunk.actuators
        own = type("Heated", (type(first),), {"symbol": "ΔT", "default_name": "heated"})
        arm = trunk.replace(actuators=(own(**vars(first)), *others))
        cloud = sr.compute_cloud(arm, n=10)
        assert color_samples(cloud, "rgb").key.labels[0] == "|ΔT| left"
        assert "symbol" not in sr.compute_cloud(trunk, n=10).coords

    def test_the_strongest_bundle_gives_its_color_in_pictures_of_the_arm(self, four):
        coloring, magnitude = color_samples(four, "strongest"), np.abs(four.activation.values)
        paints = np.array([bundle_color(k) for k in range(4)])
        expected = paints[magnitude.argmax(axis=1)]
        np.testing.assert_allclose(coloring.rgb / 255, expected, atol=0.002)
        assert isinstance(coloring.key, BundleKey)
        assert coloring.key.labels == tuple(four.bundle.values)

    def test_more_than_three_bundles_are_colored_by_the_strongest_unless_asked(self, cloud, four):
        for data, color in ((cloud, "rgb"), (four, "strongest")):
            np.testing.assert_array_equal(color_samples(data).rgb, color_samples(data, color).rgb)
        assert (color_samples(four, "rgb").rgb != color_samples(four).rgb).any()

    def test_effort_is_the_mean_share_of_the_largest_magnitudes(self, four):
        magnitude = np.abs(four.activation.values)
        share = (magnitude / magnitude.max(axis=0)).mean(axis=1)
        coloring = color_samples(four, "effort")
        np.testing.assert_array_equal(coloring.rgb[share.argmax()], [253, 231, 36])
        assert isinstance(coloring.key, ScalarKey)
        assert coloring.key.high == pytest.approx(share.max())
        assert coloring.key.low == 0.0

    def test_a_bundle_of_that_name_is_meant_before_a_word(self, cloud):
        named = cloud.assign_coords(bundle=["effort", "strongest", "b"])
        by_name, by_index = color_samples(named, "effort"), color_samples(cloud, 0)
        np.testing.assert_array_equal(by_name.rgb, by_index.rgb)

    def test_missing_values_are_gray_and_the_rest_spans_the_scale(self, cloud):
        values = np.linspace(3, 7, 2000)
        values[5] = np.nan
        coloring = color_samples(cloud, values)
        assert coloring.rgb[5].tolist() == [204, 204, 204]
        assert coloring.key == ScalarKey("", 3.0, 7.0)

    def test_an_array_that_says_what_it_is_names_the_key(self, cloud):
        height = cloud.tip.sel(axis="z").assign_attrs(long_name="height", units="m")
        ends = height.values.min(), height.values.max()
        assert color_samples(cloud, height).key == ScalarKey("height [m]", *ends)

    def test_unknown_bundles_and_lengths_are_refused(self, cloud):
        wrong = ("middle", "left, right, longitudinal"), (3, "index"), (np.zeros(7), "2000")
        for color, said in wrong:
            with pytest.raises(InvalidInput, match=said):
                color_samples(cloud, color)


class TestFigures:
    @pytest.mark.parametrize("view", ["front", "back", "side", "left", "top"])
    def test_the_image_lies_under_its_coordinates(self, view, cloud):
        """One far sample is found again where the axes say it is."""
        one = cloud.isel(sample=[int(cloud.tip.values[:, 0].argmax())])
        box = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
        ax = plot.plot_cloud(one, view=view, box=box, size=1.0)
        drawn = ax.images[0]
        rows, columns, _ = drawn.get_array().shape
        (row,), (column,) = np.nonzero(drawn.get_array()[..., 3])
        left, right, bottom, top = drawn.get_extent()
        found = left + (column + 0.5) * (right - left) / columns, top - (row + 0.5) * 2 / rows
        assert bottom == -1
        x, y, z = one.tip.values[0]
        there = {"front": (x, z), "back": (x, z), "side": (y, z), "left": (y, z), "top": (x, y)}
        np.testing.assert_allclose(found, there[view], atol=1.1 / rows)
        assert (ax.xaxis_inverted(), left > right) == ((view in ("back", "left"),) * 2)

    def test_views_of_a_thin_arm_fit_a_page(self, trunk):
        thin = trunk.with_bounds([(0, 0)] * 3)
        width, height = plot.plot_views(sr.compute_cloud(thin, 10), thin).get_size_inches()
        assert height < 1.5 * width

    def test_orthogonal_views_share_one_scale(self, trunk, cloud, bent):
        front, side, top, _ = plot.plot_views(cloud, trunk, bent).axes
        scales = []
        for ax in (front, side, top):
            inches = ax.get_position().size * ax.figure.get_size_inches()
            scales += list(inches / [np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
        np.testing.assert_allclose(scales, scales[0], rtol=1e-9)
        np.testing.assert_allclose(front.get_ylim(), side.get_ylim())
        np.testing.assert_allclose(front.get_xlim(), top.get_xlim())

    def test_axes_of_the_caller_are_used_and_grow(self, trunk, cloud, bent):
        _, mine = plt.subplots()
        assert plot.plot_arm(trunk, ax=mine) is mine
        narrow = mine.get_xlim()
        assert plot.plot_cloud(cloud, ax=mine) is mine
        wide = mine.get_xlim()
        plot.plot_arm(trunk, bent, ax=mine)
        assert np.ptp(wide) > np.ptp(narrow)
        assert mine.get_xlim() == wide

    def test_an_arm_shows_its_fibers_and_body(self, trunk):
        drawn = plot.plot_arm(trunk, view="back").images[0].get_array()
        solid = drawn[drawn[..., 3] == 255][:, :3].astype(int)
        assert (solid[:, 0] > 1.5 * solid[:, 1:].max(axis=1)).any()  # red on the back
        assert (solid[:, 1] > 1.5 * solid[:, [0, 2]].max(axis=1)).any()  # green
        assert not (solid[:, 2] > 1.5 * solid[:, :2].max(axis=1)).any()  # blue is in front

    def test_several_configurations_are_drawn_together(self, trunk):
        several = sr.configuration(trunk, [[-1.2, 0, 0], [0, -1.2, 0]], stations=21)
        ax = plot.plot_arm(trunk, several, rest=False)
        low, high = ax.get_xlim()
        assert low == pytest.approx(-high, rel=0.02)  # mirror images

    @pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
    def test_figures_are_saved_small_and_whole(self, suffix, trunk, cloud, bent, tmp_path):
        figure = plot.plot_views(cloud, trunk, bent, color=2)
        plot.save_figure(figure, tmp_path / f"views.{suffix}")
        assert [p.name for p in tmp_path.iterdir()] == [f"views.{suffix}"]
        assert 10_000 < (tmp_path / f"views.{suffix}").stat().st_size < 2_000_000

    def test_text_stays_text_over_a_raster_image(self, cloud, tmp_path):
        plot.save_figure(plot.plot_cloud(cloud).figure, tmp_path / "cloud.svg")
        drawing = (tmp_path / "cloud.svg").read_text()
        assert "x / L</text>" in drawing
        assert drawing.count("<image") == 1


LONG = "outer oblique left, after the second calibration"


@pytest.mark.parametrize(
    "draw",
    [
        lambda arm, _: plot.plot_arm(arm, view="oblique", unit="mm"),
        lambda arm, _: plot.plot_arm(arm, view="front", unit="mm"),
        lambda arm, _: plot.plot_designs([plot.DesignPanel(LONG, arm)] * 2),
        lambda arm, _: plot.plot_designs([plot.DesignPanel("one", arm, "oblique")]),
        lambda arm, cloud: plot.plot_views(cloud, arm, unit="mm"),
        lambda _, cloud: plot.plot_opposite_sides({n: cloud for n in (LONG, "b", "c")}, unit="mm"),
    ],
    ids=["oblique", "front", "names", "panel", "views", "sides"],
)
def test_no_label_is_cut_of_slim_arms_many_bundles_and_long_names(draw):
    from matplotlib.text import Text

    arm = designs.elephant_trunk()
    figure = draw(arm, compute_cloud(arm, n=100)).get_figure(root=True)
    figure.canvas.draw()
    axes = [axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]
    ticks = {id(label) for axis in axes for label in axis.get_ticklabels()}
    for text in figure.findobj(Text):
        if text.get_text() and id(text) not in ticks:
            low, high = text.get_window_extent().get_points()
            assert (low >= -1).all(), text
            assert (high <= figure.bbox.max + 1).all(), text


# Laws of the pictures of designs: sectors where the bundles are, one scale, curves in L


def sectors(ax):
    wedges = [patch for patch in ax.patches if type(patch).__name__ == "Wedge"]
    return [wedge for wedge in wedges if not wedge.get_hatch()]  # not what sectors share


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_sectors_stand_where_the_bundles_are_at_that_station(share):
    arm = designs.redundant_trunk(length=2.0)
    ax = plot.plot_cross_section(arm, share * arm.length)
    angles = np.degrees(arm.outline(share * arm.length).center[0])
    assert len(sectors(ax)) == arm.bundles
    for k, wedge in enumerate(sectors(ax)):
        assert (wedge.theta1 + wedge.theta2) / 2 == pytest.approx(angles[k])
        assert wedge.theta2 - wedge.theta1 == pytest.approx(48)
        assert wedge.r == pytest.approx(float(arm.profile.radius(share * arm.length)) / arm.length)
        assert wedge.width == pytest.approx(0.25 * wedge.r)
        assert wedge.get_facecolor()[:3] == bundle_color(k)


def test_a_plane_through_the_origin_is_at_zero_without_a_sign(trunk):
    grid = sr.reachable_set(trunk, accuracy=0.1).grid
    assert plot.plot_slice(grid, at=-1e-12).get_title() == "y = 0 L"


def test_a_notebook_keeps_no_figure_that_its_cell_shows(trunk, cloud, monkeypatch):
    plt.close("all")
    monkeypatch.setattr(plt, "get_backend", lambda: "module://matplotlib_inline.backend_inline")
    plot.plot_views(cloud, trunk)
    assert plt.get_fignums() == []
    plot.plot_slab(cloud)  # its axes show nothing by themselves
    assert len(plt.get_fignums()) == 1


def test_designs_and_their_sections_share_one_scale():
    arms = {"minimal": designs.minimal_trunk(), "redundant": designs.redundant_trunk()}
    panels = [plot.DesignPanel(name, arm) for name, arm in arms.items()]
    figure = plot.plot_designs(panels, stations_over_length=(0.0, 0.5))
    arms, base, middle = np.array(figure.axes).reshape(3, 2)
    assert [ax.get_title() for ax in arms] == ["minimal", "redundant"]
    assert len({(*ax.get_xlim(), *ax.get_ylim()) for ax in arms}) == 1
    assert len({(*ax.get_xlim(), *ax.get_ylim()) for ax in (*base, *middle)}) == 1
    assert [len(sectors(ax)) for ax in base] == [3, 4]


# Pictures of redundancy: what they show, what they say of it, what they refuse


@pytest.fixture(scope="module")
def drawn():
    cloud = compute_cloud(designs.redundant_trunk(), n=3000)
    return cloud, activation_distance(cloud, 1 / 60)


def image_colors(ax) -> set[tuple[int, ...]]:
    rgba = np.asarray(ax.images[0].get_array())
    return {tuple(rgb) for rgb in rgba[rgba[..., 3] == 255][:, :3].tolist()}


def test_a_slice_shows_the_slab_and_states_it(drawn):
    ax = plot.plot_slab(drawn[0], view="side", thickness=0.1, color=3)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("y / L", "z / L")
    assert "|x| ≤ 0.05 L" in [text.get_text() for text in ax.texts]
    options = {"view": "side", "size": 1.0, "key": False}
    slabs = (plot.plot_slab(drawn[0], thickness=thickness, **options) for thickness in (0.01, 10.0))
    thin, whole = (np.count_nonzero(ax.images[0].get_array()[..., 3]) for ax in slabs)
    assert 0 < thin < 0.2 * whole


def test_isolated_points_are_gray_and_never_hide_others(drawn):
    cloud, distance = drawn
    colors = image_colors(plot.plot_distance(cloud, distance, key=False))
    assert (190, 190, 190) in colors
    # one known point behind an isolated one
    pair = made_up([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.5, 0.0, 0.5]])
    values = distance[:3].copy(data=[1.0, np.nan, 1.0]).assign_coords(sample=[0, 1, 2])
    assert (190, 190, 190) not in image_colors(plot.plot_distance(pair, values, key=False))


def test_all_designs_stand_in_one_figure_at_one_scale(drawn):
    cloud, distance = drawn
    small = cloud.assign(tip=cloud.tip.copy(data=0.5 * cloud.tip.values))
    figure = plot.plot_redundancy({"a": cloud, "b": small}, {"a": distance, "b": 0.5 * distance})
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


def test_what_cannot_be_drawn_is_refused(drawn, trunk):
    cloud, distance = drawn
    with pytest.raises(InvalidInput, match="finite point"):
        plot.plot_cloud(cloud.isel(sample=slice(0)))
    with pytest.raises(InvalidInput, match=r"z = 1.5: must be within \[0, 1\] m"):
        plot.plot_cross_section(trunk, 1.5)
    with pytest.raises(InvalidInput, match="two dimensions"):
        plot.plot_cloud(cloud, ax=plt.figure().add_subplot(projection="3d"))
    with pytest.raises(InvalidInput, match="view = oblique"):
        plot.plot_slab(cloud, view="oblique")
    with pytest.raises(InvalidInput, match=r"thickness = -1\.0: must be a finite number > 0 m"):
        plot.plot_slab(cloud, thickness=-1.0)
    with pytest.raises(InvalidInput, match=r"distances = \['b'\]: must be of the clouds"):
        plot.plot_redundancy({"a": cloud}, {"b": distance})
