"""A browser tab as a person uses it, beside the session that serves it."""

import io
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.studio import Start, Studio
from softreach.studio.reach import Reach
from softreach.studio.session import Session

PATIENCE = 300.0  # [s] a loaded machine compiles shaders slowly
SIZE = 900, 560
FOLDED = 40  # pixels: what a folder whose head alone is seen is lower than
HARMLESS = (
    "Tried to update non-existent component",  # it was removed before the page heard of it
    "Unable to preventDefault inside passive event listener",
)
"""Errors of viser's in the console."""

CHEAP = """
    window.requestAnimationFrame = draw => setTimeout(() => draw(performance.now()), 150);
    window.cancelAnimationFrame = clearTimeout;
    const context = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, options) {
        return context.call(this, kind, {...options, antialias: false});
    };
    addEventListener("DOMContentLoaded", () => {
        const style = document.createElement("style");
        style.textContent = "* {transition: none !important}";
        document.head.append(style);
    });
"""
"""Seven pictures a second, with jagged edges and nothing that glides: there is no graphics card."""
FLASH = """
    window.flashed = false;
    (function look() {
        if (document.querySelector("[data-softreach]")) return;
        const panel = document.querySelector(".mantine-Paper-root");
        if (panel && panel.checkVisibility({visibilityProperty: true})) window.flashed = true;
        setTimeout(look, 20);
    })();
"""
"""Notes whether a panel was seen before ours."""
SCROLLED_UP = """
    for (const area of document.querySelectorAll(".mantine-ScrollArea-viewport")) {
        area.scrollTop = 0;
    }
"""


