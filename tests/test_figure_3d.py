"""Laws of figures that turn in a browser: what the page holds is what was given to it."""

import base64
import html
import json
import re

import numpy as np
import pytest

import softreach as sr
from softreach.geometry.sphere_maps import icosphere
from softreach.geometry.surface import Surface, enclosed_volume, simplified
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


def test_nothing_on_a_page_names_another_host_or_ends_its_script_and_notebooks_show_it(trunk):
    caption = "</script><script>alert(1)</script> <b>&"
    figure = plot_3d(trunk, caption=caption)
    assert content(figure)["caption"] == caption
    assert "://" not in figure.html
    assert figure.html.count("<script") == 2
    assert "default-src 'none'" in figure.html
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
    assert {"other stable ones", "posture, unstable"} < set(names)


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
