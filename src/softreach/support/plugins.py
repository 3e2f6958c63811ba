"""Code of the user: modules that the command line names, and what installed packages declare.

Nothing else runs code: design files and stores name kinds and metrics, never modules.
"""

import importlib
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import softreach
from softreach.support.errors import InvalidInput

# Groups of entry points: the name of a class, or of a metric, and where it is.
ACTUATORS, PROFILES, METRICS = "softreach.actuators", "softreach.profiles", "softreach.metrics"

_imported: list[ModuleType] = []


@contextmanager
def importing(names: Iterable[str]) -> Iterator[None]:
    """A block for which modules of the user are imported, by their names or from .py files."""
    before = sys.path.copy()
    try:
        _imported.extend(map(_import, names))
        yield
    finally:
        _imported.clear()
        sys.path[:] = before


def _import(name: str) -> ModuleType:
    path = Path(name).resolve() if name.endswith(".py") else None
    if path is not None:
        if not path.is_file():
            raise InvalidInput("import", name, "the path of a .py file that exists")
        sys.path.append(str(path.parent))
    importlib.invalidate_caches()
    module = _tried("import", name, lambda: importlib.import_module(path.stem if path else name))
    if path is not None and Path(module.__file__ or "").resolve() != path:
        raise InvalidInput("import", name, "a file whose name no other module has")
    return module


def imported() -> tuple[ModuleType, ...]:
    """Modules that the user named, in their order."""
    return tuple(_imported)


def declared(group: str) -> dict[str, EntryPoint]:
    """Entry points of installed packages in a group, by name; none is imported."""
    return {entry.name: entry for entry in entry_points(group=group)}


def loaded(entry: EntryPoint) -> Any:
    """Object behind an entry point of an installed package."""
    return _tried(f"entry point {entry.name}", entry.value, entry.load)


def _tried(name: str, value: str, load: Callable[[], Any]) -> Any:
    """What is loaded; an error of the user's code is refused with its line."""
    try:
        return load()
    except (Exception, SystemExit) as error:
        files = (softreach.__file__, importlib.__file__)
        others = ("<", *(str(Path(file).parent) for file in files))
        steps = traceback.extract_tb(error.__traceback__)
        own = [step for step in steps if not step.filename.startswith(others)]
        place = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
        said = f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
        allowed = "a module that can be imported"
        raise InvalidInput(name, value or "''", allowed, said + place) from error
