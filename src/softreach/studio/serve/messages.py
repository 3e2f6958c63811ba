"""Messages of pages: which of them a page of ours may have sent.

viser takes whatever a socket says for what a person did; each value that it cannot use would be a
traceback of a page that nobody has.
"""

from __future__ import annotations

import math
from typing import Any

__all__ = ["LARGEST_UPLOAD", "is_choice", "is_message"]

LARGEST_UPLOAD = 20_000_000
"""Bytes of a file that is taken up at all, to be judged by whoever asked for it."""


def is_message(raw: object) -> bool:
    """True for bytes that viser reads as one of its messages, with numbers that are finite."""
    import msgspec
    from viser._messages import Message

    try:
        assert isinstance(raw, bytes)
        content = msgspec.msgpack.decode(raw)
        kinds = {kind.__name__: kind for kind in Message.get_subclasses()}
        kind = kinds[content.pop("type")]
        return _is_finite(content) and _has_types(content, kind)
    except Exception:
        return False


def _has_types(content: dict[str, Any], kind: type) -> bool:
    import msgspec

    whole = {k: int(v) if isinstance(v, float) else v for k, v in content.items()}
    for candidate in (content, whole):  # pages send numbers of pixels with fractions
        try:
            msgspec.convert(candidate, kind)
        except msgspec.ValidationError:
            continue
        return True
    return False


def is_choice(value: object, present: object, options: object) -> bool:
    """True if a widget that holds a value may come to hold another.

    Args:
        value: The other.
        present: What it holds.
        options: Those that it offers, if it offers any.
    """
    if isinstance(present, bool):
        return isinstance(value, bool)
    if isinstance(present, int):
        return _is_number(value) and float(value) == int(value)  # pyright: ignore
    if isinstance(present, float):
        return _is_number(value)
    if isinstance(present, str):
        return isinstance(value, str) and (not options or value in tuple(options))  # pyright: ignore
    if isinstance(present, tuple) and type(present) is tuple:
        return (
            isinstance(value, list | tuple)
            and len(value) == len(present)
            and all(is_choice(new, old, None) for new, old in zip(value, present, strict=True))
        )
    return False  # such as a file, which comes in parts


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_finite(content: Any) -> bool:
    if isinstance(content, float):
        return math.isfinite(content)
    if isinstance(content, int):
        return abs(content) < 1 << 63
    if isinstance(content, dict):
        return all(isinstance(key, str) and _is_finite(part) for key, part in content.items())
    return not isinstance(content, list) or all(map(_is_finite, content))
