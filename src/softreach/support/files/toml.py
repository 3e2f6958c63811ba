"""TOML as people write it: its tables with all their faults at once, and values as text."""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from softreach.support.errors import Fault, InvalidDesign, InvalidInput, NotPossible, did_you_mean

WRONG: Any = object()  # In place of a value that has faults


def tables_of(text: str, number: Callable[[str], Any] = float) -> dict[str, Any]:
    """The tables of TOML text, or `ValueError`.

    `number` makes values of numbers with a point or an exponent.
    """
    try:
        return tomllib.loads(text, parse_float=number)
    except RecursionError:
        raise ValueError("lists or tables are nested too deep") from None


def document_of(
    text: str, most: int, source: str, number: Callable[[str], Any] = float
) -> dict[str, Any]:
    """The tables of TOML text of at most so many characters, called `source` in errors."""
    if len(text) > most:
        allowed = f"must be at most {most:,} characters long, and has {len(text):,}"
        raise InvalidDesign([Fault("TOML", None, allowed)], source)
    try:
        return tables_of(text, number)
    except ValueError as error:
        raise InvalidDesign([Fault("TOML", str(error), "must be valid TOML")], source) from None


class FaultReader:
    """Base of readers of tables, which go on after a fault and keep all of them."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def _refuse(self, path: str, value: Any, allowed: str, instead: Any = WRONG) -> Any:
        self.faults.append(Fault(path, value, allowed))
        return instead

    def _tried(self, path: str, value: Any, make: Callable[[], Any]) -> Any:
        """What is made; `WRONG` and a fault if that is refused."""
        try:
            return make()
        except InvalidInput as error:
            return self._refuse(path, value, f"must be {error.allowed}")
        except NotPossible as error:
            return self._refuse(path, value, str(error))

    def _check_keys(
        self, raw: Mapping[str, Any], path: str, shown: Iterable[str], known: Iterable[str] = ()
    ) -> None:
        """Refuse keys of a table that are neither `shown` in errors nor known beside these."""
        names = {name: name for name in shown}
        for key in (key for key in raw if key not in {*names, *known}):
            place = f"{path}.{key_text(key)}".lstrip(".")
            self._refuse(place, raw[key], unknown_key(key, names))

    def _table(self, document: Mapping[str, Any], key: str, path: str = "") -> dict[str, Any]:
        """A table; an empty one if there is none, or something else."""
        raw = document.get(key, {})
        if not isinstance(raw, dict):
            self._refuse(f"{path}{key}", raw, "must be a table")
        return raw if isinstance(raw, dict) else {}

    def _tables(self, raw: Mapping[str, Any], key: str) -> Iterator[tuple[dict[str, Any], str]]:
        tables = raw.get(key, [])
        if not isinstance(tables, list):
            self._refuse(key, tables, f"must be tables: write [[{key}]]")
            return
        for k, table in enumerate(tables):
            if isinstance(table, dict):
                yield table, f"{key}[{k}]"
            else:
                self._refuse(f"{key}[{k}]", table, "must be a table")


def unknown_key(name: str, keys: Mapping[str, str]) -> str:
    """Message for a key that a table does not have; `keys` are those that it has, by field."""
    hint = did_you_mean(keys.get(name, name), keys.values())
    return f"unknown key; {hint or 'known keys: ' + ', '.join(keys.values())}"


def value_text(value: Any) -> str:
    """Text, finite numbers, truth values and sequences of them as JSON, which is TOML."""
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
