"""Free numbers of a calibration: parameters of the design, the pose of its base, what is tied."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any, Self

import numpy as np

from softreach.arm.base import Base, rotation_matrices
from softreach.arm.body import RestShape
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter, find_parameters, parameters, parts, with_values
from softreach.support.arguments import as_mapping, as_names, as_one_of, plain
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput, Range

POSE = ("pose.x", "pose.y", "pose.z", "pose.rx", "pose.ry", "pose.rz")
"""Place of the base [m], and its rotation beyond that of the design as a rotation vector [rad]."""

SCALE = "scale"  # Lengths of the data over those of the arm: of a camera without a scale

_PLACES = ("station", "start", "end")  # Numbers in m that lie on the arm
_UNFIT = re.compile(r"(.*\.)?(lower|upper)(\[\d+\])?|base\..*|loads\.(follower|tip_moment).*")
"""Numbers that no wildcard frees: bounds, what the pose frees, loads without a derivative."""
_UNSEEN = 1e-12  # angle by which an arm that counts as bent is bent at least [rad]
_STEP = 1e-3  # of the scale of a number, for derivatives of tables of fourth order
_CENTRAL = ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12))
_FORWARD = ((0, -25 / 12), (1, 48 / 12), (2, -36 / 12), (3, 16 / 12), (4, -3 / 12))

Neighbors = list[tuple[float, Manipulator | Base | float]]
"""Arms around one, their bases or scales of data alone, with the factors of a derivative."""


@dataclass(frozen=True)
class FreeNumber:
    """A number that a fit may change."""

    name: str  # Path of a parameter, one of the six of the pose, or paths tied by "="
    unit: str  # SI unit; "1" for none
    start: float  # Value of the design
    range: Range  # Values that it may have
    scale: float  # A change that matters
    prior: tuple[float, float] | None = None  # Mean and width of what is known before


@dataclass(frozen=True, eq=False)
class FreeNumbers:
    """All free numbers of an arm, and the arm with other values of them."""

    arm: Manipulator
    numbers: tuple[FreeNumber, ...]

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(number.name for number in self.numbers)

    @property
    def start(self) -> Array:
        """Their values on the design."""
        return np.array([number.start for number in self.numbers])

    @property
    def scale(self) -> Array:
        """Changes that matter."""
        return np.array([number.scale for number in self.numbers])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest values; those that are excluded by a hair."""
        low = [n.range.low + 1e-6 * n.scale * n.range.open_low for n in self.numbers]
        high = [n.range.high - 1e-6 * n.scale * n.range.open_high for n in self.numbers]
        return np.array(low), np.array(high)

    def made(self, values: Array) -> Manipulator:
        """The arm with these values; raises InvalidDesign if there is none."""
        given = dict(zip(self.names, values.tolist(), strict=True))
        pose = {name: value for name, value in given.items() if name in POSE}
        paths = {path: value for name, value in given.items() for path in _tied(name)}
        arm = with_values(self.arm, {each: paths[x] for x, each in self._parameters.items()})
        return arm.replace(base=_moved(arm.base, pose)) if pose else arm

    @cached_property
    def _parameters(self) -> dict[str, Parameter]:
        names = [number.name for number in self.numbers if number.name not in (*POSE, SCALE)]
        return find_parameters(self.arm, tuple(path for name in names for path in _tied(name)))

    def scaled(self, values: Array) -> float:
        """Lengths of the data over those of the arm at these values, 1 unless that is free."""
        return float(values[self.names.index(SCALE)]) if SCALE in self.names else 1.0

    def neighbors(self, values: Array, k: int) -> Neighbors:
        """Arms around these values along one number, with the factors of a derivative by it.

        Differences of fourth order, inside the range of the number; of a number of the pose the
        bases alone, of the scale its values.
        """
        number, value, (low, high) = self.numbers[k], float(values[k]), self.bounds
        step, points = _STEP * max(number.scale, abs(value)), _CENTRAL
        if value - 2 * step < low[k]:
            points = _FORWARD
        elif value + 2 * step > high[k]:
            points, step = _FORWARD, -step
        result: Neighbors = []
        for offset, factor in points:
            other = values.copy()
            other[k] = value + offset * step
            if number.name == SCALE:
                made = float(other[k])
            elif number.name in POSE:
                made = _moved(self.arm.base, dict(zip(self.names, other.tolist(), strict=True)))
            else:
                made = self.made(other)
            result.append((factor / step, made))
        return result

    def started_at(self, values: Mapping[str, float]) -> Self:
        """The same with other values to start from."""
        numbers = (replace(n, start=float(values.get(n.name, n.start))) for n in self.numbers)
        return replace(self, numbers=tuple(numbers))


def free_numbers(
    arm: Manipulator, free: Sequence[str], prior: Mapping[str, Any] | None = None
) -> FreeNumbers:
    """Free numbers by their names, with "pose.position" and "pose.rotation" for parts of a pose."""
    given = as_names("free", free)
    if arm.rest.is_straight and any("rest." in name for name in given):
        # All arms on the way have a rest shape, were it of the size of rounding.
        arm = arm.replace(rest=RestShape(curvature_x=_UNSEEN / arm.length))
    priors = {} if prior is None else as_mapping("prior", prior, lambda _, value: value)
    each = ((number, priors.pop(number.name, None)) for number in _each(arm, given))
    numbers = tuple(replace(number, prior=_prior(number, known)) for number, known in each)
    names = [number.name for number in numbers]
    if priors:
        raise InvalidInput("prior", next(iter(priors)), f"a free number: {', '.join(names)}")
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInput("free", twice[0], "given once")
    if not numbers:
        raise InvalidInput("free", "none", "the name of one or more")
    return FreeNumbers(arm, numbers)


