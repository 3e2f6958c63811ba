"""Every equilibrium of a loaded arm at one activation, stable or not.

The direction of gravity that the tip sees decides which one the base would have to see: a map of
the sphere to itself. Unloaded it is the identity, so that its degree is 1, theory (80): every
direction at the base is covered once more forward than backward, and the number of equilibria is
odd.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach import schema
from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator
from softreach.geometry import sphere_maps
from softreach.rod import kinematics
from softreach.rod.loaded.postures import NEUTRAL, SYMMETRIC
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import SHOT_AT_ONCE
from softreach.rod.rods import ArmMap, all_inputs, as_tip_map, of_tip, with_unstable
from softreach.rod.steps import enough_for_all_breaks
from softreach.rod.tip_map import Frames, InvalidLoads, Strains, TipMap, TipStatus
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput, counted, warn

if TYPE_CHECKING:
    import xarray as xr


_SMALL = 1e-9  # of a length, below which it is shown as 0, in L


@dataclass(frozen=True, eq=False, repr=False)
class AllEquilibria:
    """All equilibria of one arm: stable ones first, then by falling margin."""

    rod: ArmMap
    """The arm."""
    solver: Solver | None
    """Solver that walked along it; None without loads, or with too heavy ones for a search."""
    activation: Array
    """Activation of each bundle [unit of the bundle], shape (bundles,)."""
    tips: Array
    """Tips r [m], shape (n, 3)."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""
    margin: Array
    """Margin of stability, from 1 to below 0 [-], shape (n,); 0 of stable rings."""
    directions: Array
    """Direction of gravity as the tip sees it [-], in the frame of the base of the unloaded arm,
    shape (n, 3); NaN without loads."""
    signs: NDArray[np.int8]
    """Sense of rotation of the map of directions there: kept (1), or turned over (-1) where the
    ways to fall are odd in number; 0 of rings; shape (n,)."""
    is_ring: Mask
    """Mask of those that stand for a ring, all around the direction of gravity; shape (n,)."""
    followed: int | None
    """The posture, which is that of the tip map; None where the arm snaps before."""
    complete: bool
    """True if the degree is 1, and the branch is among them: nothing says that one is missing."""

    @property
    def degree(self) -> int:
        """The sum of the signs, which is 1 if none is missing; a ring counts 0."""
        return int(self.signs.sum())

    def configuration(self, stations: int | ArrayLike = 101) -> xr.Dataset:
        """Their shapes as `softreach.configuration` has them, one for each `sample`.

        Args:
            stations: Number of stations, evenly spaced from base to tip, or their Z [m], ascending.
        """
        gamma, rod = np.repeat(self.activation[None], len(self), axis=0), self.rod
        if self.solver is None:
            return kinematics.configuration(rod, gamma, stations)
        z, inner = kinematics.stations_along(rod, stations), rod.inputs.activations(gamma)
        together = np.union1d(z, kinematics.marker_sections(rod.arm))
        shapes = self.solver.shapes_facing(inner, self.directions, together)[0]
        frames = rod.placed(Frames(*shapes[:2]))
        strains = self.solver.strains_under(inner, together, shapes)
        places = kinematics.marked(rod.arm, together, frames)
        rows = np.searchsorted(together, z)
        frames = Frames(*(values[:, rows] for values in frames))
        strains = Strains(*(values[:, rows] for values in strains))
        return kinematics.shape_dataset(rod, gamma, z, frames, strains, marker_position=places)

    def to_dataset(self) -> xr.Dataset:
        """All numbers over `equilibrium` and `axis`."""
        import xarray as xr

        each, vector = ("equilibrium",), ("equilibrium", "axis")
        values = {
            "tip": (vector, self.tips, {"units": "m"}),
            "status": (each, self.status),
            "margin": (each, self.margin, {"units": "1"}),
            "direction": (vector, self.directions, {"units": "1"}),
            "sign": (each, self.signs),
            "is_ring": (each, self.is_ring),
            "is_followed": (each, np.arange(len(self)) == self.followed),
            "activation": (("bundle",), self.activation),
        }
        names = {"axis": list(schema.AXES), **schema.bundle_coordinates(self.rod.arm)}
        numbers = {"degree": self.degree, "complete": int(self.complete)}
        return xr.Dataset(
            values, names, {**schema.provenance(self.rod.arm, self.rod.frame), **numbers}
        )

    def __len__(self) -> int:
        return len(self.tips)

    def __repr__(self) -> str:
        stable = int((self.status == TipStatus.STABLE).sum())
        doubt = "" if self.complete else ", some may be missing"
        count = counted(len(self), "solution")
        head = f"{count}, of which {stable} stable; degree {self.degree}{doubt}"
        return "\n  ".join([head, *map(self._line, range(len(self)))])

    def _line(self, k: int) -> str:
        small = np.abs(self.tips[k]) <= _SMALL * self.rod.length
        tip = self.rod.arm.length_unit.place(np.where(small, 0.0, self.tips[k]))
        kind = TipStatus(self.status[k]).name.lower() + (" ring" if self.is_ring[k] else "")
        which = ", the posture that the arm takes" if k == self.followed else ""
        return f"tip {tip}: {kind}, margin {self.margin[k]:.3g}{which}"


