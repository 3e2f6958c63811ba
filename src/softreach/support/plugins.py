"""Code of the user: modules that the command line names, and what installed packages declare.

Nothing else runs code: design files and stores name kinds and metrics, never modules.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

from softreach.support.errors import InvalidInput

__all__ = [
    "ACTUATORS",
    "METRICS",
    "PROFILES",
    "declared",
    "import_module",
    "imported",
    "importing",
    "loaded",
]

ACTUATORS, PROFILES, METRICS = (
    f"softreach.{each}" for each in ("actuators", "profiles", "metrics")
)
"""Groups of entry points: the name of a class, or of a metric, and where it is."""

_A_MODULE = "a module that Python finds, or the path of a .py file"

_PACKAGE = str(Path(__file__).parents[1])

_imported: dict[str, ModuleType] = {}
"""Modules that `import_module` has imported by their name, in their order."""


def import_module(name: str) -> ModuleType:
    """Import a module of the user, by its name or from its file.

    A file is known by its name without .py, so that stores can name what is in it.

    Raises:
        InvalidInput: There is no such module, it fails, or another one has its name.
    """
    is_file = name.endswith(".py") or "/" in name or os.sep in name
    try:
        module = _from_file(name) if is_file else importlib.import_module(name)
    except InvalidInput:
        raise
    except (Exception, SystemExit) as error:
        if not is_file and _is_missing(error, name):
            hint = f"did you mean {name}.py?" if Path(f"{name}.py").is_file() else ""
            raise InvalidInput("import", name or "''", _A_MODULE, hint) from None
        raise InvalidInput(
            "import", name, "a module that can be imported", _cause(error)
        ) from error
    _imported[module.__name__] = module
    return module


@contextmanager
def importing(names: Iterable[str]) -> Iterator[None]:
    """A block for which modules of the user are imported, and known by their names.

    Raises:
        InvalidInput: As `import_module`.
    """
    try:
        for name in names:
            import_module(name)
        yield
    finally:
        _imported.clear()


def imported() -> tuple[ModuleType, ...]:
    """Modules that `import_module` has imported, in their order."""
    return tuple(_imported.values())


def declared(group: str) -> dict[str, EntryPoint]:
    """Entry points of installed packages in a group, by name; none is imported."""
    from importlib.metadata import entry_points

    return {entry.name: entry for entry in entry_points(group=group)}


def loaded(entry: EntryPoint) -> Any:
    """Object behind an entry point of an installed package.

    Raises:
        InvalidInput: It cannot be imported.
    """
    try:
        return entry.load()
    except (Exception, SystemExit) as error:
        package = f" of {entry.dist.name}" if entry.dist else ""
        name = f"entry point {entry.name}{package}"
        raise InvalidInput(
            name, entry.value, "a module that can be imported", _cause(error)
        ) from error


def _from_file(name: str) -> ModuleType:
    path = Path(name).resolve()
    if path.suffix != ".py" or not path.is_file():
        raise InvalidInput("import", name, "the path of a .py file that exists")
    stem = path.stem
    if not stem.isidentifier():
        raise InvalidInput("import", name, "a file whose name is letters, digits and underscores")
    module = sys.modules.get(stem)
    known = importlib.util.find_spec(stem) if module is None else module
    place = getattr(known, "origin" if module is None else "__file__", None)
    if known is not None and (place is None or Path(place).resolve() != path):
        allowed = f"a file of another name, as there is a module {stem} already"
        raise InvalidInput("import", name, allowed, "rename it")
    if module is not None:
        return module
    spec = importlib.util.spec_from_file_location(stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[stem] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[stem]
        raise
    return module


def _is_missing(error: BaseException, name: str) -> bool:
    """True if the module itself is not there, and not one that it imports."""
    if not all(part.isidentifier() for part in name.split(".")):
        return True
    missing = error.name if isinstance(error, ModuleNotFoundError) else None
    return missing is not None and f"{name}.".startswith(f"{missing}.")


def _cause(error: BaseException) -> str:
    """The error in one line, with the line of the user's code that led to it."""
    steps = [
        step
        for step in traceback.extract_tb(error.__traceback__)
        if not step.filename.startswith(("<", _PACKAGE))
    ]
    place = f" ({Path(steps[-1].filename).name}, line {steps[-1].lineno})" if steps else ""
    said = "; ".join(str(error).splitlines())
    text = f"{type(error).__name__}: {said}" if said else type(error).__name__
    return text if isinstance(error, SyntaxError) else f"{text}{place}"
