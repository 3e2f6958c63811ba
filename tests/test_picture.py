"""Laws of the rasterizer: what is nearest shows, where the projection says, whatever the order."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.picture.axes_box import axes_box, seen_from
from softreach.picture.gltf import ColoredSkin, glb
from softreach.picture.projection import VIEWS, is_mirrored, project, sight_axis, view_axes
from softreach.picture.zbuffer import Extent, ZBuffer, shade
from softreach.support.errors import InvalidInput
from softreach.support.palette import bundle_color

UNIT = Extent(0.0, 1.0, 0.0, 1.0)
RED, BLUE = (255, 0, 0), (0, 0, 255)


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
        monkeypatch.setattr("softreach.picture.zbuffer._BLOCK", 7)
        np.testing.assert_array_equal(image(points, colors, 3), whole)

    @pytest.mark.parametrize("view", ["top", "oblique", (0.3, -1.0)])
    def test_points_in_space_are_seen_from_the_view(self, rng, view):
        points, colors = rng.uniform(-0.5, 0.5, (500, 3)), rng.integers(0, 256, (500, 3))
        frame = Extent(-1.0, 1.0, -1.0, 1.0)
        buffer = ZBuffer(frame, 30)
        buffer.draw_points(points, colors, 1.5, view=view)
        seen = image(project(points, view), colors, 1.5, 30, 2, frame)
        np.testing.assert_array_equal(buffer.rgba(), seen)

    @pytest.mark.parametrize("oversample", [1, 2, 3])
    def test_pixels_are_means_of_what_is_drawn_in_them(self, rng, oversample):
        """Also where most of the image is empty."""
        extent = Extent(-1.0, 2.0, -0.5, 3.0)
        points, colors = rng.uniform(0, 1, (300, 3)), rng.integers(0, 256, (300, 3))
        fine = image(points, colors, oversample * 1.0, 12 * oversample, 1, extent)
        blocks = fine.reshape(-1, oversample, 12, oversample, 4).swapaxes(1, 2)
        blocks = blocks.reshape(-1, 12, oversample**2, 4).astype(float)
        full = (blocks[..., 3] > 0).sum(axis=-1)
        expected = np.zeros((*full.shape, 4))
        expected[..., :3] = blocks[..., :3].sum(axis=2) // np.maximum(full, 1)[..., None]
        expected[..., 3] = 255 * full // oversample**2
        got = image(points, colors, 1.0, 12, oversample, extent)
        np.testing.assert_array_equal(got, expected)

    def test_points_outside_or_not_finite_leave_no_trace(self):
        points = [[2, 0.5, 0], [0.5, -1, 0], [np.nan, 0.5, 0], [0.5, 0.5, np.nan], [0.5, np.inf, 0]]
        assert not image(points, RED, size=1).any()


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
        edge_on, point = [[0.1, 0.1, 0], [0.9, 0.9, 0], [0.5, 0.5, 1]], [[0.5, 0.5, 0]] * 3
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

    def test_views_along_an_axis_look_along_what_they_do_not_show(self):
        for name in ("front", "back", "side", "left", "top"):
            axes = np.abs(view_axes(name))
            assert axes[2].tolist() == [float(axis == sight_axis(name)) for axis in "xyz"]
        assert [name for name in VIEWS if is_mirrored(name)] == ["back", "left"]
        for view in ("oblique", "behind", (0.0, 0.0)):
            with pytest.raises(InvalidInput, match="one of front, back, side, left, top"):
                sight_axis(view)

    def test_named_views_show_plain_coordinates(self):
        point = [1.0, 2.0, 3.0]
        assert project(point, "front").tolist() == [1, 3, -2]
        assert project(point, "side").tolist() == [2, 3, 1]
        assert project(point, "top").tolist() == [1, 2, 3]

    @pytest.mark.parametrize("view", ["right", (1.0,), (0.0, np.nan)])
    def test_other_views_are_refused(self, view):
        with pytest.raises(InvalidInput, match="front, side, top, oblique, back, left, or"):
            view_axes(view)


def test_light_falls_alike_on_both_sides(rng):
    normals = rng.normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lit = shade(normals, (0.5, 0.5, 0.5))
    np.testing.assert_allclose(lit, shade(-normals, (0.5, 0.5, 0.5)))
    assert lit.min() > 0
    assert lit.max() <= 255


def test_twelve_bundles_have_colors_that_are_told_apart_and_four_a_lightness_of_their_own():
    """Differences of 2 are just seen side by side (CIEDE2000)."""
    light = sorted(float(np.dot(bundle_color(k), [0.21, 0.72, 0.07])) for k in range(4))
    assert min(np.diff(light)) > 0.02
    color = pytest.importorskip("skimage.color")
    lab = color.rgb2lab(np.array([[bundle_color(k) for k in range(12)]]))[0]
    apart = color.deltaE_ciede2000(lab[:, None], lab[None])
    assert apart[~np.eye(12, dtype=bool)].min() > 18


# A box with numbers around everything


def test_the_box_holds_every_point_and_its_numbers_are_round(rng):
    points = rng.uniform(-0.73, 1.19, (100, 3))
    box = axes_box(points)
    lines = box.lines[:12]
    assert (lines.min(axis=(0, 1)) <= points).all()
    assert (points <= lines.max(axis=(0, 1))).all()
    texts = {text for text, _ in box.labels}
    assert "\N{MINUS SIGN}0" not in texts
    assert {"0", "0.5", "1", "x / L", "y / L", "z / L"} <= texts


EYES = [(2.1, -3.85, 1.45), (-3, 3, 1), (3, 2, -2), (1.5, -5, 0.9)]


@pytest.mark.parametrize("eye", EYES)
def test_numbers_of_an_edge_keep_their_distance_in_a_small_picture(eye):
    low, high = np.full(3, -0.6), np.array([0.6, 0.6, 1.0])
    wide = seen_from(eye, low, high)
    for focal in (300.0, 600.0, 1200.0):
        small = seen_from(eye, low, high, focal)
        assert small.edges == wide.edges
        steps = np.array(small.steps)
        assert (steps >= wide.steps).all()
        digits = steps / 10 ** np.floor(np.log10(steps) + 1e-9)
        assert np.isclose(digits[:, None], (1, 2, 5)).any(axis=1).all()
    far = np.asarray(eye) * 20
    assert min(seen_from(far, low, high, 300.0).steps) > max(wide.steps)


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("focal", [420.0, 600.0, 1200.0])
def test_numbers_stand_outside_and_the_name_of_an_axis_keeps_its_distance_from_them(eye, focal):
    low, high = np.array([-0.6, -0.6, -0.4]), np.array([0.6, 0.6, 1.0])
    box = axes_box(low[None], high[None], camera=eye, focal=focal)
    texts = np.array([at for _, at in box.labels])
    assert ((texts < low) | (texts > high)).any(axis=1).all()
    forward = (low + high) / 2 - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    ways = np.stack([right, np.cross(right, forward)])
    seen = focal * (texts - eye) @ ways.T / ((texts - eye) @ forward)[:, None]
    is_name = np.array([text.endswith("/ L") for text, _ in box.labels])
    for k in np.flatnonzero(is_name):
        axis = "xyz".index(box.labels[k][0][0])
        near = ~is_name & (np.abs(texts - texts[k])[:, axis] < 1e-9)
        assert (np.abs(seen[near] - seen[k]) > (19, 11)).any(axis=1).all()


def test_a_surface_is_read_back_from_its_file():
    import trimesh

    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.5]])
    skin = ColoredSkin(vertices, np.array([[0, 1, 2]]), np.full((3, 3), 255.0))
    data = glb(skin, 0.5, vertices[[[0, 1]]], (0, 0, 0), both_sides=False)
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb")
    surface, lines = scene.geometry.values()
    np.testing.assert_allclose(surface.vertices, vertices)
    color = surface.visual.vertex_attributes["color"][0]
    np.testing.assert_array_equal(color, (255, 255, 255, 128))
    np.testing.assert_allclose(lines.vertices, vertices[:2])
