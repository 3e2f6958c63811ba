"""Laws of figures that turn in a browser: what the page holds is what was given to it."""

from __future__ import annotations

import base64
import html
import json
import re

import numpy as np
import pytest

import softreach as sr
from softreach.geometry.sphere_maps import icosphere
from softreach.geometry.surface import Surface, enclosed_volume, simplified
from softreach.geometry.tube import grid_faces, ribbon_surface, tube_surface
from softreach.plot import plot_3d, save_figure
from softreach.support.errors import InvalidInput
from softreach.support.palette import bundle_color

pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def cloud(trunk):
    return sr.compute_cloud(trunk, n=2000, seed=1)


def content(figure) -> dict:
    """What the script of a page reads."""
    return json.loads(re.search(r'id="data">(.*?)</script>', figure.html, re.S)[1])


def places(part: dict, box) -> np.ndarray:
    """Positions as the page draws them."""
    steps = np.frombuffer(base64.b64decode(part["xyz"]), "<u2").reshape(-1, 3)
    low, high = np.array(box)
    return low + steps / 65535 * (high - low)


def part_named(page: dict, name: str) -> dict:
    return next(part for part in page["parts"] if part["name"] == name)


@pytest.mark.parametrize(("unit", "size"), [("mm", 1e-3), (None, 1.0)])
def test_points_lie_where_the_tips_are_in_the_unit_that_the_axes_say(cloud, unit, size):
    page = content(plot_3d(cloud, unit=unit))
    drawn = places(part_named(page, "cloud"), page["box"])
    side = np.ptp(page["box"], axis=0).max()
    np.testing.assert_allclose(drawn, cloud.tip.values / size, atol=side / 65535)
    assert page["labels"][0] == ("x [mm]" if unit else "x / L")


def test_a_large_cloud_is_thinned_and_the_page_and_the_figure_say_so(trunk, monkeypatch):
    monkeypatch.setattr("softreach.plot.figure_3d._POINTS", 500)
    figure = plot_3d(sr.compute_cloud(trunk, n=2000))
    page = content(figure)
    assert len(places(page["parts"][0], page["box"])) == 500
    assert "500 of 2,000 points" in figure.note
    assert figure.note in page["note"]


def test_a_page_of_as_many_points_and_triangles_as_there_may_be_stays_small(cloud):
    points = cloud.isel(sample=np.arange(300_000) % 2000)
    assert len(plot_3d(points).html) < 3e6
    vertices, faces = icosphere(7)
    assert len(faces) > 300_000
    surface = Surface(vertices=vertices, faces=faces)
    assert len(plot_3d([points, surface]).html) < 6e6


def test_nothing_on_a_page_names_another_host_or_ends_its_script(trunk):
    caption = "</script><script>alert(1)</script> <b>&"
    figure = plot_3d(trunk, caption=caption)
    assert content(figure)["caption"] == caption
    assert "://" not in figure.html
    assert figure.html.count("<script") == 2
    assert "default-src 'none'" in figure.html


def test_a_notebook_shows_the_page_itself(trunk):
    figure = plot_3d(trunk)
    frame = re.fullmatch(r'<iframe srcdoc="([^"]*)".*</iframe>', figure._repr_html_(), re.S)
    assert html.unescape(frame[1]) == figure.html


def test_bundles_of_an_arm_have_their_colors_and_its_length(trunk):
    page = content(plot_3d(trunk, unit="m"))
    colors = {tuple(part["color"]) for part in page["parts"]}
    assert colors >= {bundle_color(k) for k in range(3)}
    heights = [places(part, page["box"])[:, 2].max() for part in page["parts"]]
    assert max(heights) == pytest.approx(trunk.length, rel=1e-3)
    assert [label for label, _ in page["keys"][0]["entries"]] == list(trunk.bundle_names)


def test_equilibria_are_bodies_if_stable_or_followed_and_lines_if_not():
    soft = sr.Material(young_modulus=5e4, density=1000.0)
    arm = sr.designs.minimal_trunk(material=soft).replace(loads=sr.Loads())
    found = sr.equilibria(arm, [0.0, 0.0, 0.0])
    names = [part["name"] for part in content(plot_3d(found))["parts"]]
    stable = int((found.status == 0).sum())
    assert stable == 1
    assert found.status[found.followed] == 1
    assert names.count("unstable ones") == len(found) - stable - 1
    assert {"other stable ones", "from the unloaded arm, unstable"} < set(names)


def test_what_cannot_be_shown_is_refused_and_pages_end_in_html(trunk, tmp_path):
    with pytest.raises(InvalidInput, match="data = 5: must be clouds"):
        plot_3d([trunk, 5])
    with pytest.raises(InvalidInput, match=r"ending in .html"):
        save_figure(plot_3d(trunk), tmp_path / "arm.png")
    save_figure(plot_3d(trunk), tmp_path / "arm.html")


