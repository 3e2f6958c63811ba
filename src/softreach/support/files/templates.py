"""Templates of HTML pages that lie beside the modules that fill them in."""

from __future__ import annotations

import base64
from importlib.resources import files
from typing import Any

from softreach.support.errors import MissingExtra

__all__ = ["page_template", "png_source"]


def page_template(package: str, name: str) -> Any:
    """A page to be filled, everything in it escaped.

    Args:
        package: Package that it lies in.
        name: Name of the file.

    Raises:
        MissingExtra: Jinja2 is not installed.
    """
    try:
        from jinja2 import Environment, StrictUndefined
    except ModuleNotFoundError as error:
        raise MissingExtra(("jinja2", "paper")) from error
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    return environment.from_string(files(package).joinpath(name).read_text(encoding="utf-8"))


def png_source(image: bytes) -> str:
    """Source of a PNG picture inside a page."""
    return f"data:image/png;base64,{base64.b64encode(image).decode('ascii')}"