_SEARCHES = ((4, 1.0), (5, 3.0), (6, 10.0))
"""Levels of the first mesh, and caution: the later ones where the degree is not 1."""
_MOST_WALKED = 20_000_000  # steps of one search, which take a few seconds
_MOST_STEPS = 512
_ROUGHLY = 0.01  # [rad]
_SAME = 1e-3  # [rad], of equilibria that were found in two ways


class _Roots(NamedTuple):
    """Equilibria as directions of gravity at the tip."""

    directions: Array
    signs: NDArray[np.int8]
    """As in `AllEquilibria`, but of a ring that of the move outward."""
    is_ring: Mask
    complete: bool


def equilibria(
    arm: Manipulator | TipMap, activations: ArrayLike, *, tol: float = 1e-6
) -> AllEquilibria:
    """Every equilibrium of a loaded arm at one activation, stable or not.

    An arm that turning about the direction of gravity does not change, straight and upright say,
    has rings of equilibria where it leans: of each ring one is returned.

    Args:
        arm: The design, or its tip map; of a view of it, such as of the free bundles, the whole.
        activations: Of each bundle [unit of each], shape (bundles,) or (1, bundles).
        tol: Largest tip error, in L.

    Raises:
        InvalidInput: Activations of another shape or under which there is no arm (ζ <= 0), or
            other loads than dead forces along one direction.

    Warns:
        SoftreachWarning: Some may be missing, or tips miss `tol`.

    Examples:
        >>> arm = sr.designs.lce_arm().replace(loads=sr.Loads(payload=0.001))
        >>> found = sr.equilibria(arm, arm.bounds.mean(axis=1))
        >>> len(found.tips), found.complete
        (1, True)
    """
    whole = of_tip(as_tip_map(arm, tol, warn=False))  # the degree says whether any is missing
    gamma = whole.check_activations("activations", activations)
    if len(gamma) != 1:
        allowed = f"({whole.box.bundles},) or (1, {whole.box.bundles}): one activation at a time"
        raise InvalidInput("activations.shape", gamma.shape, allowed)
    gamma, rod = whole.inputs.every(gamma), with_unstable(all_inputs(whole))
    if not rod.supports_unstable:
        return _single(rod, gamma, np.full((1, 3), np.nan), np.ones(1), complete=True)
    loaded, at = rod.rod, rod.inputs.activations(gamma)
    if not isinstance(loaded, LoadedRod):
        raise InvalidInput("arm", repr(rod), "a Manipulator, or a tip map of one")
    if not loaded.tables.one_direction:
        crossing = ", ".join(_crossing(loaded.tables.loads, loaded.tables.axes[0]))
        allowed = "dead forces along one direction; follower_moment and payload_arm may be anything"
        raise InvalidLoads("loads", crossing, allowed, "ask the tip map for the branch alone")
    posture = loaded.equilibria(at)
    if loaded.tables.phase.entire > SHOT_AT_ONCE:
        warn("the posture alone is listed: the loads are too heavy for a search of all others")
        return _single(rod, gamma, posture.frame[:, :3], posture.margin, complete=False)
    known = posture.frame[posture.is_found, :3]  # as the tip sees it
    solver = Solver(loaded.tables.in_one_segment, loaded.unloaded_steps, rod.tol)
    solver = _resolving(solver, at)
    solver, roots = _accurate(solver, at, _search(solver, at, known))
    return _judged(rod, solver, gamma, at, roots, known)


def _crossing(loads: Loads, direction: Array) -> list[str]:
    """Names of the loads that are not dead forces along a direction."""

    def across(force: ArrayLike) -> bool:
        size = np.linalg.norm(np.cross(np.asarray(force, float), direction))
        return bool(size > 1e-14 * np.linalg.norm(force))

    forces = ("gravity", "tip_force", "force_per_length")
    names = [name for name in forces if across(getattr(loads, name))]
    names += [name for name in ("tip_moment", "follower_force") if any(getattr(loads, name))]
    return names + [
        f"point_loads[{k}]"
        for k, load in enumerate(loads.point_loads)
        if across(load.force) or any(load.moment)
    ]


def _single(
    rod: ArmMap, gamma: Array, directions: Array, margin: Array, *, complete: bool
) -> AllEquilibria:
    return AllEquilibria(
        rod=rod,
        solver=None,
        activation=gamma[0],
        tips=rod.tips(gamma),
        status=rod.status(gamma),
        margin=margin,
        directions=directions,
        signs=np.ones(1, np.int8),
        is_ring=np.zeros(1, bool),
        followed=0,
        complete=complete,
    )


