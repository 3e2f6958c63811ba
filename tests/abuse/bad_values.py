"""What users pass by mistake or in malice, by what is asked of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

__all__ = ["BAD", "without"]

Values = Mapping[str, object]


class Hostile:
    """Can neither be shown nor compared nor counted."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no comparison")

    def __bool__(self) -> bool:
        raise RuntimeError("no truth")

    __hash__ = object.__hash__


def generator() -> Iterator[float]:
    """One that never ends."""
    while True:
        yield 0.0


STRANGERS: Values = {
    "none": None,
    "text": "abc",
    "bytes": b"abc",
    "a dictionary": {"a": 1},
    "a set": {1.0},
    "an object": object(),
    "a hostile object": Hostile(),
    "a class": dict,
    "a generator": generator(),
    "a function": len,
    "a complex number": 1j,
    "a date": np.datetime64("2026-01-01"),
}
"""Right for hardly anything."""

SCALARS: Values = {
    **STRANGERS,
    "a numeric text": "1",
    "true": True,
    "NaN": np.nan,
    "infinity": np.inf,
    "minus infinity": -np.inf,
    "a number of 400 digits": 10**400,
    "a number of 5000 digits": 10**5000,
    "a list": [1.0],
    "an array": np.ones(2),
    "a boolean of NumPy": np.True_,
    "a duration": np.timedelta64(1, "s"),
    "a masked number": np.ma.masked,
}

WHOLE: Values = {**SCALARS, "a fraction": 1.5, "a whole float": 1.0, "below zero": -1}

ARRAYS: Values = {
    **STRANGERS,
    "numeric texts": [["1", "2", "3"]],
    "ragged rows": [[1.0, 2.0, 3.0], [1.0]],
    "truth values": np.zeros((1, 3), bool),
    "a truth value among numbers": [[True, 0.5, 0.5]],
    "complex numbers": np.zeros((1, 3), complex),
    "dates": np.zeros((1, 3), "datetime64[s]"),
    "durations": np.zeros((1, 3), "timedelta64[s]"),
    "texts": np.full((1, 3), "1"),
    "objects": np.full((1, 3), None),
    "numbers of 400 digits": [[10**400, 0, 0]],
    "masked entries": np.ma.masked_equal([[1.0, -1.0, 2.0]], -1.0),
    "seven dimensions": np.zeros((1,) * 7),
    "seven columns": np.zeros((1, 7)),
    "NaN": np.full((1, 3), np.nan),
    "infinity": np.full((1, 3), np.inf),
}

BAD: dict[str, Values] = {
    "arm": {**STRANGERS, "a number": 1.0, "an array": np.ones(3)},
    "dataset": {**STRANGERS, "a number": 1.0, "an array": np.ones((4, 3)), "a list": [1.0]},
    "array": ARRAYS,
    "number": SCALARS,
    "whole number": WHOLE,
    "word": {**STRANGERS, "another word": "nonsense", "a number": 1, "a list": ["front"]},
    "words": {**STRANGERS, "a number": 1, "numbers": [1, 2], "other words": ["nonsense"]},
    "flag": {**STRANGERS, "a number": 1, "an array": np.ones(2, bool)},
    "path": {
        **{name: value for name, value in STRANGERS.items() if name != "text"},
        "a number": 5,
        "nothing": "",
        "a NUL": "a\0b.toml",
    },
    "function": {**STRANGERS, "a number": 5},
    "text": {name: value for name, value in STRANGERS.items() if name != "text"} | {"a number": 5},
    "mapping": {**STRANGERS, "a number": 5, "a list": [1.0]},
}


def without(values: Values, *names: str) -> Values:
    """All but some."""
    return {name: value for name, value in values.items() if name not in names}
