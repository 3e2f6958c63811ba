"""What the scene shows, as pixels: the arm in sight from every side, views, lights, pictures."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from softreach.studio.jobs.inverse import SolveInverse
from softreach.studio.jobs.reach import FollowCamera, SweepReach
from softreach.studio.scene.camera import VIEWS, framing
from softreach.studio.serve.viser_fixes import headed
from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput
from softreach.support.palette import bundle_color
from tests.studio.tab import SIZE, unit

BLUE = (0.0, 0.15, 0.64)  # the third bundle's in the light of the scene
BUNDLES = [bundle_color(0), bundle_color(1), BLUE]


def pixels(tab) -> np.ndarray:
    """What the canvas shows, RGB from 0 to 1."""
    from matplotlib.image import imread

    tab.settle()
    canvas = tab.page.locator("canvas").first.bounding_box()

    def picture() -> np.ndarray:
        tab.page.wait_for_timeout(400)
        return imread(io.BytesIO(tab.page.screenshot(clip=canvas)))[..., :3]

    image = picture()
    for _ in range(8):  # until it stands still
        last, image = image, picture()
        if (last == image).all():
            break
    return image


def show(tab, **look) -> None:
    tab.session.update(lambda s: s.showing(**look))
    tab.settle()


def like(image: np.ndarray, color) -> int:
    """Number of pixels of about this hue, however bright."""
    size = np.linalg.norm(image, axis=-1)
    cosine = image @ np.asarray(color) / np.maximum(size, 1e-9) / np.linalg.norm(color)
    return int(((cosine > 0.985) & (size > 0.25)).sum())


def test_the_arm_is_seen_through_the_cloud_from_the_first_picture_on(tab):
    show(tab, mouse="none")  # the handle has a blue arrow
    seen = like(pixels(tab), BLUE)
    show(tab, cut="none")
    hidden = like(pixels(tab), BLUE)
    show(tab, cloud=False)
    alone = like(pixels(tab), BLUE)
    assert seen > 0.9 * alone
    assert hidden < 0.75 * seen


@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.large)])
def test_the_arm_stands_out_through_the_exact_surface(tab, dark):
    def change(**look) -> np.ndarray:
        """By how much the arm changes each pixel, 0 to 1."""
        with_arm, without = (pixels_of(tab, arm=shown, **look) for shown in (True, False))
        return np.abs(with_arm - without).max(axis=-1)[160:]  # a notice goes away above

    look = {"cloud": False, "mouse": "none", "dark": dark}
    of_arm = change(surface=False, **look) > 0.03
    assert of_arm.sum() > 1000
    assert (change(surface=True, **look)[of_arm] > 0.08).mean() > 0.9


def pixels_of(tab, **look) -> np.ndarray:
    show(tab, **look)
    return pixels(tab)


@pytest.mark.large
def test_no_point_is_drawn_before_the_arm_from_any_side(tab):
    tab.session.update(lambda s: s.replace(activation=(-1.0, -0.2, -0.5)))

    def arm(**look) -> int:
        """Pixels of the arm."""
        show(tab, mouse="none", **look)
        image = pixels(tab)
        return sum(like(image, color) for color in BUNDLES)

    for view in VIEWS:
        tab.session.look_from(view)
        there, seen = arm(cloud=False), arm(cloud=True)
        assert there > 50
        assert seen > 0.9 * there


def test_a_page_that_nobody_touches_sends_no_clouds(tab, monkeypatch):
    pixels(tab)
    sent = []
    clouds = tab.session.scene.clouds
    monkeypatch.setattr(clouds, "_send", lambda path, _: sent.append(path))
    tab.page.wait_for_timeout(1500)
    tab.session.follow(FollowCamera)
    tab.settle()
    assert sent == []


@pytest.mark.large
def test_the_target_is_seen_through_the_cloud(tab):
    target = np.array([0.0, 0.1, 0.5])
    show(tab, arm=False)
    tab.session.job(SolveInverse).aim(target)
    tab.wait(lambda: tab.session.answer is not None, "the target is solved for")
    image = pixels(tab)
    right, down = tab.projected(target)
    mark = image[round(down * len(image)), round(right * image.shape[1])]
    assert mark[0] > 0.6  # orange, which the scale of colors has nowhere
    assert mark[2] < 0.3 * mark[0]
    assert mark[1] < 0.75 * mark[0]


@pytest.mark.large
def test_buttons_look_from_the_front_the_side_and_the_top(tab):
    tab.open("View")
    for view, axis in (("front", 1), ("side", 0), ("top", 2)):
        tab.press(view)
        tab.wait(lambda axis=axis: along(tab, axis) > 0.99, f"the {view} is seen")
        tab.settle()
        names = {f"{'xyz'[k]} [m]" for k in range(3) if k != axis}
        tab.wait(lambda names=names: named_axes(tab) == names, f"{names} are named")


def named_axes(tab) -> set[str]:
    labels = [tab.drawn(f"/axes/label {k}") for k in range(60)]
    texts = [label.text for label in labels if label is not None]
    return {text for text in texts if text.endswith("[m]")}


def along(tab, axis: int) -> float:
    """Cosine between where the eye looks and an axis."""
    camera = tab.session.camera.actual()
    way = np.subtract(camera.look_at, camera.position)
    return abs(way[axis]) / np.linalg.norm(way)


@pytest.mark.large
def test_numbers_stand_outside_of_what_they_number_from_every_side(tab):
    low, high = tab.session.scene.axes.corners
    middle = (low + high) / 2
    for toward in ((2, -4, 1.5), (-3, 3, 1), (3, 2, -2), (-4, -1, -2)):
        with tab.session.drawing:  # the eye's own job turns them too
            tab.session.scene.axes.turn(middle + np.array(toward))
            labels = [tab.drawn(f"/axes/label {k}") for k in range(60)]
        places = np.array([label.position for label in labels if label is not None])
        assert ((places < low) | (places > high)).any(axis=1).all()


def test_a_saved_picture_is_drawn_anew_over_key_numbers_and_design(tab, tmp_path, monkeypatch):
    from matplotlib.image import imread

    show(tab, cloud=False, surface=True)
    camera = tab.session.client.camera
    tab.open("Export")
    tab.choose("picture", "as it is seen (.png)")
    image = imread(tab.save("Save picture", tmp_path))[..., :3]
    assert image.shape[1] == 2 * camera.image_width
    scene, below = np.split(image, [2 * camera.image_height])
    assert len(below) > 160
    yellow = (0.99, 0.91, 0.14)  # the end of the scale of colors
    assert like(below, yellow) > 20
    assert (below.max(axis=-1) < 0.5).sum() > 500  # text
    assert like(scene, BLUE) > 100
    differ = np.abs(scene[::2, ::2] - scene[1::2, 1::2]).max(axis=-1) > 0.02
    assert differ.mean() > 0.02  # copies of a pixel would be equal
    assert tab.drawn("/thick-lines") is None
    monkeypatch.setattr("softreach.studio.scene.camera._LONGEST", 100)
    with pytest.raises(InvalidInput, match="make the window smaller"):
        tab.session.picture()


def test_a_scale_bar_is_as_long_as_that_length_at_the_depth_of_the_target(tab):
    def length(depth: float) -> float:
        """Pixels of 1 L across the sight, so much [L] behind the target."""
        camera = tab.session.client.camera
        forward = unit(camera.look_at - camera.position)
        right = 0.05 * unit(np.cross(forward, camera.up_direction))
        middle = camera.look_at + depth * forward
        ends = [tab.projected(middle + side * right)[0] for side in (-1, 1)]
        return (ends[1] - ends[0]) * camera.image_width / 0.1

    assert tab.session.camera.pixels_per_length == pytest.approx(length(0.0), rel=1e-9)
    assert length(0.3) < 0.95 * length(0.0)


def test_f_leaves_the_scene_with_large_numbers_and_escape_brings_the_panel_back(tab):
    page, numbers = tab.page, tab.page.locator("[data-history] b").first
    canvas, small = page.locator("canvas").first, numbers.bounding_box()["height"]
    field = page.get_by_role("textbox", name="taper φ [deg]")
    field.focus()
    page.keyboard.press("f")
    assert page.get_by_role("tab", name="Design").is_visible()  # who types an f wants one
    page.keyboard.press("Escape")
    page.get_by_role("tab", name="Design").focus()
    for leave in ("Escape", "f"):
        page.keyboard.press("f")
        tab.wait(lambda: canvas.bounding_box()["width"] == SIZE[0], "the scene is as wide")
        assert not page.get_by_role("tab", name="Design").is_visible()
        assert numbers.bounding_box()["height"] > 1.3 * small
        page.keyboard.press(leave)
        tab.wait(lambda: canvas.bounding_box()["width"] < SIZE[0], "the panel is back")
        assert page.get_by_role("tab", name="Design").is_visible()


def sweep(tab, motion: str) -> None:
    tab.page.evaluate(f"localStorage.setItem('viser-user:softreach-motion', '{motion}')")
    tab.session.job(SweepReach).ask()


def test_the_arm_sweeps_until_a_key_and_leaves_nothing_behind(tab, monkeypatch):
    show(tab)
    session, moved = tab.session, []
    monkeypatch.setattr(session, "is_touched", False)
    draw = session.scene.draw_arm
    monkeypatch.setattr(
        session.scene,
        "draw_arm",
        lambda arm, at, *more, **held: moved.append(at) or draw(arm, at, *more, **held),
    )
    before, tip = (session.state, session.history), session.tip
    sweep(tab, "welcome")
    tab.wait(lambda: len(moved) > 3, "the arm moves")
    tab.page.keyboard.press("x")
    tab.settle()
    assert moved[-1] == before[0].activation
    assert (session.state, session.history) == before
    np.testing.assert_array_equal(session.tip, tip)
    assert not session.is_touched


def test_no_arm_sweeps_where_less_motion_is_wanted(tab, browser, studio, monkeypatch):
    context = browser.new_context(reduced_motion="reduce")
    page = context.new_page()
    page.route("**/*", lambda route: route.fulfill(body=headed("<title>Viser</title>")))
    page.goto(studio.url)
    assert page.evaluate("localStorage.getItem('viser-user:softreach-motion')") == ""
    context.close()
    monkeypatch.setattr(tab.session, "is_touched", False)
    tips = []
    monkeypatch.setattr(tab.session.scene, "draw_arm", lambda *_: tips.append(_))
    monkeypatch.setattr(tab.session, "follow", lambda *_: None)
    tab.page.evaluate("localStorage.setItem('viser-user:softreach-motion', '')")
    tab.session.job(SweepReach).do(lambda: None)
    assert tips == []


@pytest.mark.large
def test_numbers_are_dark_on_light_and_light_on_dark(tab):
    show(tab, cloud=False, arm=False, mouse="none")
    name = next(one for k in range(60) if (one := tab.drawn(f"/axes/label {k}")).text == "x [m]")

    def around() -> np.ndarray:
        image = pixels(tab)
        right, down = tab.projected(name.position)
        row, column = round(down * len(image)), round(right * image.shape[1])
        return image[row - 6 : row + 6, column - 10 : column + 10].mean(axis=-1)

    tab.wait(lambda: around().min() < 0.4, "there is text")
    assert np.median(around()) > 0.9
    show(tab, dark=True)
    tab.wait(lambda: np.median(around()) < 0.2, "it gets dark")
    tab.wait(lambda: around().max() > 0.5, "the text gets light")
    show(tab, dark=False)
    tab.wait(lambda: np.median(around()) > 0.9, "it gets light")


def test_a_view_that_was_kept_on_a_phone_is_framed_anew_from_its_side(tab):
    kept, corners = tab.session.state_now(), tab.session.scene.axes.corners
    assert kept.camera.aspect == tab.session.camera.aspect
    of_phone = replace(framing(*corners, VIEWS["side"], 0.46), aspect=0.46)
    tab.session.restore(kept.replace(camera=of_phone))
    wanted = framing(*corners, VIEWS["side"], tab.session.camera.aspect)
    np.testing.assert_allclose(tab.session.camera.actual().position, wanted.position, atol=1e-6)
    tab.session.restore(StudioState.from_json(kept.to_json()))
    np.testing.assert_allclose(tab.session.camera.actual().position, kept.camera.position)
