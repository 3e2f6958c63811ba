"""Looks for faults of accessibility in every tab of the studio by axe-core, in a real browser.

`python -m tools.studio_axe axe.min.js` prints what is serious or critical, with light and dark
pages, in the windows of a laptop and a phone, and ends with 1 if there is anything. The file is
not ours: `npm pack axe-core` downloads it, as package/axe.min.js in an archive.
"""

from __future__ import annotations

import sys
from pathlib import Path

from playwright.sync_api import sync_playwright
from tests.browser import CHROMIUM, FLAGS
from tests.studio.tab import Tab

from softreach.arm import designs
from softreach.studio import Studio
from softreach.studio.start import start_on_design

SIZES = {"laptop": (1366, 768), "phone": (390, 844)}
GRAVE = """async () => {
    const result = await axe.run(document, {resultTypes: ["violations"]});
    return result.violations
        .filter(rule => ["serious", "critical"].includes(rule.impact))
        .flatMap(rule => rule.nodes.map(node => [rule.impact, rule.id, node.html.slice(0, 200)]));
}"""


def main() -> None:
    """Open every tab in every window and print its faults, each once."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    faults: dict[tuple[str, ...], list[str]] = {}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        with Studio(start_on_design(designs.minimal_trunk())) as studio:
            for kind, size in SIZES.items():
                tab = Tab(browser, studio, size)
                tab.page.evaluate(Path(sys.argv[1]).read_text("utf-8"))
                furnish(tab)
                for dark in (False, True):
                    tab.session.update(lambda s, dark=dark: s.showing(dark=dark))
                    tab.settle()
                    for name in [each.inner_text() for each in tab.page.get_by_role("tab").all()]:
                        where = f"{kind}, {'dark' if dark else 'light'}, {name}"
                        tab.page.get_by_role("tab", name=name, exact=True).click()
                        tab.page.wait_for_timeout(400)
                        for fault in tab.page.evaluate(GRAVE):
                            faults.setdefault(tuple(fault), []).append(where)
                tab.close()
        browser.close()
    for (impact, rule, html), places in sorted(faults.items()):
        sys.stdout.write(f"{impact} {rule} ({len(places)} views, first {places[0]}): {html}\n")
    sys.stdout.write(f"{len(faults)} faults that are serious or critical\n")
    sys.exit(bool(faults))


def furnish(tab: Tab) -> None:
    """Let every part of the page have something to show."""
    tab.session.update(
        lambda s: s.replace(activation=(-0.7, -0.4, -0.9), target=(0.05, 0.02, 0.15))
    )
    tab.session.update(lambda s: s.showing(section=True, sweep=True))
    tab.settle()
    tab.open("Compare")
    tab.press("Keep this design")
    tab.settle()


if __name__ == "__main__":
    main()
