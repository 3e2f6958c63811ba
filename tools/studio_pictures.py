"""Takes the pictures of docs/studio.md in a real browser: `python -m tools.studio_pictures`.

It takes two minutes. `python -m tools.studio_pictures NAME ...` takes these alone.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright
from tests.browser import CHROMIUM, FLAGS
from tests.studio.tab import Tab
from tests.studio.test_view_in_browser import pose

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.requirements import Requirements, Target
from softreach.studio import Studio
from softreach.studio.start import start_on_design

PICTURES = Path(__file__).parent.parent / "docs" / "images"
LAPTOP, PHONE = (1366, 768), (390, 844)
COLORS = 255  # the palette of a picture: what keeps it below MOST
MOST = 250_000  # bytes
CURLED = (-0.7, -0.4, -0.9)
FOLDED = designs.minimal_trunk(revolution=np.radians(36), taper=np.radians(3))
PLACES = {"shelf": (0.37, 0.15, 0.85), "tray": (-0.1, -0.35, 0.6), "bin": (0.3, -0.3, 0.45)}
TWICE = (-0.4, -0.65, -0.18)  # brings it where one more activation does


def studio(tab: Tab) -> None:
    """The first picture, with the arm curled."""
    pose(tab, CURLED)


def studio_handle(tab: Tab) -> None:
    """The handle on the tip of a design that folds, and a ghost of the other solution."""
    tab.open("Move")
    tab.session.update(lambda state: state.replace(design=FOLDED))
    tab.settle()
    place = tuple(round(float(x), 5) for x in pose(tab, TWICE))
    tab.session.update(lambda state: state.replace(target=place))
    tab.session.look_from("side")
    tab.wait(lambda: tab.session.found.answer is not None, "the inverse answers")
    assert len(tab.session.found.answer or ()) > 1, "there is no ghost to see"


def studio_section(tab: Tab) -> None:
    """The section in its window."""
    pose(tab, CURLED)
    tab.open("View")
    tab.session.update(lambda state: state.showing(section=True))
    tab.settle()
    tab.page.get_by_text("one closed curve").wait_for()


def studio_compare(tab: Tab) -> None:
    """Two designs in a table, the kept one in gray."""
    tab.open("Compare")
    tab.press("Keep this design")
    design = changed(tab.session.state.design, {"taper": np.radians(1.5)})
    tab.session.update(lambda state: state.replace(design=design, activation=CURLED))


def studio_needs(tab: Tab) -> None:
    """Three places, one of them missed."""
    pose(tab, CURLED)
    needs = Requirements(targets=[Target([place], name=name) for name, place in PLACES.items()])  # pyright: ignore[reportArgumentType]
    tab.session.update(lambda state: state.replace(needs=needs.to_toml()))
    tab.settle()
    tab.open("Goals")


def studio_phone(tab: Tab) -> None:
    """The sheet of controls under the scene."""
    tab.session.update(lambda state: state.replace(activation=CURLED))


SCENES: dict[str, Callable[[Tab], None]] = {
    "studio": studio,
    "studio-handle": studio_handle,
    "studio-section": studio_section,
    "studio-compare": studio_compare,
    "studio-needs": studio_needs,
    "studio-phone": studio_phone,
}


def main() -> None:
    """Take the pictures named on the command line, or all."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for name in sys.argv[1:] or SCENES:
            with Studio(start_on_design(designs.minimal_trunk())) as running:
                take_picture(browser, running, name)
        browser.close()


def take_picture(browser: object, running: Studio, name: str) -> None:
    """Open a tab of the right size, bring it into its state, and save what it shows."""
    width, height = PHONE if name.endswith("phone") else LAPTOP
    tab = Tab(browser, running, (width, height))
    SCENES[name](tab)
    tab.settle()
    tab.page.mouse.move(20, 0.45 * height)  # away from tooltips
    tab.page.wait_for_timeout(2500)  # notices fade, the page draws
    save(tab.page.screenshot(), PICTURES / f"{name}.png")
    tab.close()


def save(screenshot: bytes, path: Path) -> None:
    """Write a picture with a small palette."""
    image = Image.open(io.BytesIO(screenshot)).convert("RGB")
    few = image.quantize(COLORS, method=Image.Quantize.MAXCOVERAGE, kmeans=1)
    few.save(path, optimize=True)
    size = path.stat().st_size
    if size > MOST:
        sys.exit(f"{path.name} has {size:,} bytes; at most {MOST:,} are meant for the page")


if __name__ == "__main__":
    main()