def test_a_simplified_ball_stays_closed_and_keeps_its_volume():
    vertices, faces = icosphere(5)
    coarse, fewer = simplified(vertices, faces, 5000)
    assert 2000 < len(fewer) <= 5000
    sides = np.sort(fewer[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(sides, axis=0, return_counts=True)[1] % 2 == 0).all()
    volume = enclosed_volume(vertices, faces)
    assert enclosed_volume(coarse, fewer) == pytest.approx(volume, rel=0.02)


def test_markers_are_dots_where_they_are_and_seen_through_the_arm(trunk):
    markers = (sr.arm.Marker(name="half", station=0.5), sr.arm.Marker(name="tool"))
    arm = trunk.replace(markers=markers)
    shape = sr.configuration(arm, (-1.0, -0.2, -0.5))
    page = content(plot_3d(shape))
    dots = next(part for part in page["parts"] if "faces" not in part)
    assert dots["through"]
    side = np.ptp(page["box"], axis=0).max()
    expected = shape.marker_position.values / arm.length
    np.testing.assert_allclose(places(dots, page["box"]), expected, atol=1e-3 + side / 65535)


# Laws of tubes and ribbons: closed, outward, and of the volume that they should have


trimesh = pytest.importorskip("trimesh")

TURN = np.linspace(0, 5, 160)
HELIX = np.column_stack([np.cos(TURN), np.sin(TURN), 0.3 * TURN])
INWARD = np.column_stack([-np.cos(TURN), -np.sin(TURN), 0 * TURN])
ALONG = np.column_stack([-np.sin(TURN), np.cos(TURN), 0.3 + 0 * TURN]) / np.hypot(1, 0.3)
FRENET = INWARD, np.cross(ALONG, INWARD)


def solid(surface):
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def straight(sides, radii=0.1, stations=11):
    center = np.zeros((stations, 3))
    center[:, 2] = np.linspace(0, 2, stations)
    frame = np.broadcast_to(np.eye(3), (stations, 3, 3))
    return solid(tube_surface(center, frame[:, 0], frame[:, 1], radii, sides))


def assert_closed(mesh):
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.volume > 0


def test_volume_tends_to_the_cylinder_with_second_order():
    sides = np.array([16, 32, 64, 128])
    errors = [np.pi * 0.1**2 * 2 - straight(n).volume for n in sides]
    order = -np.diff(np.log(errors)) / np.diff(np.log(sides))
    np.testing.assert_allclose(order, 2, atol=0.05)


def test_volume_of_a_prism_is_exact_for_any_number_of_sides():
    for sides in (3, 4, 7):
        area = sides / 2 * 0.1**2 * np.sin(2 * np.pi / sides)
        assert straight(sides).volume == pytest.approx(2 * area, rel=1e-12)


def test_a_linear_taper_gives_a_frustum():
    mesh = straight(2000, np.linspace(0.1, 0.03, 11))
    frustum = np.pi * 2 / 3 * (0.1**2 + 0.1 * 0.03 + 0.03**2)
    assert mesh.volume == pytest.approx(frustum, rel=1e-5)


@pytest.mark.parametrize("sides", [3, 8, 33])
def test_tubes_are_closed_and_outward(sides):
    assert_closed(straight(sides))
    assert_closed(solid(tube_surface(HELIX, *FRENET, 0.05, sides)))


def test_a_tube_along_a_curve_has_the_volume_of_pappus():
    length = TURN[-1] * np.hypot(1, 0.3)
    mesh = solid(tube_surface(HELIX, *FRENET, 0.05, 200))
    assert mesh.volume == pytest.approx(np.pi * 0.05**2 * length, rel=1e-3)


def test_a_ribbon_is_a_closed_slab():
    low = np.stack(np.meshgrid([0, 0.5, 1.0], [0, 0.4], [0.0], indexing="ij"), -1)[:, :, 0]
    mesh = solid(ribbon_surface(low, low + [0, 0, 0.1]))
    assert_closed(mesh)
    assert mesh.volume == pytest.approx(1.0 * 0.4 * 0.1)


def test_a_grid_covers_its_points_once():
    points = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0), [0.0], indexing="ij"), -1)
    mesh = solid(Surface(vertices=points.reshape(-1, 3), faces=grid_faces(4, 3)))
    assert mesh.area == pytest.approx(6)
    assert (mesh.face_normals[:, 2] == 1).all()


def test_curves_and_sides_that_enclose_nothing_are_refused():
    with pytest.raises(InvalidInput, match="stations >= 2"):
        tube_surface(np.zeros((1, 3)), *np.eye(3)[:2, None], 0.1)
    with pytest.raises(InvalidInput, match="at least 3"):
        straight(2)
    with pytest.raises(InvalidInput, match="two equal"):
        ribbon_surface(np.zeros((2, 2, 3)), np.zeros((2, 3, 3)))
