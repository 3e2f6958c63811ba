"""A figure that turns, in a browser: it is drawn, a drag turns it, and it asks nobody."""

import io

import numpy as np
import pytest

import softreach as sr
from softreach.plot import plot_3d, save_figure
from tests.browser import heard

pytest.importorskip("matplotlib.pyplot")


def colored(image: np.ndarray) -> int:  # pixels
    return int((np.ptp(image, axis=-1) > 0.2).sum())


def test_a_page_is_drawn_and_turns_and_zooms_without_a_network(trunk, browser, tmp_path):
    from matplotlib.image import imread

    shape = sr.configuration(trunk, [-1.0, 0.0, -0.4], stations=31)
    figure = plot_3d([sr.compute_cloud(trunk, n=5000), shape], unit="mm", caption="A trunk")
    save_figure(figure, tmp_path / "trunk.html")
    context = browser.new_context(viewport={"width": 640, "height": 520}, offline=True)
    page = context.new_page()
    trouble, requests = heard(page)
    space = page.locator("#space")

    def drawn(settings: str) -> np.ndarray:
        page.evaluate(f"{settings}; new Promise(done => requestAnimationFrame(done))")
        return imread(io.BytesIO(space.screenshot()))[..., :3]

    page.goto((tmp_path / "trunk.html").as_uri())
    first = drawn("0")
    page.mouse.move(320, 200)
    page.mouse.down()
    page.mouse.move(420, 170, steps=2)
    page.mouse.up()
    turned = drawn("0")
    page.mouse.wheel(0, -600)
    nearer = drawn("0")
    page.get_by_label("cloud").uncheck()
    alone = drawn("0")
    assert page.title() == "A trunk"
    context.close()
    assert colored(first) > 5000
    assert np.abs(turned - first).max(axis=-1).mean() > 0.02
    assert colored(nearer) > 1.3 * colored(turned)
    assert 100 < colored(alone) < 0.5 * colored(nearer)
    assert len(requests) == 1
    assert [text for text in trouble if "GL Driver Message" not in text] == []  # of the machine
