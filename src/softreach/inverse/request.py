"""Request to the inverse problem: targets and preferences, checked."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from softreach.rod.inputs import ActivationBox
from softreach.support.arrays import Array, Index, as_floats, check_finite
from softreach.support.errors import InvalidInput, Range
from softreach.support.quantity import numbers_in, read_quantity, unit_names
from softreach.support.units import TYPED, lengths_in

_HEADER = re.compile(r"[xyz](?:_(m|cm|mm|over_length)|\s*[\[(]\s*([^\])]*?)\s*[\])])")
"""Name of a column with its unit."""

RESIDUALS = Range(1e-13, 1e-2)
"""|tip - target| that can be asked for, in L; below, rounding of the tips decides."""


ANGLE_TOL = 1e-6
"""Error of the tips' directions [rad], by which a direction may miss its cone."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Targets, and which activations to prefer where there is a choice."""

    targets: Array  # wanted positions of the tip [m], (t, 3)
    residual: float  # |tip - target| at which a search has found its target [m]
    reach_tol: float  # |tip - target| at which a target counts as reached [m], `residual` at least
    near: Array  # activations of the free bundles to stay near to [-], (t, dimension)
    direction: Array | None = None  # wanted tip tangents, unit vectors, (t, 3)
    orientation: Array | None = None  # wanted frames, d3 the `direction`, (t, 3, 3)
    cone: float = 0.0  # angle from `direction` or `orientation` that is allowed [rad]
    direction_weight: float = 0.1  # of an angle [rad] against a distance in L
    within: float = 0.0  # |tip - target| that does where no pose meets both to `residual` [m]
    family: int = 1  # activations wanted for each target where there are infinitely many
    seed: int = 0  # seed of the random activations that the others stay near to
    from_rest: bool = False  # True for postures that activations lead to from rest, and no others

    @property
    def direction_tol(self) -> float:
        """Angle at which a direction counts as met [rad]: that of the cone and of rounding."""
        return self.cone + ANGLE_TOL

    def of(self, rows: slice | Index) -> Request:
        """The request for some of the targets."""
        names = ("targets", "near", "direction", "orientation")
        parts = {name: getattr(self, name) for name in names}
        chosen = {name: part[rows] for name, part in parts.items() if part is not None}
        return replace(self, **chosen)


def as_activations(name: str, activations: ArrayLike, box: ActivationBox, count: int) -> Array:
    """Activations (bundles,) or (t, bundles) of all bundles as those of free ones, (t, free)."""
    m, rows = box.bundles, as_floats(name, activations)
    if rows.shape not in ((m,), (count, m)):
        raise InvalidInput(f"{name}.shape", rows.shape, f"of shape ({m},), or ({count}, {m})")
    check_finite(name, rows)
    return np.ascontiguousarray(np.broadcast_to(rows, (count, m))[:, box.free])


def as_rates(rate: ArrayLike | None, count: int) -> Array | None:
    """Rates of all inputs from one positive number or one for each, shape (count,)."""
    if rate is None:
        return None
    rates = as_floats("rate", rate)
    if rates.shape not in ((), (1,), (count,)) or not ((rates > 0) & (rates < np.inf)).all():
        raise InvalidInput("rate", rate, f"one positive number or {count}")
    return np.broadcast_to(rates, count)


def as_orientations(orientation: ArrayLike, count: int) -> Array:
    """Rotation matrices (3, 3) or (t, 3, 3) as (t, 3, 3)."""
    frames = as_floats("orientation", orientation)
    if frames.shape not in ((3, 3), (count, 3, 3)):
        raise InvalidInput("orientation.shape", frames.shape, f"(3, 3) or ({count}, 3, 3)")
    frames = np.broadcast_to(frames, (count, 3, 3))
    square = frames @ frames.transpose(0, 2, 1) - np.eye(3)
    if not (np.abs(square) < 1e-6).all() or not (np.linalg.det(frames) > 0.0).all():
        raise InvalidInput("orientation", frames, "rotation matrices: orthonormal, determinant 1")
    return frames


def positions_in(text: str, source: str, length: float | None = None) -> list[list[float]]:
    """Positions [m] from lines x,y,z; a header is skipped, but for units such as x_mm,y_mm,z_mm.

    Errors name the file by `source`; places in L need a `length` L [m].
    """
    rows = [line for line in text.splitlines() if line.strip()]
    words = [word.strip() for word in rows[0].split(",")] if rows else []
    if words and not any(word.startswith(tuple("+-.0123456789")) for word in words):
        units = [_header_unit(word, rows[0], source) for word in words]
        rows = [_with_units(row, units) for row in rows[1:]]
    if not rows:
        raise InvalidInput("targets", source, "a CSV file with a row x,y,z for each position")
    return [position_in(f"{source}, point {k}", row, length) for k, row in enumerate(rows, 1)]


def position_in(name: str, text: str, length: float | None = None) -> list[float]:
    """One position [m] from x,y,z, each with its unit or all of them in m; in L with a length."""
    values = lengths_in(text, 3, length)
    if values is None:
        units = TYPED if length is None else f"{TYPED}, L"
        allowed = f"three comma-separated numbers x,y,z in m, or each with its unit ({units})"
        raise InvalidInput(name, text or "''", allowed)
    return values


def length_in(name: str, text: str, length: float) -> float:
    """One length [m] from what was typed, 0 or more, with its unit, in m or in a length L."""
    values = lengths_in(text, 1, length)
    if values is None or not 0.0 <= values[0] < np.inf:
        raise InvalidInput(name, text or "''", f"a length in m, or with {TYPED}, L")
    return values[0]


def direction_in(name: str, text: str) -> list[float]:
    """A direction from x,y,z."""
    values = numbers_in(text, 3)
    if values is None or not any(values):
        raise InvalidInput(name, text or "''", "three comma-separated numbers x,y,z, not all 0")
    return values


def angle_in(name: str, text: str) -> float:
    """An angle [rad] from what was typed, from 0 to half a turn, with its unit."""
    with suppress(ValueError):
        if 0.0 <= (angle := read_quantity(text, "rad")) <= np.pi:
            return angle
    raise InvalidInput(name, text or "''", "an angle from 0deg to 180deg, in deg or rad")


def _header_unit(word: str, line: str, source: str) -> str:
    """The unit of a column of a header such as x_mm,y_mm,z_mm or x [mm],y [mm],z [mm]."""
    match = _HEADER.fullmatch(word.strip('"'))
    if match is None:
        return ""
    if match[2] and match[2] not in (*unit_names("m"), "L"):
        raise InvalidInput(f"{source}, header", line, f"in {TYPED} or L")
    return {"over_length": "L"}.get(match[1], match[1] or match[2] or "")


def _with_units(line: str, units: list[str]) -> str:
    parts = [part.strip() for part in line.split(",")]
    return ",".join(map(str.__add__, parts, units)) if len(parts) == len(units) else line