class Tab:
    def __init__(
        self, browser, studio: Studio, size: tuple[int, int] = SIZE, *, drawing: str = CHEAP
    ) -> None:
        self.context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, accept_downloads=True
        )
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.context.add_init_script(drawing + FLASH)
        self.context.on("request", lambda request: self.requests.append(request.url))
        self.page = self.context.new_page()
        self.page.set_default_timeout(1000 * PATIENCE)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", self._console)
        known = set(studio.sessions)
        self.page.goto(studio.url)
        self.wait(lambda: set(studio.sessions) - known, "the page connects")
        self.session: Session = studio.sessions[max(studio.sessions)]
        self.wait(lambda: self.session.panels, "the tab is furnished")
        self.page.get_by_text("taper φ [deg]").wait_for()
        self.settle()

    def _console(self, message) -> None:
        if message.type == "error" and not message.text.startswith(HARMLESS):
            self.errors.append(message.text)

    def reset(self, start: Start) -> None:
        """Leave nothing of the test before but what stands in no state."""
        self.settle()
        self.errors.clear()
        self.page.mouse.move(1, 1)  # off whatever the test before left it on
        self.page.set_viewport_size({"width": SIZE[0], "height": SIZE[1]})
        self.session.quality = start.quality
        self.session.update(lambda _: start.state)
        self.session.look_from("oblique")
        self.session.end_step()
        self.settle()
        self.open("Design")
        self.page.evaluate(SCROLLED_UP)

    def close(self) -> None:
        self.settle()  # viser warns of what is drawn for a tab that is gone
        self.context.close()

    def wait(self, condition: Callable[[], object], what: str) -> None:
        """Let the page and the server work until the condition holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"still waiting until {what}"
            self.page.wait_for_timeout(30)

    def settle(self) -> None:
        """Wait until the page has sent what it holds back, and the session has done its work.

        Of changes of two widgets within 50 ms the page sends only the last.
        """
        self.page.evaluate("new Promise(done => setTimeout(done, 120))")
        assert self.session.settle(PATIENCE)

    def open(self, name: str) -> None:
        self.page.get_by_role("tab", name=name).click()

    def unfold(self, name: str) -> None:
        head = self.page.get_by_text(name, exact=True).locator("visible=true")
        head.wait_for()
        if head.locator("xpath=..").bounding_box()["height"] < FOLDED:
            head.click()

    def slider(self, label: str):
        return self.page.locator(
            f"xpath=//label[normalize-space()='{label}']/following::*[@role='slider'][1]"
        )

    def center(self, place) -> None:
        place.evaluate("place => place.scrollIntoView({block: 'center'})")

    def drag(self, label: str, pixels: int) -> None:
        """Grab the thumb of a slider and pull it along, again if the page moved it meanwhile."""
        thumb = self.slider(label)
        before = thumb.get_attribute("aria-valuenow")

        def dragged() -> bool:
            self.center(thumb)
            self.page.wait_for_timeout(50)
            box = thumb.bounding_box()
            x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            self.page.mouse.move(x, y)
            self.page.mouse.down()
            self.page.mouse.move(x + pixels, y, steps=4)
            self.page.mouse.up()
            self.page.wait_for_timeout(100)
            return thumb.get_attribute("aria-valuenow") != before

        self.wait(dragged, f"{label} moves")

    def press(self, button: str) -> None:
        self.page.get_by_role("button", name=button, exact=True).click()

    def field(self, label: str):
        """What stands behind a label to be typed into, or opened."""
        return self.page.locator(
            f"xpath=//label[normalize-space()='{label}']/following::input[1] >> visible=true"
        )

    def choose(self, label: str, option: str) -> None:
        """Pick an option of a menu; of several of this label, the first."""
        self.field(label).first.click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def drawn(self, path: str):
        return self.session.client.scene.get_handle_by_name(path)

    def save(self, button: str, folder: Path) -> Path:
        with self.page.expect_download() as caught:
            self.press(button)
        path = folder / caught.value.suggested_filename
        caught.value.save_as(path)
        return path

    def upload(self, button: str, path: Path) -> None:
        with self.page.expect_file_chooser() as caught:
            self.press(button)
        caught.value.set_files(path)

    def type(self, label: str, text: str) -> None:
        """Fill the field behind a label or beside its slider with another value, and apply it."""
        self.settle()  # what follows from the change before shows in the field too
        label = f"//label[normalize-space()='{label}']"
        row = f"xpath={label}/ancestor::form[1]//input | {label}/following::form[1]//input"
        place = self.page.locator(row).locator("visible=true").first
        before, alerts = self.session.state, self.page.get_by_role("alert").locator("visible=true")

        def applied() -> bool:
            place.fill(text)
            place.press("Enter")
            self.page.wait_for_timeout(300)
            self.settle()
            return self.session.state != before or alerts.count() > 0

        self.wait(applied, f"{label} is {text}, or refused")

    def show_surface(self, on: bool = True) -> None:
        """Show the exact surface alone, or nothing of the reach."""
        self.open("View")
        self.page.get_by_label("cloud", exact=True).set_checked(False)
        self.page.get_by_label("exact surface", exact=True).set_checked(on)
        self.settle()

    def reach_of(self, arm: Manipulator) -> Reach:
        """The reach of a design, once the page has it."""
        self.wait(lambda: self.session.found.complete_reach(arm), "the reach is known")
        self.settle()
        return self.session.found.complete_reach(arm)

    def pixels(self) -> np.ndarray:
        """What the canvas shows once it stands still, RGB from 0 to 1, shape (rows, columns, 3)."""
        self.settle()
        from matplotlib.image import imread

        canvas = self.page.locator("canvas").first.bounding_box()

        def picture() -> np.ndarray:
            self.page.wait_for_timeout(250)
            return imread(io.BytesIO(self.page.screenshot(clip=canvas)))[..., :3]

        last, image = picture(), picture()
        for _ in range(7):
            if (last != image).any():
                last, image = image, picture()
        return image

    def changed(self, before: np.ndarray) -> float:
        """Share of the canvas that looks different now."""
        now = self.pixels()
        rows, columns = np.minimum(now.shape[:2], before.shape[:2])
        apart = np.abs(now[:rows, :columns] - before[:rows, :columns]).max(axis=-1)
        return float((apart > 0.03).mean())

    def screen(self, point: np.ndarray) -> tuple[float, float]:
        """Pixels of a point of the scene [L] in the page."""
        canvas = self.page.locator("canvas").first.bounding_box()
        right, down = self.projected(point)
        return canvas["x"] + right * canvas["width"], canvas["y"] + down * canvas["height"]

    def labels(self) -> list:
        """Numbers and names along the axes of the scene."""
        return [label for k in range(60) if (label := self.drawn(f"/axes/label {k}"))]

    def drag_tip(self, begin: np.ndarray, end: np.ndarray) -> None:
        """Grab the ball at a point [L] and pull it to another; the button stays down."""
        self.page.mouse.move(*self.screen(begin))
        self.page.wait_for_timeout(100)
        self.page.mouse.down()
        for part in np.linspace(0, 1, 13)[1:]:
            self.page.mouse.move(*self.screen(begin + part * (end - begin)))
            self.page.wait_for_timeout(30)

    def projected(self, point: np.ndarray) -> tuple[float, float]:
        """Place of a point in the canvas, 0 to 1 from its upper left."""
        camera = self.session.client.camera
        forward = camera.look_at - camera.position
        right = np.cross(forward, camera.up_direction)
        ways = np.stack([right, np.cross(right, forward), forward])
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        across, up, ahead = ways @ (point - camera.position)
        half = np.tan(camera.fov / 2) * ahead
        return 0.5 + across / half / camera.aspect / 2, 0.5 - up / half / 2


def like(image: np.ndarray, color: Sequence[float]) -> int:
    """Number of pixels of about this hue, however bright."""
    size = np.linalg.norm(image, axis=-1)
    cosine = image @ np.asarray(color) / np.maximum(size, 1e-9) / np.linalg.norm(color)
    return int(((cosine > 0.985) & (size > 0.25)).sum())
