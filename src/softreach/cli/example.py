"""`softreach example`: the files of an example, written where you are."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import softreach
from softreach.cli.console import console
from softreach.cli.options import OUT, Overwrite
from softreach.support.errors import InvalidInput

_FILES = {
    "tentacle": ("tentacle.toml", "tentacle.csv"),
    "three_fibers": ("three_fibers.toml", "five_places.toml"),
    "tendon_arm": ("tendon_arm.toml", "tendon_arm.sh", "requirement_check.py"),
    "spine": ("spine.toml", "magnets.py", "own_actuator.sh"),
}


def example(
    name: str, /, *, out: Annotated[Path, OUT] = Path(), overwrite: Overwrite = False
) -> None:
    """Write an example here: a design and the data and scripts that go with it.

    softreach list examples prints their names. Designs of the gallery are examples
    of one file.

    Example: softreach example tentacle

    Args:
        name: Name of the example.
        out: Folder for the files: this one if left out.
    """
    from softreach.support.files.atomic import check_place, writing

    if name not in (known := examples()):
        raise InvalidInput("example", name, f"one of {', '.join(known)}")
    for file in known[name]:
        check_place(out / file.name, overwrite=overwrite)
    out.mkdir(parents=True, exist_ok=True)
    for file in known[name]:
        with writing(out / file.name, overwrite=overwrite) as stream:
            stream.write(file.read_bytes())
        console.line(out / file.name)


def examples() -> dict[str, tuple[Path, ...]]:
    """The files of each example by its name."""
    known = {
        name: tuple(_folder("examples") / file for file in files) for name, files in _FILES.items()
    }
    return known | {file.stem: (file,) for file in sorted(_folder("designs").glob("*.toml"))}


def _folder(name: str) -> Path:
    """Folder in the installed package, or at the root of a clone."""
    package = Path(softreach.__file__).parent
    return package / name if (package / name).is_dir() else package.parents[1] / name
