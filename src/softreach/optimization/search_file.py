"""Searches as people write them: a file of requirements with a table `[search]`, units in keys."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Written, unknown_parameter
from softreach.optimization.free_parameters import NAMED_CHOICES, free_parameters, known_parameters
from softreach.optimization.problem import goals, known_objective
from softreach.optimization.study import SAMPLERS
from softreach.requirements.requirements import Requirements
from softreach.support.arguments import as_flag, as_integer, as_number, as_one_of
from softreach.support.errors import InvalidDesign, InvalidInput, did_you_mean
from softreach.support.files.toml import WRONG, FaultReader, tables_of
from softreach.workspace.reach import ACCURACIES

_OPTIONS: Mapping[str, Callable[[str, Any], Any]] = {
    "designs": lambda name, value: as_integer(name, value, 1, 1_000_000),
    "seed": lambda name, value: as_integer(name, value, 0, 2**31),
    "accuracy": lambda name, value: as_number(name, value, ACCURACIES),
    "sampler": lambda name, value: as_one_of(name, value, SAMPLERS),
    "polish": as_flag,
}
_SENSES = ("maximize", "minimize")
_TABLES = ("free", "choices")
_KEYS = ("design", *_SENSES, *_OPTIONS, *_TABLES)


def read_search(
    text: str,
    folder: Path,
    design_from: Callable[[str], Manipulator],
    source: str = "",
) -> dict[str, Any]:
    """Arguments of `search` from the text of a file: requirements and a table `[search]`.

    docs/search.md explains the table; paths in it start from `folder`. All faults are named at
    once, of the requirements too, in the words of the file.
    """
    try:
        document = tables_of(text)
    except ValueError:
        document = {}  # for which the requirements are refused
    reader = _Reader(document)
    bases = reader.bases(folder, design_from)
    if bases:
        reader.parameters(bases)
    lengths = {arm.length for arm in bases.values()}
    alike = len(lengths) == 1 and "length" not in {*reader.free, *reader.choices}
    needs, faults, length = None, (), lengths.pop() if alike else None
    try:
        needs = Requirements.from_toml(text, folder=folder, length=length, source=source)
    except InvalidDesign as error:
        faults = error.faults
    options = reader.options(needs)
    if needs is None or reader.faults:
        raise InvalidDesign([*faults, *reader.faults], source)
    base = bases if len(bases) > 1 else next(iter(bases.values()))
    of_file = {"requirements": needs, "free": reader.free, "choices": reader.choices}
    return {"base": base, **of_file, **options}


class _Reader(FaultReader):
    def __init__(self, document: Mapping[str, Any]) -> None:
        super().__init__()
        self.free: dict[str, Any] = {}
        self.choices: dict[str, Any] = {}
        self._raw = self._table(document, "search")
        self._check_keys(self._raw, "search", _KEYS)
        self._raw |= {key: self._table(self._raw, key, "search.") for key in _TABLES}

    def bases(self, folder: Path, load: Callable[[str], Manipulator]) -> dict[str, Manipulator]:
        """Designs to vary by what they are called; none where none can be read."""
        path, value = "search.design", self._raw.get("design")
        names = [value] if isinstance(value, str) else value
        if not isinstance(names, list | tuple) or not all(isinstance(x, str) for x in names):
            self._refuse(path, value, "must be a design file, a named design, or a list of these")
            return {}
        if not names or len({*names}) < len(names):
            self._refuse(path, value, "must be different designs, one or more")
        bases = {}
        for name in names:
            place = str(folder / name) if (folder / name).is_file() else name
            bases[name] = self._tried(path, name, partial(load, place))
        return {name: arm for name, arm in bases.items() if arm is not WRONG}

    def parameters(self, bases: Mapping[str, Manipulator]) -> None:
        """Read choices, ranges and ties, each judged as `search` does."""
        self._bases = dict(bases)
        choices, ties = self._entries("choices"), []
        for path, key, value in choices:
            if key in NAMED_CHOICES:
                self._add(path, value, self.choices, key, value)
        names = Written(known_parameters(bases.values(), self.choices.get("bundles", ())))
        for path, key, value in choices:
            if key not in NAMED_CHOICES:
                self._add_numbers(path, value, self.choices, names, key)
        for path, key, value in self._entries("free"):
            if key in names.by_key and isinstance(value, str):
                ties.append((path, value, self.free, names.by_key[key].name, value))
            else:
                self._add_numbers(path, value, self.free, names, key)
        if not (self.free or self.choices or len(bases) > 1 or self.faults):
            allowed = "needs one parameter or more with a range, or choices: taper_deg = [0, 3]"
            self._refuse("search.free", None, allowed)
        for tie in ties:
            self._add(*tie)

    def options(self, needs: Requirements | None) -> dict[str, Any]:
        options: dict[str, Any] = {word: self._objectives(word) for word in _SENSES}
        for name, convert in _OPTIONS.items():
            if (value := self._raw.get(name)) is not None:
                make = partial(convert, name, value)
                options[name] = self._tried(f"search.{name}", value, make)
        if needs is not None and not self.faults:
            try:
                goals(options["maximize"], options["minimize"], needs)
            except InvalidInput as error:
                word = next((word for word in _SENSES if error.value in options[word]), "maximize")
                self._refuse(f"search.{word}", error.value, f"must be {error.allowed}")
        return options

    def _objectives(self, word: str) -> list[str]:
        path, value = f"search.{word}", self._raw.get(word)
        names = [] if value is None else [value] if isinstance(value, str) else value
        if not isinstance(names, list | tuple):
            self._refuse(path, value, "must be an objective, or a list of them")
            return []
        for name in names:
            self._tried(path, name, partial(known_objective, word, name))
        return list(names)

    def _entries(self, table: str) -> list[tuple[str, str, Any]]:
        """Path in errors, key and value of each row of a table."""
        rows = _flat_keys(self._raw[table])
        return [(f"search.{table}.{key}", key, value) for key, value in rows]

    def _add_numbers(
        self, path: str, values: Any, table: dict[str, Any], names: Written, key: str
    ) -> Any:
        if key not in names.by_key:
            hint = did_you_mean(key, names.by_key, 0.5)
            allowed = unknown_parameter(key, names.written).allowed
            text = f"is not a parameter; {hint or f'must be {allowed}'}"
            return self._refuse(path, None, text)
        if not isinstance(values, list | tuple):
            return self._refuse(path, values, "must be a list of numbers")
        parameter, numbers = names.by_key[key], []
        for value in values:
            try:
                numbers.append(names.number(key, value))
            except ValueError:
                shown = values if isinstance(values[0], int | float) else value
                return self._refuse(path, shown, f"must be {names.allowed(key)}")
        allowed = parameter.range._replace(whole=False)
        if wrong := [value for value in numbers if not allowed.admits(value)]:
            shown = allowed.in_degrees() if parameter.unit == "rad" else allowed
            return self._refuse(path, values[numbers.index(wrong[0])], f"must be {shown.text}")
        return self._add(path, values, table, parameter.name, tuple(numbers))

    def _add(self, path: str, given: Any, table: dict[str, Any], name: str, value: Any) -> None:
        """Take the value of a parameter, the first of its name, if a search may have it."""
        if name in table:
            self._refuse(path, None, "is given twice")
            return
        of_free = {**self.free, name: value} if table is self.free else {}
        choices = {**self.choices, name: value} if table is self.choices else self.choices
        make = partial(free_parameters, self._bases, of_free, choices)
        if self._tried(path, given, make) is not WRONG:
            table[name] = value


def _flat_keys(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Keys and values; TOML reads the dots of unquoted keys as tables within tables."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat_keys(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value