def _each(arm: Manipulator, free: tuple[str, ...]) -> Iterator[FreeNumber]:
    for name in free:
        if name == "pose" or name.startswith("pose."):
            kinds = {"pose": POSE, "pose.position": POSE[:3], "pose.rotation": POSE[3:]}
            for each in kinds.get(as_one_of("free", name, [*kinds, *POSE]), (name,)):
                axis = POSE.index(each)
                start = arm.base.position[axis] if axis < 3 else 0.0
                unit, scale = ("m", 1e-2 * arm.length) if axis < 3 else ("rad", 0.02)
                yield FreeNumber(each, unit, start, Range(unit=unit), scale)
        elif name == SCALE:
            yield FreeNumber(SCALE, "1", 1.0, Range(1e-3, 1e3), 0.02)
        elif "*" in name:
            known = parameters(arm)
            hits = [key for key in known if fnmatchcase(key, name.replace("[", "[[]"))]
            if not hits:
                find_parameters(arm, (name,))
            for hit in _once(arm, known, hits) or hits:
                number = _of_parameters(arm, hit)
                alone = FreeNumbers(arm, (number,))
                try:
                    alone.neighbors(alone.start, 0)
                except InvalidDesign:  # others fix it, such as the outermost outer ratio
                    continue
                yield number
        else:
            yield _of_parameters(arm, name)


def _once(arm: Manipulator, known: Mapping[str, Parameter], names: Sequence[str]) -> list[str]:
    """Names of numbers that a fit may change, one of each number."""
    kept = [name for name in names if not known[name].whole and not _UNFIT.fullmatch(name)]
    own = {name: each for name in kept if (each := known[name]).part}
    twins = {name.partition(".values[")[0] for name in own if ".values[" in name}
    twins |= {name for name in own if f"{name}_over_length" in own}
    for name, parameter in own.items():
        part = parts(arm).get(parameter.part or ())
        value = getattr(part, parameter.number.field, 0.0)
        if parameter.number.each:
            of_bundles = {other for other in own if other.startswith(f"{name}[")}
            twins |= {name} if isinstance(value, tuple) else of_bundles
        given = value is not None
        others = f"{name}_ratio", name.replace("revolution", "helical_angle")
        twins |= {(other if given else name) for other in others if other != name and other in own}
    return [name for name in own or kept if name not in twins]


def _tied(name: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in name.split("="))


def _of_parameters(arm: Manipulator, name: str) -> FreeNumber:
    paths = _tied(name)
    name = " = ".join(paths)
    if base := [path for path in paths if path.startswith("base.")]:
        allowed = "a number of the body: the base is free by pose, pose.position or pose.rotation"
        raise InvalidInput("free", base[0], allowed)
    known = find_parameters(arm, paths)
    first = known[paths[0]]
    if first.whole:
        raise InvalidInput("free", name, "a number that can change a little, not a count")
    if len({parameter.unit for parameter in known.values()}) > 1:
        raise InvalidInput("free", name, "tied to numbers of the same unit")
    values = [value for p in known.values() for value in p.values(arm) if math.isfinite(value)]
    # A size of numbers in the unit, for those that are zero.
    pairs = zip(arm.bounds, arm.bundle_units, strict=True)
    pulls = [abs(bound) for bounds, own in pairs if own == first.unit for bound in bounds]
    sizes = {"m": float(arm.profile.radius(0.0)), "1/m": 1.0 / arm.length, "kg": 0.01}
    sizes |= {"kg/m³": 1000.0} | dict.fromkeys(("N", "Pa"), max([*pulls, 1e-3]))
    typical, allowed = sizes.get(first.unit, 1.0), first.range
    start = float(np.mean(values)) if values else typical
    if paths[0].rpartition(".")[2] in _PLACES:
        allowed = allowed._replace(high=arm.length)
    return FreeNumber(name, first.unit, start, allowed, max(0.1 * abs(start), 1e-2 * typical))


def _moved(base: Base, pose: Mapping[str, float]) -> Base:
    """The base at another place, and turned in the world about its own place."""
    place = [pose.get(name, at) for name, at in zip(POSE[:3], base.position, strict=True)]
    vector = np.array([pose.get(name, 0.0) for name in POSE[3:]])
    half = 0.5 * float(np.linalg.norm(vector))
    quaternion = np.append(np.cos(half), 0.5 * np.sinc(half / np.pi) * vector)
    turned = rotation_matrices(quaternion) @ base.rotation
    return Base(position=tuple(place), points=turned)  # pyright: ignore[reportArgumentType]


def _prior(number: FreeNumber, given: Any) -> tuple[float, float] | None:
    if given is None:
        return None
    try:
        values = np.ravel(np.asarray(plain(given), float))
    except (TypeError, ValueError):
        values = np.zeros(0)
    mean, width = values if len(values) == 2 else (number.start, values[0] if len(values) else 0.0)
    if len(values) > 2 or not (0 < width < math.inf and math.isfinite(mean)):
        raise InvalidInput(f"prior of {number.name}", given, "a width above 0, or (mean, width)")
    return float(mean), float(width)
