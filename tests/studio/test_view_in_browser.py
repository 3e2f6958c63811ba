"""What the scene shows, as pixels: the arm in sight from every side, views, lights, pictures."""

import io
from dataclasses import replace

import numpy as np
import pytest

import softreach as sr
from softreach.studio.scene.camera import VIEWS, framing
from softreach.studio.state import StudioState
from tests.studio.tab import like

BLUE = (0.0, 0.15, 0.64)  # the third bundle's in the light of the scene


def pixels(tab, **look) -> np.ndarray:
    tab.session.update(lambda s: s.showing(**look))
    return tab.pixels()


@pytest.mark.large
def test_the_arm_is_seen_through_the_cloud_from_the_first_picture_on(tab):
    seen = like(pixels(tab, mouse="none"), BLUE)  # the handle has a blue arrow
    hidden = like(pixels(tab, half=False), BLUE)
    alone = like(pixels(tab, cloud=False), BLUE)
    assert seen > 0.9 * alone
    assert hidden < 0.75 * seen


@pytest.mark.large
@pytest.mark.parametrize("dark", [False, True])
def test_the_arm_stands_out_through_the_exact_surface(tab, dark):
    def change(**look) -> np.ndarray:
        """By how much the arm changes each pixel, 0 to 1."""
        with_arm, without = (pixels(tab, arm=shown, **look) for shown in (True, False))
        return np.abs(with_arm - without).max(axis=-1)

    look = {"cloud": False, "mouse": "none", "dark": dark}
    of_arm = change(surface=False, **look) > 0.03
    assert of_arm.sum() > 1000
    assert (change(surface=True, **look)[of_arm] > 0.08).mean() > 0.9


@pytest.mark.large
def test_buttons_look_from_the_front_the_side_and_the_top(tab):
    def is_seen_along(axis: int) -> bool:
        camera = tab.session.camera.actual()
        way = np.subtract(camera.look_at, camera.position)
        names = {label.text for label in tab.labels() if label.text.endswith("[m]")}
        others = {f"{other} [m]" for other in "xyz".replace("xyz"[axis], "")}
        return abs(way[axis]) / np.linalg.norm(way) > 0.99 and names == others

    tab.open("View")
    for view, axis in (("front", 1), ("side", 0), ("top", 2)):
        tab.press(view)
        tab.wait(lambda axis=axis: is_seen_along(axis), f"the {view} is seen, its axes are named")


@pytest.mark.large
def test_a_saved_picture_is_drawn_anew_over_key_numbers_and_design(tab, tmp_path):
    from matplotlib.image import imread

    tab.show_surface()
    camera = tab.session.client.camera
    tab.open("Export")
    tab.choose("picture", "as it is seen (.png)")
    image = imread(tab.save("Save picture", tmp_path))[..., :3]
    assert image.shape[1] == 2 * camera.image_width
    empty = (np.abs(image - image[0, 0]).max(axis=(1, 2)) < 0.01).astype(int)
    bands = np.diff(np.flatnonzero(np.diff(empty, prepend=0, append=0)))[::2]
    assert bands.max() < 100  # no third of the picture is empty
    above, scene, below = np.split(image, [100, len(image) - 100])
    yellow = (0.99, 0.91, 0.14)  # the end of the scale of colors
    assert like(above, yellow) > 20
    assert (below.max(axis=-1) < 0.5).sum() > 500  # text
    assert like(scene, BLUE) > 100
    scene = scene[: len(scene) // 2 * 2]
    differ = np.abs(scene[::2, ::2] - scene[1::2, 1::2]).max(axis=-1) > 0.02
    assert differ.mean() > 0.02  # copies of a pixel would be equal
    assert tab.drawn("/thick-lines") is None


def test_a_view_that_was_kept_on_a_phone_is_framed_anew_from_its_side(tab):
    kept, corners = tab.session.state_now(), tab.session.scene.axes.corners
    assert kept.camera.aspect == tab.session.camera.aspect
    of_phone = replace(framing(*corners, VIEWS["side"], 0.46), aspect=0.46)
    tab.session.restore(lambda _: kept.replace(camera=of_phone))
    wanted = framing(*corners, VIEWS["side"], tab.session.camera.aspect)
    np.testing.assert_allclose(tab.session.camera.actual().position, wanted.position, atol=1e-6)
    tab.session.restore(lambda _: StudioState.from_json(kept.to_json()))
    np.testing.assert_allclose(tab.session.camera.actual().position, kept.camera.position)


# The tip is dragged: the arm follows on its branch, as far as that leads


def pose(tab, activation):
    tab.session.update(lambda s: s.replace(activation=activation, target=None))
    tab.settle()
    tip = sr.tip_positions(tab.session.state.design, [activation])[0]
    tab.wait(lambda: np.allclose(tab.drawn("/grip").position, tip, atol=1e-4), "the ball is there")
    tab.page.wait_for_timeout(200)  # until the page has drawn it
    return tip


def around(tab, point):
    """What the page shows where a point of the scene [L] is, RGB from 0 to 1."""
    from matplotlib.image import imread

    x, y = tab.screen(point)
    clip = {"x": x - 4, "y": y - 4, "width": 8, "height": 8}
    return imread(io.BytesIO(tab.page.screenshot(clip=clip)))[..., :3]


@pytest.mark.large
def test_beyond_the_boundary_the_arm_stays_near_and_a_line_shows_the_gap(tab):
    tab.open("Move")
    begin = pose(tab, (-0.2, -0.1, -0.1))
    tab.drag_tip(begin, begin + [0.0, 0.0, 0.35])
    tab.wait(lambda: tab.session.found.lag and tab.session.found.lag.dragged.gap > 0.02, "a gap")
    tab.settle()
    pull = tab.session.found.lag
    assert tab.drawn("/lag/label").text == f"{pull.dragged.gap:.3g} m short"
    answer = sr.solve_inverse(tab.session.state.design, [pull.wanted])[0]
    assert pull.dragged.gap == pytest.approx(answer.gap, abs=1e-5)
    tab.page.mouse.up()
    tab.wait(lambda: tab.drawn("/lag") is None, "the drag rests")
    tab.settle()
    assert tab.drawn("/gap")


@pytest.mark.large
def test_a_handle_behind_the_arm_is_seen_through_it_and_can_be_grabbed(tab):
    tab.open("Move")
    tab.session.look_from("oblique")
    pose(tab, (-0.7, -0.4, -0.9))
    tab.wait(lambda: tab.drawn("/arm/0").opacity is None, "an arm beside its tip is solid")
    begin = pose(tab, (-0.48, -0.16, -1.23))  # the tip behind the body
    tab.wait(lambda: tab.drawn("/arm/0").opacity == 0.6, "an arm before its tip is not")
    tab.wait(lambda: around(tab, begin).min() < 0.45, "the ball is seen")  # the body is lighter
    tab.drag_tip(begin, begin + [0.0, 0.0, 0.02])
    tab.wait(lambda: tab.session.found.lag, "the arm follows")
    tab.page.mouse.up()
    tab.wait(lambda: tab.session.state.target is not None, "the drag rests")
    tab.settle()
