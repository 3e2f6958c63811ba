"""All postures that a loaded arm holds, as one map: those from rest and those of other sheets."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from softreach.arm.base import Base
from softreach.arm.manipulator import Manipulator
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import ArmMap
from softreach.rod.tip_map import TipMap, TipOutputs
from softreach.support.arrays import Array
from softreach.support.lazy import lazy
from softreach.workspace.grid import components, cube_grid, share_of_box

_SAME = 1e-4  # [L] between tips of one posture
_NODES, _MOST_ALONG = 1 << 13, 64  # of a grid by default, and cells along it


class Sheet(NamedTuple):
    """Postures to which activations do not lead straight from rest."""

    tip_map: TipMap  # the tip map that goes on from the nearest of them
    gamma: Array  # activations at which they are known, (n, bundles)


@dataclass(frozen=True, eq=False, repr=False)
class AllPostures(TipMap):
    """The map of a loaded arm in all of its postures: its last input is the number of a sheet.

    Along that nothing changes, so that a search that begins on a sheet stays there.
    """

    from_rest: TipMap
    sheets: list[Sheet]  # the others, numbered from 1
    lost_share: float  # share of activations at which no posture is held [-]
    hysteresis_share: float  # share of activations at which two are held on one side [-]
    arm: Manipulator = field(init=False)
    tol: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "arm", self.from_rest.arm)
        object.__setattr__(self, "tol", self.from_rest.tol)

    def seen_from(self, pose: Base) -> AllPostures:
        """The same in a frame in which the frame of places has a pose."""
        sheets = [sheet._replace(tip_map=ArmMap.of(sheet.tip_map, pose)) for sheet in self.sheets]
        return replace(self, from_rest=ArmMap.of(self.from_rest, pose), sheets=sheets)

    def with_sheets(self, gamma: Array, tips: Array) -> tuple[Array, Array]:
        """Activations of postures from rest and their tips, and all that are known of others."""
        others, places = self._known
        every = np.concatenate([np.column_stack([gamma, np.zeros(len(gamma))]), others])
        return every, np.concatenate([tips, places])

    @lazy
    def _known(self) -> tuple[Array, Array]:
        every = [each.gamma for each in self.sheets]
        number = np.repeat(np.arange(len(every)) + 1.0, [len(gamma) for gamma in every])
        gamma = np.column_stack([np.concatenate(every), number]).astype(np.float64)
        held = np.isfinite(tips := self.tips(gamma)).all(axis=1)
        return gamma[held], tips[held]

    @lazy
    def box(self) -> ActivationBox:
        """Bounds of the bundles, and of the number of the sheet."""
        box = self.from_rest.box
        bounds = np.stack([box.low, box.high], axis=1)
        ends = np.concatenate([bounds, [[0.0, len(self.sheets)]]])
        return ActivationBox.between(ends, [*box.names, "sheet"])

    @lazy
    def supports_unstable(self) -> bool:
        return True

    def prepare(self) -> None:
        for tip_map in (self.from_rest, *(sheet.tip_map for sheet in self.sheets)):
            tip_map.prepare()

    def fill(self, gamma: Array, out: TipOutputs) -> None:
        """Put tips, slopes and status into place; the others are not known."""
        assert out.twists is None
        assert out.directions is None
        number = np.rint(gamma[:, -1])
        for k, tip_map in enumerate([self.from_rest, *(sheet.tip_map for sheet in self.sheets)]):
            if not len(rows := np.flatnonzero(number == k)):
                continue
            inner = np.ascontiguousarray(gamma[rows, :-1])
            at, kept = np.empty((len(rows), 3)), np.empty(len(rows), np.int8)
            along = None if out.slopes is None else np.empty((len(rows), 3, inner.shape[1]))
            tip_map.fill(inner, TipOutputs(at, along, status=kept))
            out.tips[rows] = at
            if out.slopes is not None and along is not None:
                out.slopes[rows] = np.pad(along, ((0, 0), (0, 0), (0, 1)))
            if out.status is not None:
                out.status[rows] = kept


def all_postures(tip_map: TipMap, cells: int | None = None) -> AllPostures | None:
    """All postures that an arm holds, on sheets that are known at the nodes of a grid.

    A sheet that is narrower than the cells may be missing. Each goes on beyond its last nodes, as
    far as the cells beside. The grid has so many cells along each free bundle, by default as many
    as 8,192 nodes allow. None where all are those to which activations lead straight from rest.
    """
    m, box = tip_map.box.dimension, tip_map.box
    if not tip_map.supports_unstable:
        return None
    cells = cells or min(int(_NODES ** (1 / m) + 1e-9) - 1, _MOST_ALONG)
    nodes = box.from_free_cube(cube_grid(cells, m))
    held = tip_map.held(nodes, (cells + 1,) * m)
    if held is None or held.frames is None or not len(held.node):
        return None
    apart = np.linalg.norm(held.tips - tip_map.tips(nodes)[held.node], axis=1)
    is_other = ~(apart <= _SAME * tip_map.length)  # no posture from rest is another, too
    is_other[held.ends[:, 0]] = True
    sheet = components(held.links[is_other[held.links].all(axis=1)], len(held.node))
    # Where a sheet holds several postures of a node, each has a part of its own.
    key = sheet * len(nodes) + held.node
    order = np.argsort(key, kind="stable")
    part = sheet * len(key)
    part[order] += np.arange(len(key)) - np.searchsorted(key[order], key[order])
    sheets = list[Sheet]()
    for each in np.unique(part[is_other]):
        states = np.flatnonzero((part == each) & is_other)
        gamma = nodes[held.node[states]]
        sheets.append(Sheet(tip_map.continued_from(gamma, held.frames[states]), gamma))
    is_lost = np.bincount(held.node, minlength=len(nodes)) == 0
    lost, doubled = (share_of_box(each, cells, m) for each in (is_lost, held.is_doubled))
    return AllPostures(tip_map, sheets, lost, doubled) if sheets else None
