"""Laws of pictures: what is nearest shows, where the projection says, whatever the order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.errors import InvalidInput
from softreach.palette import activation_colors, bundle_color
from softreach.plot import plot_arm, plot_cloud, plot_hull, plot_views, save_figure
from softreach.plot.coloring import BundleKey, ScalarKey, color_samples
from softreach.plot.projection import OBLIQUE, VIEWS, project, view_axes
from softreach.plot.shading import shade
from softreach.plot.zbuffer import Extent, ZBuffer

plt = pytest.importorskip("matplotlib.pyplot")

UNIT = Extent(0.0, 1.0, 0.0, 1.0)
RED, BLUE = (255, 0, 0), (0, 0, 255)


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


@pytest.fixture
def coarse(monkeypatch):
    """Few pixels, for laws that do not depend on their number."""
    monkeypatch.setattr("softreach.plot.frame.DPI", 60)


@pytest.fixture(scope="module")
def cloud(trunk):
    return sr.compute_cloud(trunk, n=2000, seed=1)


@pytest.fixture(scope="module")
def bent(trunk):
    return sr.configuration(trunk, [-1.2, -0.3, -0.8], stations=31)


def image(points, colors, size=1.0, width=8, oversample=1, extent=UNIT):
    buffer = ZBuffer(extent, width, oversample)
    buffer.draw_points(points, colors, size)
    return buffer.rgba()


class TestPoints:
    @pytest.mark.parametrize("depths", [(1.0, 2.0), (-2.0, -1.0), (-1.0, 1e-9), (0.0, 1e-6)])
    def test_the_nearer_point_wins(self, depths):
        points = [[0.5, 0.5, depths[0]], [0.5, 0.5, depths[1]]]
        for order in ([0, 1], [1, 0]):
            drawn = image(np.array(points)[order], np.array([RED, BLUE])[order])
            assert drawn[4, 4, :3].tolist() == list(BLUE)

    @given(seed=st.integers(0, 1000), size=st.sampled_from([1.0, 2.5, 5.0]))
    def test_the_order_of_points_does_not_matter(self, seed, size):
        rng = np.random.default_rng(seed)
        points = rng.integers(0, 4, (300, 3)) / 4  # many in one place, at one depth
        colors = rng.integers(0, 256, (300, 3))
        order = rng.permutation(300)
        np.testing.assert_array_equal(
            image(points, colors, size, oversample=2),
            image(points[order], colors[order], size, oversample=2),
        )

    def test_each_point_lands_in_its_pixel(self, rng):
        extent = Extent(-1.0, 3.0, 2.0, 4.0)
        for x, y in rng.uniform([-1, 2], [3, 4], (50, 2)):
            drawn = image([[x, y, 0.0]], RED, width=40, extent=extent)
            assert drawn.shape == (20, 40, 4)
            (row,), (column,) = np.nonzero(drawn[..., 3])
            assert -1 + column / 10 <= x <= -1 + (column + 1) / 10
            assert 4 - (row + 1) / 10 <= y <= 4 - row / 10

    def test_a_large_point_is_a_disc_of_its_diameter(self):
        drawn = image([[0.5 + 1e-9, 0.5, 0.0]], RED, size=40, width=100)
        rows, columns = np.nonzero(drawn[..., 3])
        assert np.hypot(rows - rows.mean(), columns - columns.mean()).max() <= 20
        assert len(rows) == pytest.approx(np.pi * 20**2, rel=0.03)

    @given(diameter=st.floats(1, 30), place=st.tuples(st.floats(0, 1), st.floats(0, 1)))
    def test_points_grow_into_the_pixels_within_their_radius(self, diameter, place):
        drawn = image([[*place, 0.0]], RED, size=diameter, width=20)
        inside = [min(int(20 * place[0]), 20), min(int(20 * (1 - place[1])), 20)]
        column, row = np.meshgrid(np.arange(20), np.arange(20))
        near = np.hypot(column - inside[0], row - inside[1]) <= diameter / 2
        if max(inside) < 20:  # on the outer edge it is not in the image
            np.testing.assert_array_equal(drawn[..., 3] > 0, near)

    def test_blocks_do_not_show(self, rng, monkeypatch):
        points, colors = rng.uniform(0, 1, (500, 3)), rng.integers(0, 256, (500, 3))
        whole = image(points, colors, 3)
        monkeypatch.setattr("softreach.plot.zbuffer._BLOCK", 7)
        np.testing.assert_array_equal(image(points, colors, 3), whole)

    def test_points_outside_or_not_finite_leave_no_trace(self):
        points = [[2, 0.5, 0], [0.5, -1, 0], [np.nan, 0.5, 0], [0.5, 0.5, np.nan], [0.5, np.inf, 0]]
        assert not image(points, RED, size=1).any()

    def test_smoothing_keeps_the_color_and_spreads_the_opacity(self):
        drawn = image([[0.51, 0.51, 0.0]], RED, size=0.5, oversample=2)
        assert drawn[3, 4].tolist() == [255, 0, 0, 63]


class TestTriangles:
    def draw(self, corners, colors, width=400):
        buffer = ZBuffer(UNIT, width, oversample=1)
        buffer.draw_triangles(corners, colors)
        return buffer.rgba()

    def test_the_area_is_that_of_the_triangle(self, rng):
        for corners in rng.uniform(0.02, 0.98, (20, 3, 3)):
            (ax, ay), (bx, by) = corners[1:, :2] - corners[0, :2]
            covered = np.count_nonzero(self.draw([corners], np.full((1, 3, 3), 255))[..., 3])
            assert covered / 400**2 == pytest.approx(abs(ax * by - ay * bx) / 2, abs=4e-3)

    def test_neighbors_leave_no_gap(self, rng):
        """A fan of triangles about any point covers the whole square."""
        square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
        for center in rng.uniform(0, 1, (10, 3)):
            fan = [[center, square[k - 1], square[k]] for k in range(4)]
            assert self.draw(fan, np.full((4, 3, 3), 255), 64)[..., 3].all()

    def test_colors_blend_linearly(self):
        corners = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
        drawn = self.draw(corners, [[[0, 0, 0], [255, 0, 0], [0, 255, 0]]], 100)
        column, row = np.meshgrid(np.arange(100), np.arange(100))
        inside = drawn[..., 3] > 0
        red, green = 2.55 * (column + 0.5), 2.55 * (99.5 - row)
        np.testing.assert_allclose(drawn[..., 0][inside], red[inside], atol=0.51)
        np.testing.assert_allclose(drawn[..., 1][inside], green[inside], atol=0.51)

    def test_intersecting_triangles_show_the_nearer_part_of_each(self):
        flat = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        tilted = [[0, 0, 1], [1, 0, -1], [0, 1, 1]]  # before the flat one where x < 1/2
        drawn = self.draw([flat, tilted], np.repeat([[RED], [BLUE]], 3, axis=1), 100)
        assert drawn[90, 20, :3].tolist() == list(BLUE)
        assert drawn[90, 80, :3].tolist() == list(RED)

    def test_slivers_and_missing_corners_are_harmless(self):
        edge_on = [[0.1, 0.1, 0], [0.9, 0.9, 0], [0.5, 0.5, 1]]
        point = [[0.5, 0.5, 0]] * 3
        missing = [[0.5, 0.5, np.nan], [1, 0, 0], [0, 1, 0]]
        drawn = self.draw([edge_on, point, missing], np.full((3, 3, 3), 255), 50)
        assert np.count_nonzero(drawn[..., 3]) <= 100

    def test_what_sticks_out_of_the_image_is_cut(self):
        huge = [[[-9, -9, 0], [9, -9, 0], [0, 9, 0]]]
        assert self.draw(huge, np.full((1, 3, 3), 255), 30)[..., 3].all()


class TestProjection:
    @given(st.floats(-7, 7), st.floats(-1.5, 1.5))
    def test_views_are_right_handed_frames(self, azimuth, elevation):
        axes = view_axes((azimuth, elevation))
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)
        assert axes[1, 2] >= 0  # z goes up the paper

    @pytest.mark.parametrize("name", VIEWS)
    def test_named_views_are_their_angles(self, name):
        np.testing.assert_allclose(view_axes(name), view_axes(VIEWS[name]), atol=1e-12)

    def test_named_views_show_plain_coordinates(self):
        point = [1.0, 2.0, 3.0]
        assert project(point, "front").tolist() == [1, 3, -2]
        assert project(point, "right").tolist() == [2, 3, 1]
        assert project(point, "top").tolist() == [1, 2, 3]

    @pytest.mark.parametrize("view", ["side", (1.0,), (0.0, np.nan)])
    def test_other_views_are_refused(self, view):
        with pytest.raises(InvalidInput, match="front, back, right, left, top"):
            view_axes(view)


class TestColors:
    def test_the_corners_of_the_activation_box_are_the_corners_of_rgb(self):
        corners = np.array(list(np.ndindex(2, 2, 2)))
        np.testing.assert_array_equal(activation_colors(-5 / 3 * corners), 255 * corners)

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

    def test_bundles_have_colors_of_different_lightness(self):
        light = sorted(float(np.dot(bundle_color(k), [0.21, 0.72, 0.07])) for k in range(4))
        assert min(np.diff(light)) > 0.02

    def test_a_bundle_goes_by_name_or_index_from_zero_up(self, cloud):
        by_name, by_index = color_samples(cloud, "longitudinal"), color_samples(cloud, 2)
        np.testing.assert_array_equal(by_name.rgb, by_index.rgb)
        largest = np.abs(cloud.activation.values[:, 2]).max()
        assert by_name.key == ScalarKey("|γ| longitudinal", 0.0, largest)

    def test_rgb_explains_its_bundles(self, cloud):
        key = color_samples(cloud).key
        assert isinstance(key, BundleKey)
        assert key.names == ["left", "right", "longitudinal"]
        np.testing.assert_array_equal(key.colors, 255 * np.eye(3))

    def test_missing_values_are_gray_and_the_rest_spans_the_scale(self, cloud):
        values = np.linspace(3, 7, 2000)
        values[5] = np.nan
        coloring = color_samples(cloud, values)
        assert coloring.rgb[5].tolist() == [204, 204, 204]
        assert coloring.key == ScalarKey("", 3.0, 7.0)

    def test_unknown_bundles_and_lengths_are_refused(self, cloud):
        with pytest.raises(InvalidInput, match="left, right, longitudinal"):
            color_samples(cloud, "middle")
        with pytest.raises(InvalidInput, match="index"):
            color_samples(cloud, 3)
        with pytest.raises(InvalidInput, match="2000"):
            color_samples(cloud, np.zeros(7))

    def test_light_falls_alike_on_both_sides(self, rng):
        normals = rng.normal(size=(20, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        lit = shade(normals, (0.5, 0.5, 0.5))
        np.testing.assert_allclose(lit, shade(-normals, (0.5, 0.5, 0.5)))
        assert lit.min() > 0
        assert lit.max() <= 255


class TestFigures:
    @pytest.mark.parametrize("view", [*VIEWS, OBLIQUE])
    @pytest.mark.usefixtures("coarse")
    def test_axes_contain_the_data(self, view, cloud):
        ax = plot_cloud(cloud, view=view)
        seen = project(cloud.tip.values, view)
        sign = -1 if view in ("back", "left") else 1
        assert min(ax.get_xlim()) < (sign * seen[:, 0]).min()
        assert max(ax.get_xlim()) > (sign * seen[:, 0]).max()
        assert ax.get_ylim()[0] < seen[:, 1].min() < seen[:, 1].max() < ax.get_ylim()[1]

    @pytest.mark.parametrize("view", ["front", "back", "right", "left", "top"])
    @pytest.mark.usefixtures("coarse")
    def test_the_image_lies_under_its_coordinates(self, view, cloud):
        """One far sample is found again where the axes say it is."""
        one = cloud.isel(sample=[int(cloud.tip.values[:, 0].argmax())])
        box = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
        ax = plot_cloud(one, view=view, box=box, size=1.0)
        drawn = ax.images[0]
        rows, columns, _ = drawn.get_array().shape
        (row,), (column,) = np.nonzero(drawn.get_array()[..., 3])
        left, right, bottom, top = drawn.get_extent()
        found = left + (column + 0.5) * (right - left) / columns, top - (row + 0.5) * 2 / rows
        assert bottom == -1
        x, y, z = one.tip.values[0]
        there = {"front": (x, z), "back": (x, z), "right": (y, z), "left": (y, z), "top": (x, y)}
        np.testing.assert_allclose(found, there[view], atol=1.1 / rows)
        assert (ax.xaxis_inverted(), left > right) == ((view in ("back", "left"),) * 2)

    @pytest.mark.usefixtures("coarse")
    def test_coordinates_are_counted_in_lengths(self, trunk, cloud):
        small = sr.designs.minimal_trunk(length=0.2)
        scaled = cloud.copy(deep=True)
        scaled["tip"] = cloud.tip * 0.2
        scaled.tip.attrs["length"] = 0.2
        views = plot_views(cloud, trunk), plot_views(scaled, small)
        for name in ("front", "right", "top"):
            limits = [(*v[name].get_xlim(), *v[name].get_ylim()) for v in views]
            np.testing.assert_allclose(*limits)
            assert views[0][name].get_xlabel().endswith("/ L")

    @pytest.mark.usefixtures("coarse")
    def test_orthogonal_views_share_one_scale(self, trunk, cloud, bent):
        axes = plot_views(cloud, trunk, bent)
        scales = []
        for name in ("front", "right", "top"):
            ax = axes[name]
            inches = ax.get_position().size * ax.figure.get_size_inches()
            scales += list(inches / [np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
        np.testing.assert_allclose(scales, scales[0], rtol=1e-9)
        np.testing.assert_allclose(axes["front"].get_ylim(), axes["right"].get_ylim())
        np.testing.assert_allclose(axes["front"].get_xlim(), axes["top"].get_xlim())

    @pytest.mark.usefixtures("coarse")
    def test_axes_of_the_caller_are_used_and_grow(self, trunk, cloud, bent):
        _, mine = plt.subplots()
        assert plot_arm(trunk, ax=mine) is mine
        narrow = mine.get_xlim()
        assert plot_cloud(cloud, ax=mine) is mine
        wide = mine.get_xlim()
        plot_arm(trunk, bent, mine)
        assert np.ptp(wide) > np.ptp(narrow)
        assert mine.get_xlim() == wide

    def test_an_arm_shows_its_fibers_and_body(self, trunk):
        drawn = plot_arm(trunk, view="back").images[0].get_array()
        solid = drawn[drawn[..., 3] == 255][:, :3].astype(int)
        assert (solid[:, 0] > 1.5 * solid[:, 1:].max(axis=1)).any()  # red on the back
        assert (solid[:, 1] > 1.5 * solid[:, [0, 2]].max(axis=1)).any()  # green
        assert not (solid[:, 2] > 1.5 * solid[:, :2].max(axis=1)).any()  # blue is in front

    def test_several_configurations_are_drawn_together(self, trunk):
        several = sr.configuration(trunk, [[-1.2, 0, 0], [0, -1.2, 0]], stations=21)
        ax = plot_arm(trunk, several, rest=False)
        low, high = ax.get_xlim()
        assert low == pytest.approx(-high, rel=0.02)  # mirror images

    def test_a_hull_is_drawn_in_meters_or_lengths(self, cloud):
        hull = sr.convex_hull(cloud.tip.values)
        assert plot_hull(hull).get_xlabel() == "x [m]"
        assert plot_hull(hull, length=1.0).get_xlabel() == "x / L"

    def test_an_inside_out_picture_needs_a_point(self, cloud):
        with pytest.raises(InvalidInput, match="finite point"):
            plot_cloud(cloud.isel(sample=slice(0)))

    @pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
    @pytest.mark.slow
    def test_figures_are_saved_small_and_whole(self, suffix, trunk, cloud, bent, tmp_path):
        figure = plot_views(cloud, trunk, bent, color=2)["front"].figure
        save_figure(figure, tmp_path / f"views.{suffix}")
        assert [p.name for p in tmp_path.iterdir()] == [f"views.{suffix}"]
        assert 10_000 < (tmp_path / f"views.{suffix}").stat().st_size < 2_000_000

    def test_text_stays_text_over_a_raster_image(self, cloud, tmp_path):
        save_figure(plot_cloud(cloud).figure, tmp_path / "cloud.svg")
        drawing = (tmp_path / "cloud.svg").read_text()
        assert "x / L</text>" in drawing
        assert drawing.count("<image") == 1
