"""Code of the user: modules that the command line names.

Nothing else runs code: design files and stores name kinds and metrics, never modules.
"""

import importlib
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import softreach
from softreach.support.errors import InvalidInput

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
    """The module; an error of the user's code is refused with its line."""
    path = Path(name).resolve() if name.endswith(".py") else None
    if path is not None:
        if not path.is_file():
            raise InvalidInput("import", name, "the path of a .py file that exists")
        sys.path.append(str(path.parent))
    importlib.invalidate_caches()
    try:
        module = importlib.import_module(path.stem if path else name)
    except (Exception, SystemExit) as error:
        files = (softreach.__file__, importlib.__file__)
        others = ("<", *(str(Path(file).parent) for file in files))
        steps = traceback.extract_tb(error.__traceback__)
        own = [step for step in steps if not step.filename.startswith(others)]
        place = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
        said = f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
        allowed = "a module that can be imported"
        raise InvalidInput("import", name or "''", allowed, said + place) from error
    if path is not None and Path(module.__file__ or "").resolve() != path:
        raise InvalidInput("import", name, "a file whose name no other module has")
    return module


def imported() -> tuple[ModuleType, ...]:
    """Modules that the user named, in their order."""
    return tuple(_imported)
