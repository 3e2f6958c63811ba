"""Request to the inverse problem: targets and preferences, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import at_marker
from softreach.rod.tip_map import TipMap
from softreach.support.arguments import as_mapping, as_number, as_one_of
from softreach.support.arrays import Array, Index, as_floats, repeated
from softreach.support.errors import InvalidInput, Range
from softreach.support.files.columns import read_table, split_unit, tip_columns
from softreach.support.units import TYPED, lengths_in

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
    markers: Mapping[str, Array] = field(default_factory=dict)  # their wanted positions, (t, 3)
    marker_within: Mapping[str, float] = field(default_factory=dict)  # as `within`, of some
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

    @property
    def is_of_place(self) -> bool:
        """True if the position of the tip is the only goal."""
        return self.direction is None and not self.markers

    def of(self, rows: slice | Index) -> Request:
        """The request for some of the targets."""
        names = ("targets", "near", "direction", "orientation")
        parts = {name: getattr(self, name) for name in names}
        chosen = {name: part[rows] for name, part in parts.items() if part is not None}
        markers = {name: places[rows] for name, places in self.markers.items()}
        return replace(self, markers=markers, **chosen)


def as_activations(name: str, activations: ArrayLike, box: ActivationBox, count: int) -> Array:
    """Activations (bundles,) or (t, bundles) of all bundles as those of free ones, (t, free)."""
    rows = repeated(name, activations, (box.bundles,), count)
    return np.ascontiguousarray(rows[:, box.free])


def as_rates(rate: ArrayLike | None, count: int) -> Array | None:
    """Rates of all inputs from one positive number or one for each, shape (count,)."""
    if rate is None:
        return None
    rates = as_floats("rate", rate)
    if rates.shape not in ((), (1,), (count,)) or not ((rates > 0) & (rates < np.inf)).all():
        raise InvalidInput("rate", rate, f"one positive number or {count}")
    return np.broadcast_to(rates, count)


def as_frames(orientation: ArrayLike, count: int) -> Array:
    """Rotation matrices (3, 3) or (t, 3, 3) as (t, 3, 3)."""
    frames = repeated("orientation", orientation, (3, 3), count)
    square = frames @ frames.transpose(0, 2, 1) - np.eye(3)
    if not (np.abs(square) < 1e-6).all() or not (np.linalg.det(frames) > 0.0).all():
        raise InvalidInput("orientation", frames, "rotation matrices: orthonormal, determinant 1")
    return frames


def as_markers(
    tip_map: TipMap, markers: Any, within: float | Mapping[str, float], count: int
) -> dict[str, dict[str, Any]]:
    """Positions (3,) or (t, 3) of markers as (t, 3), and distances that do [m], of a `Request`."""
    places = as_mapping("markers", markers, partial(repeated, shape=(3,), count=count))
    each = within if isinstance(within, Mapping) else dict.fromkeys(places, within)
    for name in places:
        at_marker(tip_map, name)  # refuses one that the arm does not have
    for name in each:
        as_one_of("marker_within", name, tuple(places))
        as_number("marker_within", each[name], Range(0.0, unit="m"))
    return {"markers": places, "marker_within": dict(each)}


def positions_in(content: bytes, source: str, length: float | None = None) -> list[list[float]]:
    """Positions [m] from the table in a file, whose columns or cells may name their units.

    Errors name the file by `source`; places in L need a `length` L [m].
    """
    table = read_table(content, source)
    columns = [(table[x], split_unit(x)[3]) for x in tip_columns(table.columns, "m", "L", "")]
    cells = ([f"{cell}{unit}".replace("over_length", "L") for cell in own] for own, unit in columns)
    rows = enumerate(zip(*cells, strict=True), 1)
    return [position_in(f"{source}, point {k}", ",".join(row), length) for k, row in rows]


def position_in(name: str, text: str, length: float | None = None) -> list[float]:
    """One position [m] from x,y,z, each with its unit or all of them in m; in L with a length."""
    values = lengths_in(text, 3, length)
    if values is None:
        units = TYPED if length is None else f"{TYPED}, L"
        allowed = f"three comma-separated numbers x,y,z in m, or each with its unit ({units})"
        raise InvalidInput(name, text or "''", allowed)
    return values
