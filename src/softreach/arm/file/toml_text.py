"""Values and keys as TOML writes them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any

__all__ = ["inline_table", "key_text", "value_text"]


def value_text(value: Any) -> str:
    """Text, numbers, truth values and sequences of them as JSON, which is TOML but for a character.

    Raises:
        TypeError: Another kind of value.
        ValueError: A number that is not finite.
    """
    if not _is_plain(value):
        raise TypeError(f"{type(value).__name__} has no text in TOML")
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")


def _is_plain(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return all(_is_plain(item) for item in value)
    return isinstance(value, str | int | float)


def key_text(name: str) -> str:
    """A key, in quotes where it needs them."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else value_text(name)


def inline_table(pairs: Iterable[tuple[str, str]]) -> str:
    """A table on one line from keys and texts of values."""
    inside = ", ".join(f"{key} = {text}" for key, text in pairs)
    return f"{{ {inside} }}" if inside else "{}"
