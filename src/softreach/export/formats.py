"""From the suffix of a path to the function that writes it, and to the library that this needs."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from softreach.atomic import replacing
from softreach.errors import InvalidInput, MissingExtra

__all__ = ["load_library", "write_by_suffix"]


def write_by_suffix(
    path: str | PathLike[str], writers: Mapping[str, Callable[[Any, Path], None]], content: Any
) -> None:
    """Write the content whole, or leave what was there.

    Raises:
        InvalidInput: No writer for the suffix; the error lists those there are.
        MissingExtra: The format needs a library that is not installed.
    """
    writer = writers.get(Path(path).suffix.lower())
    if writer is None:
        raise InvalidInput("path", fspath(path), "a file name ending in " + ", ".join(writers))
    with replacing(path) as lent:
        writer(content, lent)


def load_library(module: str) -> Any:
    """An optional library, loaded at first use.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        library = module.partition(".")[0]
        if error.name is None or error.name.partition(".")[0] != library:
            raise
        raise MissingExtra(library, "export") from error
