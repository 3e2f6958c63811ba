"""Clearance of whole arms: to the solids around them, and to themselves.

A section counts as a ball of the outer radius, R2 ζ^-ν, or that of its tendons or disks, around the
centerline. Where an arm comes nearest is found by `kernels.room.nearest` on cubics between edges,
of which there are so many that tips, cubics and the search together err by at most `accuracy` L.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.arm.obstacles import Obstacle, obstacle_names
from softreach.arm.stations import Marker
from softreach.arm.tables import tables
from softreach.geometry.meshes import DistanceFields, Mesh, MeshFile, field_around
from softreach.geometry.surface import STACK, TriangleTree
from softreach.kernels.rod.frames import centerlines
from softreach.kernels.room import HALF_SPACE, MESH, NUMBERS
from softreach.kernels.room.cubics import ARC_SERIES, Arms, Steps, weights
from softreach.kernels.room.nearest import ITSELF, NONE, Solids, nearest
from softreach.rod.free import FreeRod
from softreach.rod.rods import ArmMap, as_tip_map, coarsened, with_unstable
from softreach.rod.steps import pilot_activations
from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arguments import as_flag, as_number
from softreach.support.arrays import Array, Index, joined, rows
from softreach.support.errors import NotPossible, Range, warn
from softreach.support.lazy import lazy

if TYPE_CHECKING:
    import xarray as xr

ACCURACY = 1e-3  # over L: largest error of a clearance
_PLACES, _CUBICS, _SEARCH = 1 / 16, 3 / 8, 1 / 2  # shares of the accuracy
_BLOCK = 1024  # arms at once
_PILOTS = 64
_MOST_EDGES = 2048
_FIELD = 1.02  # half an edge of fields around meshes, over the longest arm
_STRANGE = 300.0  # sizes of meshes over L, or the inverse, at which a wrong unit is likely

_TINY = 1e-30  # imaginary step, whose square is lost: derivatives exact to rounding
_weights: Any = getattr(weights, "py_func", weights)  # for arrays
_NO_TREES = TriangleTree(
    np.zeros((1, 4), np.int64),
    *(np.empty((0, 5, 3)), np.empty(0, np.int64), np.empty((0, 3, 3)), np.empty((0, 7, 3))),
)
_NO_FIELDS = DistanceFields(
    *(np.empty((0, 4)), np.empty((0, 3), np.int64), np.empty(0), np.empty(0, np.int64))
)


class Clearances(NamedTuple):
    """Where arms come nearest to what they must not touch."""

    value: Array  # Least gap, beyond the clearance wanted [m]; infinite without anything, (n,)
    which: Index  # Number of the obstacle, `ITSELF`, or `NONE`, shape (n,)
    place: Array  # Edges and shares of the arc from there, on the arm and again, shape (n, 2)


@dataclass(frozen=True, eq=False)
class ClearanceMap:
    """The map from activations to clearance, of one arm.

    Raises:
        NotPossible: The base of the arm is inside an obstacle, or a mesh cannot be used.
    """

    whole: TipMap
    """Its tip map."""
    accuracy: float = ACCURACY
    """Largest error, over L."""
    itself: bool = True
    """Whether the arm must keep clear of itself."""

    def __post_init__(self) -> None:
        base, radius = np.array(self.arm.base.position)[None], self.arm.profile.radius(0.0)
        for each, name in zip(self.obstacles, self.names, strict=False):
            _check_size(each, name, self.arm.length)
            if each.span(self.arm.length)[0] == 0.0 and each.gap(base)[0][0] < -radius:
                raise NotPossible(
                    f"the base of the arm lies inside {name}: move one of them, give the place "
                    "along the arm at which it leaves the solid as start, or say inside = true"
                )

    @property
    def arm(self) -> Manipulator:
        """The design."""
        return self.whole.arm

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The surroundings of the arm."""
        return self.arm.surroundings

    @lazy
    def names(self) -> list[str]:
        """Names of obstacles, and last of the arm itself."""
        return [*obstacle_names(self.obstacles), "the arm itself"]

    @property
    def error(self) -> float:
        """How much smaller a clearance may be than it is said to be [m]."""
        return self.accuracy * self.arm.length

    @lazy
    def tip_map(self) -> ArmMap:
        """The tip map to a tolerance that does, in the world, where the obstacles are."""
        known = as_tip_map(coarsened(self.whole, _PLACES * self.accuracy))
        return replace(known, pose=self.arm.base)

    @lazy
    def _marks(self) -> Array:
        """Stations Z [m] that are edges: of disks and of parts of the arm."""
        arm, ends = self.arm, [0.0, self.arm.length]
        ends += [z for each in self.obstacles for z in each.span(arm.length)]
        return np.unique([*ends, *arm.disks.station])

    @lazy
    def stations(self) -> Array:
        """Z of the edges [m], from base to tip: so many that cubics between them are good."""
        gamma = pilot_activations(self.arm, self.whole.box)
        gamma, steps = gamma[:: -(-len(gamma) // _PILOTS)], max(2, self.tip_map.steps or 8)
        allowed = _CUBICS * self.error
        while True:
            z = self._edges_of(steps)
            error = self._error_of_cubics(gamma, z)
            if error <= allowed or len(z) > _MOST_EDGES:
                return z
            steps = max(steps + 1, int(steps * min((error / allowed) ** 0.25, 3.0)))

    def _edges_of(self, steps: int) -> Array:
        rod: Any = self.tip_map.rod
        if isinstance(rod, FreeRod):
            z = self.arm.profile.station(rod.rule.edges(steps, self._marks))
            z[np.abs(z[:, None] - self._marks).argmin(axis=0)] = self._marks
            return z
        return np.union1d(np.linspace(0.0, self.arm.length, steps + 1), self._marks)

    def _error_of_cubics(self, gamma: Array, z: Array) -> Array:
        """The largest distance of middles of steps from their cubics [m]."""
        every = np.sort(np.concatenate([z, 0.5 * (z[1:] + z[:-1])]))
        frames = self.tip_map.frames(gamma, every)
        points, tangents = frames.position, frames.directors[:, :, 2]
        p, u = (np.stack([x[:, :-2:2], x[:, 2::2]], axis=2) for x in (points, tangents))
        apart = _on_cubics(p, u, 0.5) - points[:, 1::2]
        along = (apart * tangents[:, 1::2]).sum(axis=-1, keepdims=True) * tangents[:, 1::2]
        return np.nanmax(np.linalg.norm(apart - along, axis=-1), initial=0.0)

    def of(self, gamma: Array) -> Clearances:
        """Clearances at checked activations (n, bundles)."""
        n = len(gamma)
        out = Clearances(np.empty(n), np.empty(n, np.int64), np.empty((n, 2)))
        self._prepared  # noqa: B018
        tasks = (partial(self._fill, gamma[b], rows(out, b)) for b in parallel.blocks(n, _BLOCK))
        parallel.run(tasks)
        return out

    def _fill(self, gamma: Array, out: Clearances) -> None:
        arms, (disks, solids, meshes) = self._at(gamma), self._prepared
        lost = np.isnan(arms.points[:, 0, 0])
        for each in arms[:3]:
            each[lost] = 0.0
        count = len(disks) - 1
        lengths, bends, speeds, curvature = np.empty((4, count))
        steps = Steps(lengths, bends, speeds, np.empty(count + 1))
        room = np.empty((STACK, 2)), np.empty((count + 2, 5)), np.empty((STACK, 10))
        room = (np.empty((count, 3)), curvature), room
        nearest(arms, disks, solids, meshes, _SEARCH * self.error, steps, room, *out)
        out.value[out.which == NONE] = np.inf
        out.value[lost], out.which[lost] = np.nan, NONE

    def _at(self, gamma: Array) -> Arms:
        """Arms at the edges."""
        tip_map, z, base = self.tip_map, self.stations, self.tip_map.pose
        inner, lost = tip_map.known_activations(tip_map.inputs.activations(gamma))
        if isinstance(tip_map.rod, FreeRod):
            points, tangents = np.empty((2, len(gamma), len(z), 3))
            start = np.concatenate([base.position, np.array(base.rotation).T.ravel()])
            centerlines(self._table, inner, start, points, tangents)
            extension = 1.0 + np.einsum("nb,eb->ne", inner, self._rates)
        else:
            shapes = tip_map.shapes(gamma, z, z)
            points, extension = shapes.position, shapes.extension
            tangents = np.ascontiguousarray(shapes.directors[:, :, 2])
        widths = self._radius / extension**self.poisson
        points[lost] = np.nan
        return Arms(points, tangents, widths, self._tools(gamma))

    def _tools(self, gamma: Array) -> Array:
        point = self.whole.point
        if point is None or point.station_at("station", self.arm.length) < self.arm.length:
            return np.empty((0, 3))
        return np.nan_to_num(self.tip_map.tips(gamma))

    @lazy
    def poisson(self) -> float:
        """ν of the outermost ring [-], by which the arm thickens: R2 ζ^-ν."""
        rings = self.arm.section.rings
        return max(rings, key=lambda ring: ring.outer_ratio).material.poisson_ratio

    @lazy
    def _radius(self) -> Array:
        return self.arm.widest(self.stations)

    @lazy
    def _rates(self) -> Array:
        """z = dζ/dγ at the edges, of the bundles of the rod, shape (edge, bundle)."""
        return np.ascontiguousarray(tables(self.tip_map.rod.arm, self.stations).extension)

    @lazy
    def _table(self) -> Array:
        rod: Any = self.tip_map.rod
        return rod.rule.packed(self.arm.profile.slender_coordinate(self.stations))

    @lazy
    def _prepared(self) -> tuple[Any, ...]:
        """Disks, solids and meshes as the kernel takes them."""
        z, arm, count = self.stations, self.arm, len(self.obstacles)
        disks, wide = np.zeros(len(z)), arm.disks.radius > arm.disks.tendons
        np.maximum.at(disks, np.searchsorted(z, arm.disks.station[wide]), arm.disks.radius[wide])
        kinds = np.zeros((count + 1, 2), np.int64)
        numbers, ends = np.zeros((count + 1, NUMBERS + 1)), np.zeros((count + 1, 2), np.int64)
        meshes: list[Mesh] = []
        for k, each in enumerate(self.obstacles):
            region, side = each.region, -1 if each.inside else 1
            own = np.asarray(region.numbers, float)
            if region.kind == MESH:
                own = np.array([len(meshes)], float)
                meshes.append(region.mesh if isinstance(region, MeshFile) else region)  # pyright: ignore
            elif region.kind == HALF_SPACE:
                own = own * np.repeat((1, side), 3)
                side = 1
            kinds[k] = region.kind, side
            numbers[k, : len(own)], numbers[k, -1] = own, each.clearance
            ends[k] = np.searchsorted(z, each.span(arm.length))
        kinds[count, 1] = self.itself
        return disks, Solids(kinds, numbers, ends), self._trees(meshes)

    def _trees(self, meshes: list[Mesh]) -> tuple[TriangleTree, DistanceFields]:
        """Trees and fields of all meshes, one after another."""
        half = _FIELD * min(self.whole.farthest(), 1.5 * self.arm.length)
        trees, fields = [_NO_TREES], [_NO_FIELDS]
        for mesh in meshes:
            tree, field = mesh.tree, field_around(mesh, tuple(self.arm.base.position), half)
            first = trees[-1].firsts[-1]
            firsts = first + tree.firsts[1:] + [0, 0, len(field.face), 0]
            trees.append(tree._replace(firsts=firsts, starts=tree.starts + first[3]))
            fields.append(field._replace(face=field.face + first[3]))
        return joined(trees), joined(fields)

    def variables(self, found: Clearances) -> dict[str, Any]:
        """The same as variables of a dataset over `sample`."""
        number = np.where(found.which == ITSELF, len(self.obstacles), found.which)
        edges = np.arange(len(self.stations) + 1.0)
        z = np.interp(found.place[:, 0], edges, np.append(self.stations, self.arm.length))
        error = {"error": self.error}
        return {
            "clearance": ("sample", found.value, {"units": "m", "names": self.names, **error}),
            "obstacle": ("sample", np.maximum(number, -1), {}),
            "station": ("sample", np.where(number < 0, np.nan, z), {"units": "m"}),
        }

    def warn_at_rest(self) -> None:
        """Say which obstacle the arm touches before it is activated, if it does."""
        found = self.of(self.whole.box.clip(np.zeros((1, self.whole.box.bundles))))
        if found.value[0] < 0.0 and found.which[0] >= 0:
            z = self.variables(found)["station"][1][0]
            warn(
                f"at rest the arm is {-found.value[0]:.3g} m too near to "
                f"{self.names[found.which[0]]} at Z = {z:.3g} m: if it is held there, let the part "
                "that must keep clear start beyond, by start or start_over_length"
            )

    def with_slopes(self, gamma: Array) -> tuple[Clearances, Array]:
        """Clearances, and their derivatives along each activation [m], shape (n, bundles).

        Of the gap at the place where it is least, from the exact derivatives of both edges beside.
        """
        found, slopes = self.of(gamma), np.zeros(gamma.shape)
        edges = self._at(gamma)
        for which in np.unique(found.which[found.which != NONE]):
            own = np.flatnonzero(found.which == which)
            part, its = Arms(*(x[own] if len(x) else x for x in edges)), gamma[own]
            place, move = self._moved(part, its, found.place[own, 0])
            if which == ITSELF:
                other, its_move = self._moved(part, its, found.place[own, 1])
                away = place - other
                normal = away / np.linalg.norm(away, axis=1, keepdims=True)
                move[:, :3] -= its_move[:, :3]
                move[:, 3] += its_move[:, 3]  # radii add up
            else:
                normal = self.obstacles[which].gap(place)[1]
            slopes[own] = np.einsum("na,nab->nb", normal, move[:, :3]) - move[:, 3]
        return found, slopes

    def _moved(self, edges: Arms, gamma: Array, place: Array) -> tuple[Array, Array]:
        """Points at places (n,), (n, 3), and derivatives of these and of radii, (n, 4, bundles)."""
        count, rows = len(self.stations) - 1, np.arange(len(gamma))
        k = np.clip(place.astype(int), 0, count - 1)
        t, moves = place - k, np.zeros((len(gamma), 4, gamma.shape[1]))
        tool = place > count
        t[tool] = 1.0
        p, u = (np.stack([x[rows, k], x[rows, k + 1]], axis=1) for x in edges[:2])
        points, (dp, du) = _on_cubics(p, u, t), self._turned(edges, gamma, k)
        moved = _on_cubics(p + 1j * _TINY * dp, u + 1j * _TINY * du, t).imag / _TINY
        moves[:, :3] = np.moveaxis(moved, 0, 2)
        shrink = [self._swelling(edges, gamma, k + side) for side in (0, 1)]
        moves[:, 3] = (1.0 - t)[:, None] * shrink[0] + t[:, None] * shrink[1]
        disks = self._prepared[0][k + (t == 1.0)]
        moves[((t == 0.0) | (t == 1.0)) & (disks > 0.0), 3] = 0.0
        if tool.any():
            tips = self.tip_map.tips_and_slopes(gamma[tool])
            share = (place[tool] - count)[:, None]
            points[tool] += share * (tips[0] - points[tool])
            moves[tool, :3] += share[..., None] * (tips[1] - moves[tool, :3])
            moves[tool, 3] = 0.0
        return points, moves

    def _turned(self, edges: Arms, gamma: Array, first: Index) -> Array:
        """Derivatives of centers and of tangents at two edges, (2, bundles, n, edge, 3)."""
        moves = np.zeros((2, gamma.shape[1], len(gamma), 2, 3))
        beside = first[:, None] + [0, 1]
        for e in np.unique(beside[beside > 0]):
            own, side = np.nonzero(beside == e)
            tips, twists = self._up_to(int(e)).tip_twists(gamma[own])
            v, w = np.moveaxis(twists.reshape(len(own), 2, 3, -1), (1, 3), (0, 1))
            moves[0][:, own, side] = v + np.cross(w, tips)
            moves[1][:, own, side] = np.cross(w, edges.tangents[own, e])
        return moves

    def _up_to(self, edge: int) -> TipMap:
        """The tip map of the arm up to an edge."""
        known = vars(self).setdefault("_parts", {})
        if edge not in known:
            rod = self.tip_map.rod
            if isinstance(rod, FreeRod):
                part = FreeRod(rod.arm.replace(point=None), rod.tol, len(self._table))
                vars(part)["table"] = self._table[:edge]
                known[edge] = replace(self.tip_map, rod=part)
            else:
                marker = Marker(name="an edge", station=float(self.stations[edge]))
                arm = self.arm.replace(markers=(marker,), point=marker.name)
                known[edge] = with_unstable(as_tip_map(arm, self.tip_map.tol))
        return known[edge]

    def _swelling(self, edges: Arms, gamma: Array, edge: Index) -> Array:
        """Derivatives of radii at an edge of each arm, ∂R = -ν R/ζ ∂ζ, shape (n, bundles)."""
        inputs, rows = self.tip_map.inputs, np.arange(len(gamma))
        inner, of_drives = inputs.with_slopes(gamma)
        zeta = 1.0 + (inner * self._rates[edge]).sum(axis=1)
        factor = -self.poisson * edges.radius[rows, edge] / zeta
        along = (factor[:, None] * self._rates[edge])[:, None]
        out = np.empty((len(gamma), 1, gamma.shape[1]))
        if inputs.are_activations:
            return along[:, 0]
        inputs.along_x(along, of_drives, out)
        return out[:, 0]


def compute_clearance(
    arm: Manipulator | TipMap,
    activations: ArrayLike,
    *,
    accuracy: float = ACCURACY,
    itself: bool = True,
    slopes: bool = False,
) -> xr.Dataset:
    """Clearance of the whole arm to its surroundings and to itself, at many activations.

    The arm is as wide as the widest of its body, R2 ζ^-ν, its tendons and its disks, and counts
    as balls around its centerline; so does the line to the point of a tool, without width. Parts of
    the arm count where the gap between them is below half of its width and it has turned back.

    Args:
        arm: The design with its `surroundings`, or its tip map.
        activations: γ [-], shape (n, bundles), or (bundles,) for one.
        accuracy: Largest error, over L.
        itself: Whether the arm must keep clear of itself.
        slopes: Whether to compute derivatives.

    Returns:
        Dataset over `sample` with `clearance` [m], beyond what is wanted; infinite where nothing is
        near, NaN without an equilibrium. `obstacle`, its number among the `names` in the attributes
        of `clearance`, -1 for none; `station`, Z of the place [m]. With `slopes`, also
        `clearance_slope` (sample, bundle) [m per unit]. The attribute `error` says how much smaller
        a clearance may be [m].

    Raises:
        InvalidInput: As for `tip_positions`, or an accuracy out of range.
        NotPossible: The base lies inside an obstacle, or a mesh is open or faces in.
    """
    import xarray as xr

    accuracy = as_number("accuracy", accuracy, Range(1e-6, 0.1, unit="(in L)"))
    tip_map = as_tip_map(arm)
    found = ClearanceMap(tip_map, accuracy, as_flag("itself", itself))
    found.warn_at_rest()
    gamma = tip_map.check_activations("activations", np.atleast_2d(np.asarray(activations)))
    each, rates = found.with_slopes(gamma) if as_flag("slopes", slopes) else (found.of(gamma), None)
    variables: dict[str, Any] = found.variables(each)
    if rates is not None:
        variables["clearance_slope"] = (("sample", "bundle"), rates, {"units": "m per unit"})
    names = {"bundle": list(tip_map.box.names)} if rates is not None else {}
    return xr.Dataset(variables, names)


def _check_size(obstacle: Obstacle, name: str, length: float) -> None:
    if not isinstance(obstacle.region, Mesh | MeshFile):
        return
    size = float(np.ptp(obstacle.region.bounds, axis=0).max()) / length
    if not 1.0 / _STRANGE <= size <= _STRANGE:
        warn(f"{name} is {size:.3g} times as large as the arm is long: is its unit right?")


def _on_cubics(points: Array, tangents: Array, t: ArrayLike) -> Array:
    """Points at shares t of arcs between centers and tangents (..., 2, 3), as kernels have them."""
    chord, turn = (((x[..., 1, :] - x[..., 0, :]) ** 2).sum(axis=-1) for x in (points, tangents))
    arc = np.sqrt(chord) * np.polynomial.polynomial.polyval(0.25 * turn, ARC_SERIES)
    terms = (x[..., k, :] for x in (points, tangents) for k in (0, 1))
    each = zip(_weights(arc, t), terms, strict=True)
    return np.sum([np.asarray(w)[..., None] * x for w, x in each], axis=0)
