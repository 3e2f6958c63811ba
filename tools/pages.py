"""The Python of each page of the documentation as a module, for type checkers: `build/pages`."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
FOLDER = ROOT / "build" / "pages"
_FENCE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
_COMPILED = re.compile(r"^import mujoco$", re.MULTILINE)  # whose names no type checker sees
_UNSEEN = (  # nor those of PyElastica on the same page, whose classes do not fit together
    "# pyright: reportAttributeAccessIssue=false, reportPrivateImportUsage=false, "
    "reportIncompatibleMethodOverride=false\n"
)
_FILE = re.compile(r"# (\w+\.py)\n")


def write_modules() -> None:
    """Write the fences of a page in one module; one that names a file is that file."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    for page in PAGES:
        together = []
        for fence in _FENCE.findall(page.read_text("utf-8")):
            if named := _FILE.match(fence):
                (FOLDER / named[1]).write_text(fence, "utf-8")
            elif not fence.startswith("# not executed"):
                together.append(fence)
        module = f"{page.stem.replace('-', '_').lower()}_page.py"
        text = "\n".join(together)
        head = _UNSEEN if _COMPILED.search(text) else ""
        (FOLDER / module).write_text(head + text, "utf-8")


if __name__ == "__main__":
    write_modules()
