"""Scripts that build an atlas in processes of their own, to be killed."""

import subprocess
import sys
import textwrap
from pathlib import Path

SCRIPT = """
    import os
    import signal
    import sys
    from pathlib import Path
    import numpy as np
    from softreach import describe, designs
    from softreach.atlas import DesignSpace, build_atlas
    from softreach.atlas import build as building

    def build(store, n=3_000, alpha_over_length=0.3, accuracy=0.2, **options):
        turns, tapers = np.radians([0, 36, 72, 108]), np.radians([0, 1, 2, 3])
        space = DesignSpace.grid(designs.minimal_trunk(), revolution=turns, taper=tapers)
        return build_atlas(
            space, store, n, 1, alpha_over_length=alpha_over_length, accuracy=accuracy, **options
        )

    def die():
        os.kill(os.getpid(), signal.SIGKILL)
"""

scope: dict = {}
exec(textwrap.dedent(SCRIPT), scope)
build16 = scope["build"]


def run_script(folder: Path, body: str, *arguments: str) -> subprocess.Popen:
    script = folder / "task.py"
    script.write_text(textwrap.dedent(SCRIPT) + "\n" + textwrap.dedent(body))
    command = [sys.executable, "-W", "error", str(script), *arguments]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen) -> tuple[None, str]:
    """What a script says until its end, which must come."""
    try:
        return process.communicate(timeout=1200.0)  # seconds, on a loaded machine
    finally:
        process.kill()


def stored_files(place: Path) -> dict[str, bytes]:
    """What a store holds, without what killed writers left."""
    files = (file for file in place.rglob("*") if file.is_file() and file.suffix != ".partial")
    return {str(file.relative_to(place)): file.read_bytes() for file in files}
