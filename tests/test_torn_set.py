"""The reachable set of maps that are torn, or stable in a part of the box only."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pytest

from softreach.arm import Loads, Manipulator, designs
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import Held, TipMap, TipStatus
from softreach.support.errors import InvalidInput
from softreach.workspace import ReachableSet, reachable_set
from softreach.workspace.reach import rasterized_set
from softreach.workspace.search import nearest_tips
from tests.bodies import rubber
from tests.sets import solid

Map = Callable[[np.ndarray], np.ndarray]

ARM = designs.minimal_trunk()


@dataclass(frozen=True, repr=False, eq=False)
class Shifted(TipMap):
    """r = γ in the first three bundles, so that every volume is known."""

    arm: Manipulator = ARM
    tol: float = 1e-6
    bounds: tuple = ((0.0, 1.0),) * 3
    stable: Map = lambda gamma: np.ones(len(gamma), bool)

    @property
    def supports_unstable(self):
        return True

    @cached_property
    def box(self):
        return ActivationBox.between(self.bounds, tuple("abcdef"[: len(self.bounds)]))

    def fill(self, gamma, out):
        tips, slopes, _, status, _ = out
        tips[:] = 0.0
        columns = min(3, gamma.shape[1])
        tips[:, :columns] = gamma[:, :columns]
        lost = ~self.stable(gamma)
        tips[lost] = np.nan
        if slopes is not None:
            slopes[:] = np.eye(3, gamma.shape[1])
        if status is not None:
            status[:] = np.where(lost, TipStatus.NO_EQUILIBRIUM, TipStatus.STABLE)


def outside_ball(gamma: np.ndarray) -> np.ndarray:
    return np.linalg.norm(gamma - [0.53, 0.48, 0.51], axis=1) > 0.3


pytestmark = pytest.mark.filterwarnings("ignore:volume .* may be off")

BALL = 4 / 3 * np.pi * 0.3**3
FOLD = 2 / (3 * np.sqrt(3))
BETWEEN = 2 * FOLD * 1.05**2.5 / 2.5  # the folds of a cusp, of b and a: |b| < FOLD a^1.5


@dataclass(frozen=True, repr=False, eq=False)
class Cusp(Shifted):
    """r = (x, a, c) with x³ - a x = b at γ = (b, a, c), held where 3 x² > a: sheets over a cusp.

    Of two bundles it is (x, a, a²).
    """

    bounds: tuple = ((-1.0, 1.1), (-1.0, 1.05), (0.0, 1.0))

    def fill(self, gamma, out):
        super().fill(gamma, out)
        if gamma.shape[1] == 2:
            out.tips[:, 2] = gamma[:, 1] ** 2

    def held(self, gamma, sizes):
        at_node = [stable_roots(b, a) for b, a, *_ in gamma]
        node = np.repeat(np.arange(len(gamma)), [len(roots) for roots in at_node])
        first = np.searchsorted(node, np.arange(len(gamma) + 1))
        x, number = np.concatenate(at_node), np.arange(len(gamma)).reshape(sizes)
        links, ends, at_end = [], [], []
        for axis in range(len(sizes)):
            for low, high in ((-1, 0), (0, -1)):
                pairs = (np.delete(number, k, axis).ravel() for k in (low, high))
                to = dict(zip(*pairs, strict=True))
                state = np.array([k for k in range(len(x)) if node[k] in to])
                goals = gamma[[to[node[k]] for k in state]]
                arrived, way = followed(x[state], gamma[node[state]], goals)
                for k, y, t in zip(state, arrived, way, strict=True):
                    if t == 1.0:
                        there = np.arange(*first[[to[node[k]], to[node[k]] + 1]].tolist())
                        links.append((k, there[np.abs(x[there] - y).argmin()]))
                    else:
                        ends.append((k, to[node[k]]))
                        at_end.append(gamma[node[k]] + t * (gamma[to[node[k]]] - gamma[node[k]]))
        at_end = np.array(at_end).reshape(-1, gamma.shape[1])
        sides = np.sign(x[[k for k, _ in ends]])
        end_x = sides * np.sqrt(at_end[:, 1].clip(0.0) / 3)
        tips, end_tips = (
            np.column_stack([value, at[:, 1], at[:, 2] if len(sizes) == 3 else at[:, 1] ** 2])
            for value, at in ((x, gamma[node]), (end_x, at_end))
        )
        pairs = [np.array(p, np.intp).reshape(-1, 2) for p in (links, ends)]
        doubled = np.bincount(node, minlength=len(gamma)) > 1
        return Held(node, tips, pairs[0], pairs[1], end_tips, doubled)


def stable_roots(b: float, a: float) -> np.ndarray:
    roots = np.roots([1.0, 0.0, -a, -b])
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    return real[3 * real**2 > a]


def followed(x, begin, end, parts: int = 50):
    """Where branches are after straight ways, or where they end on them."""
    x, way = x.copy(), np.zeros(len(x))
    going = np.ones(len(x), bool)
    for k in range(1, parts + 1):
        b, a = (begin + k / parts * (end - begin))[:, :2].T
        y = x.copy()
        with np.errstate(all="ignore"):
            for _ in range(8):
                y -= (y**3 - a * y - b) / (3 * y**2 - a)
            going &= (np.abs(y - x) < 0.3) & (3 * y**2 > a) & (np.abs(y**3 - a * y - b) < 1e-9)
        x[going], way[going] = y[going], k / parts
    return x, way


def cusp_area(bend: float = 0.0) -> float:
    """Of all (x, a, bend a²) that are held with b and a within their bounds."""
    a, x = np.meshgrid(np.linspace(-1, 1.05, 2001), np.linspace(-1.5, 1.5, 3001), indexing="ij")
    held = (x**3 - a * x >= -1) & (x**3 - a * x <= 1.1) & (3 * x**2 > a)
    return float((held * np.sqrt(1 + (2 * bend * a) ** 2)).mean() * 2.05 * 3.0)


@pytest.fixture(scope="module")
def cusp() -> ReachableSet:
    return rasterized_set(Cusp(), 12, 0.04, 3e-3)


def test_every_sheet_is_reached_up_to_its_edge(cusp):
    assert cusp.is_torn
    assert cusp.volume == pytest.approx(cusp_area(), abs=cusp.volume_error + 0.01)
    assert cusp.volume_error < 0.05 * cusp.volume
    # between the sheets, where x is an unstable root, nothing is held
    a = np.array([0.5, 0.8, 0.95])
    gap = np.stack([0.3 * np.sqrt(a / 3), a, np.full(3, 0.5)], axis=1)
    assert not cusp.contains(gap).any()
    near = np.stack([1.25 * np.sqrt(a / 3), a, np.full(3, 0.5)], axis=1)
    assert cusp.contains(near).all()
    assert cusp.contains(near * [-1, 1, 1]).all()


def test_the_share_of_hysteresis_is_that_between_the_folds(cusp):
    assert cusp.hysteresis_share == pytest.approx(BETWEEN / (2.1 * 2.05), abs=0.01)
    assert cusp.lost_share == 0.0
    assert "hysteresis" in repr(cusp)
    assert cusp.to_dataset().hysteresis_share == cusp.hysteresis_share
    # places of sheets that do not meet count once
    assert sum(cusp.multiplicity.values()) == pytest.approx(cusp.volume)
    assert cusp.multiplicity[1] > 0.95 * cusp.volume


@pytest.mark.large
def test_sheets_of_two_bundles_have_the_area_of_all(cusp):
    surface = reachable_set(Cusp(bounds=Cusp().bounds[:2]), accuracy=0.02)
    assert surface.dimension == 2
    assert surface.area == pytest.approx(cusp_area(1.0), abs=surface.area_error + 0.01)
    assert surface.area_error < 0.05 * surface.area


@dataclass(frozen=True, repr=False, eq=False)
class FlatCusp(Cusp):
    """r = (x, a, 0) of two bundles, in the posture that straight ways from one of some lead to."""

    bounds: tuple = Cusp.bounds[:2]
    at: np.ndarray = field(default_factory=lambda: np.array([[0.0, -1.0]]))
    x: np.ndarray = field(default_factory=lambda: np.zeros(1))

    def held(self, gamma, sizes):
        found = super().held(gamma, sizes)
        flat = (np.column_stack([tips[:, :2], 0 * tips[:, 2]]) for tips in (found[1], found[4]))
        tips, end_tips = flat
        return found._replace(tips=tips, end_tips=end_tips, frames=found.tips[:, :1])

    def continued_from(self, gamma, frames=None):
        return replace(self, at=gamma, x=frames[:, 0])

    def fill(self, gamma, out):
        tips, slopes, _, status, _ = out
        near = np.linalg.norm(gamma[:, None] - self.at, axis=2).argmin(axis=1)
        x, way = followed(self.x[near], self.at[near], gamma, parts=20)
        lost = way < 1.0
        tips[:] = np.where(lost[:, None], np.nan, np.column_stack([x, gamma[:, 1], 0 * x]))
        if slopes is not None:
            with np.errstate(all="ignore"):
                steep = 1 / (3 * x**2 - gamma[:, 1])
            slopes[:] = np.stack(
                [np.column_stack([steep, x * steep]), np.tile([0.0, 1.0], (len(x), 1)), 0 * gamma],
                1,
            )
        if status is not None:
            status[:] = np.where(lost, TipStatus.SNAPS, TipStatus.STABLE)


def test_a_region_of_a_plane_has_all_sheets_up_to_their_edges(monkeypatch):
    monkeypatch.setattr("softreach.workspace.grid._MOST_ALONG", 24)
    region = reachable_set(FlatCusp(), accuracy=0.2)
    assert region.outline is not None
    assert region.area == pytest.approx(cusp_area(), abs=region.area_error + 0.01)
    assert region.hysteresis_share == pytest.approx(BETWEEN / (2.1 * 2.05), abs=0.01)
    a = np.array([0.5, 0.8, 0.95])
    near, gap = (np.stack([share * np.sqrt(a / 3), a, 0 * a], axis=1) for share in (1.1, 0.5))
    assert region.distance(np.concatenate([near, near * [-1, 1, 1]])).max() < 0.01
    assert region.distance(gap).min() > 0.1


@dataclass(frozen=True, repr=False, eq=False)
class Switch(Cusp):
    """The same of one bundle, at a = 1: x jumps at b = ±FOLD."""

    bounds: tuple = ((-1.0, 1.0),)

    def held(self, gamma, sizes):
        return super().held(np.concatenate([gamma, np.ones_like(gamma)], axis=1), sizes)


def test_a_curve_of_two_branches_ends_where_these_end():
    curve = reachable_set(Switch())
    assert curve.dimension == 1
    fold = np.sqrt(1 / 3)
    longest = stable_roots(1.0, 1.0)[-1] - fold
    assert curve.curve_length == pytest.approx(2 * longest, abs=curve.curve_length_error)
    assert curve.curve_length_error < 0.1
    assert curve.hysteresis_share == pytest.approx(FOLD, abs=0.01)


def test_more_bundles_are_searched_for_among_stable_ones():
    rod = Shifted(bounds=((0.0, 1.0),) * 4, stable=lambda gamma: outside_ball(gamma[:, :3]))
    found = solid(rod, accuracy=0.05)
    assert found.volume == pytest.approx(1.0 - BALL, abs=found.volume_error + 0.01)
    assert found.lost_share == pytest.approx(BALL, abs=0.01)
    assert not found.contains(np.array([[0.53, 0.48, 0.51]])).any()


def test_searches_end_on_stable_equilibria():
    rod = Shifted(stable=outside_ball)
    start = np.array([[0.1, 0.5, 0.5], [0.53, 0.48, 0.51]])  # the second begins where none is
    found = nearest_tips(rod, start, np.array([[0.5, 0.5, 0.5], [0.1, 0.1, 0.1]]), 1e-6)
    assert outside_ball(found.gamma[:1]).all()
    assert 0.2 < found.distance[0] < 0.4
    assert np.isinf(found.distance[1])


@pytest.mark.parametrize("bundles", [1, 2, 3, 4])
def test_arms_that_are_nowhere_stable_are_refused_in_one_line(bundles):
    rod = Shifted(bounds=((0.0, 1.0),) * bundles, stable=lambda gamma: np.zeros(len(gamma), bool))
    with pytest.raises(InvalidInput, match="has a stable equilibrium") as caught:
        reachable_set(rod)
    assert "\n" not in str(caught.value)


def test_an_arm_that_is_stable_everywhere_loses_nothing():
    arm = rubber(ARM, Loads(gravity=(9.81, 0.0, 0.0)))
    found = solid(arm, accuracy=0.05)
    assert not found.is_torn
    assert found.lost_share == found.hysteresis_share == 0.0
    assert "posture" not in repr(found)
    assert "lost_share" not in reachable_set(ARM, accuracy=0.05).to_dataset()
    assert as_tip_map(arm).supports_unstable