def _search(solver: Solver, gamma: Array, known: Array) -> _Roots:
    """All of them, searched more finely if the degree is not 1; the known ones are tried first."""
    image, axis = solver.base_map(gamma), solver.tables.axes[0]
    if sphere_maps.is_axisymmetric(image, axis, SYMMETRIC):
        rings = sphere_maps.pole_rings(image, axis, known[0] if len(known) else axis)
        directions = np.concatenate([axis[None], rings.points])
        is_ring = np.arange(len(directions)) > 0
        return _Roots(directions, np.append(1, rings.signs), is_ring, rings.complete)
    most, tries = _MOST_WALKED // solver.steps, list[_Roots]()
    for levels, caution in _SEARCHES:
        roots, is_whole = sphere_maps.sphere_roots(
            image, axis, levels=levels, caution=caution, starts=known, most=most
        )
        tries.append(_isolated(roots, complete=is_whole))
        if tries[-1].complete:
            break
    return tries[-1]


def _isolated(roots: sphere_maps.Roots, *, complete: bool) -> _Roots:
    signs = np.sign(roots.determinants).astype(np.int8)
    complete = complete and int(signs.sum()) == 1
    return _Roots(roots.points, signs, np.zeros(len(signs), bool), complete)


def _resolving(solver: Solver, gamma: Array) -> Solver:
    """With steps halved until the whole map of directions is roughly right."""
    points = sphere_maps.icosphere(2)[0]
    while 2 * solver.steps <= _MOST_STEPS:
        finer = replace(solver, steps=2 * solver.steps)
        apart = solver.base_map(gamma)(points) - finer.base_map(gamma)(points)
        if np.linalg.norm(apart, axis=1).max() <= _ROUGHLY:
            break
        solver = finer
    return solver


def _accurate(solver: Solver, gamma: Array, roots: _Roots) -> tuple[Solver, _Roots]:
    """With steps halved until no tip moves by half of the tolerance."""
    allowed = 0.5 * solver.tol * solver.tables.arm.length
    most = max(_MOST_STEPS, 2 * enough_for_all_breaks(solver.tables.arm))
    while 2 * solver.steps <= most:
        finer = solver.judge()
        if roots.is_ring.any():
            again = _search(finer, gamma, roots.directions[1:])
        else:
            axis = finer.tables.axes[0]
            polished = sphere_maps.polished_roots(finer.base_map(gamma), axis, roots.directions)
            again = _isolated(polished, complete=roots.complete)
        if len(again.directions) != len(roots.directions):
            again = _search(finer, gamma, roots.directions)
        else:
            apart = _tips(finer, gamma, again)[0] - _tips(solver, gamma, roots)[0]
            if np.linalg.norm(apart, axis=1).max(initial=0.0) <= allowed:
                return solver, roots
        solver, roots = finer, again
    warn(f"tips of some equilibria miss tol = {solver.tol:g}")
    return solver, roots


def _tips(solver: Solver, gamma: Array, roots: _Roots) -> tuple[Array, Array]:
    """Tips in the frame of the base, and margins."""
    many = np.repeat(gamma, len(roots.directions), axis=0)
    stations = np.array([solver.tables.arm.length])
    shapes, margin = solver.shapes_facing(many, roots.directions, stations)
    return shapes.position[:, 0], margin


def _judged(
    rod: ArmMap, solver: Solver, gamma: Array, at: Array, roots: _Roots, known: Array
) -> AllEquilibria:
    tips, margin = _tips(solver, at, roots)
    margin = np.where(roots.is_ring & (margin > -NEUTRAL), 0.0, margin)
    stable = (roots.signs > 0) & np.where(roots.is_ring, margin == 0.0, margin > 0.0)
    places = np.round(tips[:, ::-1] / rod.length, 6)  # part mirror images
    order = np.lexsort((*places.T, -np.round(margin, 6), ~stable))
    followed = _nearest(roots, known, solver.tables.axes[0])
    complete = roots.complete and (followed is not None or not len(known))
    if not complete:
        total = int(roots.signs[~roots.is_ring].sum())
        warn(f"equilibria may be missing: the degree of those found is {total}")
    return AllEquilibria(
        rod=rod,
        solver=solver,
        activation=gamma[0],
        tips=rod.pose.to_world(tips[order]),
        status=np.where(stable, TipStatus.STABLE, TipStatus.UNSTABLE).astype(np.int8)[order],
        margin=margin[order],
        directions=roots.directions[order],
        signs=np.where(roots.is_ring, 0, roots.signs).astype(np.int8)[order],
        is_ring=roots.is_ring[order],
        followed=None if followed is None else int(np.flatnonzero(order == followed)[0]),
        complete=complete,
    )


def _nearest(roots: _Roots, known: Array, axis: Array) -> int | None:
    if not len(known) or not len(roots.directions):
        return None
    apart = np.linalg.norm(roots.directions - known[0], axis=1)
    latitudes = np.abs(roots.directions @ axis - known[0] @ axis)
    apart = np.where(roots.is_ring, latitudes, apart)
    nearest = int(apart.argmin())
    return nearest if apart[nearest] < _SAME else None
