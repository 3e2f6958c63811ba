"""The reachable set of maps that are torn, or stable in a part of the box only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest

from softreach.arm import Loads, Manipulator, designs
from softreach.cloud.clouds import compute_cloud
from softreach.rod.activation_box import ActivationBox
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap, TipStatus
from softreach.support.errors import InvalidInput
from softreach.workspace import (
    ReachableCurve,
    ReachableSolid,
    ReachableSurface,
    reachable_set,
)
from softreach.workspace.discontinuities import left_out_cells
from softreach.workspace.reach import rasterized_set
from softreach.workspace.search import nearest_tips
from tests.bodies import rubber

Moved = Callable[[np.ndarray], np.ndarray]
Stable = Callable[[np.ndarray], np.ndarray]

ARM = designs.minimal_trunk()
JUMP = 0.7


@dataclass(frozen=True, repr=False, eq=False)
class Shifted(TipMap):
    """r = γ in the first three bundles, moved along x in one part of the box and not in the other;
    so every volume is known."""

    arm: Manipulator = ARM
    tol: float = 1e-6
    bounds: tuple = ((0.0, 1.0),) * 3
    shift: Moved = lambda gamma: np.zeros(len(gamma))
    stable: Stable = lambda gamma: np.ones(len(gamma), bool)

    @property
    def supports_unstable(self):
        return True

    @cached_property
    def box(self):
        return ActivationBox.between(self.bounds, tuple("abcdef"[: len(self.bounds)]))

    def fill(self, gamma, tips, slopes=None, *, twists=None, status=None, directions=None):
        tips[:] = 0.0
        columns = min(3, gamma.shape[1])
        tips[:, :columns] = gamma[:, :columns]
        tips[:, 0] += self.shift(gamma)
        lost = ~self.stable(gamma)
        tips[lost] = np.nan
        if slopes is not None:
            slopes[:] = np.eye(3, gamma.shape[1])
        if status is not None:
            status[:] = np.where(lost, TipStatus.NO_EQUILIBRIUM, TipStatus.STABLE)

    def shapes(self, activations, framed, strained, status=None):
        raise NotImplementedError


def snapping(gamma: np.ndarray) -> np.ndarray:
    """A jump across a slanted plane that meets no grid."""
    return JUMP * (gamma[:, 0] + 0.37 * gamma[:, 1:].sum(axis=1) > 0.61)


def outside_ball(gamma: np.ndarray) -> np.ndarray:
    return np.linalg.norm(gamma - [0.53, 0.48, 0.51], axis=1) > 0.3


BALL = 4 / 3 * np.pi * 0.3**3


def solid(rod: TipMap | Manipulator, **options) -> ReachableSolid:
    found = reachable_set(rod, **options)
    assert isinstance(found, ReachableSolid)
    return found


pytestmark = pytest.mark.filterwarnings("ignore:volume .* may be off")


@pytest.mark.parametrize("n", [10, 20, 40])
def test_a_jump_is_not_bridged(n):
    found = rasterized_set(Shifted(shift=snapping), n, 0.03, 3e-3)
    assert found.volume == pytest.approx(1.0, abs=found.volume_error)
    assert 0.5 / n < found.lost_share < 4.0 / n  # the cells that a plane cuts
    assert found.volume_error < 8.0 / n
    # the gap that the jump leaves
    x = 0.61 - 0.37 * (0.2 + 0.3)
    gap = np.array([[x + part * JUMP, 0.2, 0.3] for part in (0.2, 0.5, 0.8)])
    assert not found.contains(gap).any()
    assert (found.distance(gap) > 0.05).all()
    assert found.contains(gap + [[-0.4 * JUMP, 0, 0], [0.75 * JUMP, 0, 0], [0.4, 0, 0]]).all()


@pytest.mark.parametrize("n", [10, 20, 40])
def test_what_is_not_stable_is_not_reached(n):
    found = rasterized_set(Shifted(stable=outside_ball), n, 0.03, 3e-3)
    assert found.volume == pytest.approx(1.0 - BALL, abs=found.volume_error)
    assert found.volume_error < 2.0 / n
    assert BALL < found.lost_share < BALL + 3.5 / n
    assert not found.contains(np.array([[0.53, 0.48, 0.51], [0.6, 0.55, 0.4]])).any()
    assert found.contains(np.array([[0.1, 0.1, 0.1], [0.9, 0.5, 0.5]])).all()
    assert found.convex_volume == pytest.approx(1.0, abs=found.convex_volume_error + 1e-4)


def test_multiplicity_counts_the_parts_that_overlap():
    # What lies beyond x = 1/2 moves back by 1/4: a quarter of the box is covered twice.
    rod = Shifted(shift=lambda gamma: -0.25 * (gamma[:, 0] > 0.5001))
    found = rasterized_set(rod, 40, 0.02, 3e-3)
    assert found.multiplicity[2] == pytest.approx(0.25, abs=found.multiplicity_error + 0.03)
    assert found.volume == pytest.approx(0.75, abs=found.volume_error)
    assert found.fold_volume == pytest.approx(0.0, abs=1e-3)


def steep(gamma: np.ndarray) -> np.ndarray:
    return JUMP * np.arctan((gamma[:, 0] - 0.503) * 1000)


def root(gamma: np.ndarray) -> np.ndarray:
    return np.cbrt(gamma[:, 0] - 0.503)


@pytest.mark.parametrize("shift", [steep, root], ids=["steep", "root"])
@pytest.mark.parametrize("n", [10, 40])
def test_a_steep_but_continuous_map_is_not_torn(shift, n):
    rod = Shifted(shift=shift)
    ticks = np.linspace(0, 1, n + 1)
    gamma = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    assert not left_out_cells(rod, rod.tips(gamma), n).any()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_tears_are_found_at_every_scale(scale):
    def jump(gamma):
        return scale * JUMP * (gamma[:, 0] > scale * 0.53)

    rod = Shifted(bounds=((0.0, scale),) * 3, shift=jump)
    ticks = np.linspace(0, scale, 11)
    gamma = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    lost = left_out_cells(rod, rod.tips(gamma), 10)
    assert lost[5].all()
    assert lost.sum() == 100


def test_a_thin_set_is_measured_without_what_is_lost():
    torn = Shifted(bounds=((0.0, 1.0),) * 2, shift=snapping)
    surface = reachable_set(torn)
    assert isinstance(surface, ReachableSurface)
    assert surface.area == pytest.approx(1.0, abs=surface.area_error)
    assert 0 < surface.area_error < 0.02
    assert surface.distance(np.array([[0.61 + 0.5 * JUMP, 0.0, 0.0]])) > 0.1

    gap = Shifted(bounds=((0.0, 1.0),), stable=lambda gamma: abs(gamma[:, 0] - 0.5) > 0.1)
    curve = reachable_set(gap)
    assert isinstance(curve, ReachableCurve)
    assert curve.curve_length == pytest.approx(0.8, abs=curve.curve_length_error)
    assert curve.lost_share == pytest.approx(0.2, abs=0.003)
    assert curve.distance(np.array([[0.5, 0.0, 0.0]])) == pytest.approx(0.1, abs=0.003)
    assert curve.to_dataset().lost_share == curve.lost_share


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


def nowhere(gamma: np.ndarray) -> np.ndarray:
    return np.zeros(len(gamma), bool)


@pytest.mark.parametrize("bundles", [1, 2, 3, 4])
def test_arms_that_are_nowhere_stable_are_refused_in_one_line(bundles):
    rod = Shifted(bounds=((0.0, 1.0),) * bundles, stable=nowhere)
    with pytest.raises(InvalidInput, match="has a stable equilibrium") as caught:
        reachable_set(rod)
    assert "\n" not in str(caught.value)


def test_an_arm_whose_payload_makes_it_snap_reaches_what_its_stable_cloud_does():
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0, 0, 9.81), payload=0.02))
    found = solid(arm, accuracy=0.05)
    assert 0 < found.lost_share < 0.1
    assert "left out" in repr(found)
    cloud = compute_cloud(arm, n=4000)
    tips = cloud.tip.values[cloud.status.values == TipStatus.STABLE]
    assert (cloud.status.values != TipStatus.STABLE).mean() < found.lost_share
    assert found.contains(tips).mean() > 0.9
    finer = rasterized_set(tip_map(arm), 2 * found.cells, None, 3e-3)
    assert abs(finer.volume - found.volume) < found.volume_error + finer.volume_error
    assert finer.lost_share < found.lost_share


def test_an_arm_that_is_stable_everywhere_loses_nothing():
    arm = rubber(ARM, Loads(gravity=(9.81, 0.0, 0.0)))
    found = solid(arm, accuracy=0.05)
    assert found.lost_share == 0.0
    assert "left out" not in repr(found)
    assert "lost_share" not in reachable_set(ARM, accuracy=0.05).to_dataset()
    assert tip_map(arm).supports_unstable
