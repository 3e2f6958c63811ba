"""Nothing that came from elsewhere is rendered, and the page talks to its own server alone."""

import socket

import pytest

from tests.studio.tab import CHEAP
from tests.studio.test_hostile_states import design_with, look_with, state_with

STRIKE = '<img src=x onerror="document.title=1"><b class=struck>struck</b><iframe srcdoc=struck>'
QUOTED = STRIKE.replace('"', '\\"')


NAMED = design_with('name = "left"', f'name = "{QUOTED}"')
RING = design_with(
    "inner_ratio", f'name = "{QUOTED}"\nmaterial = {{ name = "{QUOTED}" }}\ninner_ratio'
)
FILES = {
    "level.json": look_with(level=STRIKE),
    "color.json": look_with(level=12, color=STRIKE),
    "reference.json": state_with(design=RING, reference=NAMED),
    "kind.toml": design_with('kind = "fiber"', f'kind = "{QUOTED}"'),
    f"{STRIKE.replace('/', '')}.toml": "=",
}
"""One of each kind of place: a value, a choice, the names of parts, a key, the name of the file."""


def assert_nothing_struck(page):
    assert page.locator(".struck").count() == 0
    assert page.locator("iframe").count() == 0
    assert page.locator("img[src=x]").count() == 0
    assert page.title() != "1"


def read(tab, name, text):
    with tab.page.expect_file_chooser() as caught:
        tab.press("Load state or design")
    before = tab.session.revision
    tab.session.note = ""
    file = {"name": name, "mimeType": "text/plain", "buffer": text.encode()}
    caught.value.set_files(file)
    session = tab.session
    tab.wait(lambda: session.note or session.revision != before, f"{name} is taken or refused")
    tab.settle()
    tab.page.wait_for_timeout(100)


def test_no_text_of_a_file_or_its_name_is_markup(tab):
    """What is taken is on many panels; what is refused, in one message, as the text that it is."""
    tab.open("Export")
    taken = set()
    for name, text in FILES.items():
        before = tab.session.state
        read(tab, name, text)
        assert_nothing_struck(tab.page)
        if tab.session.state != before:
            taken.add(name)
            for panel in ("Design", "Parts", "Move", "View", "Compare", "Export"):
                tab.open(panel)
                assert_nothing_struck(tab.page)
        if name == "level.json":
            tab.page.get_by_text(STRIKE).first.wait_for()
    assert "color.json" in taken


@pytest.mark.large
def test_the_page_talks_to_no_other_server_whatever_its_address_asks_for(browser, studio):
    with socket.create_server(("127.0.0.1", 0)) as elsewhere:
        elsewhere.setblocking(False)
        page = browser.new_page()
        page.add_init_script(CHEAP)
        page.goto(f"{studio.url}/?playbackPath=http://127.0.0.1:{elsewhere.getsockname()[1]}/x")
        page.locator("canvas").first.wait_for()
        page.wait_for_timeout(2000)  # it would have called by then
        with pytest.raises(BlockingIOError):
            elsewhere.accept()
        page.close()
