"""Reachable sets of four free bundles and more: volumes known otherwise, memory, refusals."""

import math

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidInput, SoftreachWarning
from softreach.workspace import ReachableSet, reachable_set
from softreach.workspace.cells import smallest_memory
from tests.sets import is_closed, solid


def family(revolution: float, extent: float, offset: float, bundles: int) -> FiberArchitecture:
    """Equidistant bundles, in degrees."""
    angles = np.radians([revolution, extent, offset])
    return FiberArchitecture(
        revolution=angles[0], extent=angles[1], offset=angles[2], bundles=bundles
    )


def arm_of(
    *fibers: FiberArchitecture, inner_radius: float, poisson_ratio: float, bounds: object
) -> Manipulator:
    return Manipulator.tapered(
        length=1.0,
        outer_radius=0.06,
        inner_radius=inner_radius,
        taper=math.radians(1),
        poisson_ratio=poisson_ratio,
        actuators=fibers,
        activation_bounds=bounds,
    )


def five_bundles() -> Manipulator:
    fibers = family(0, 50, 90, 3), family(-90, 30, 20, 2)
    return arm_of(*fibers, inner_radius=0.05, poisson_ratio=0.5, bounds=(-1.2, 0.0))


def six_bundles() -> Manipulator:
    fibers = family(90, 40, 90, 3), family(-90, 40, 30, 3)
    return arm_of(*fibers, inner_radius=0.03, poisson_ratio=0.4, bounds=(-1.2, 0.1))


def twelve_bundles() -> Manipulator:
    fibers = [family(turn, 25, 20 * i, 3) for i, turn in enumerate((90, -90, 0, 45))]
    return arm_of(*fibers, inner_radius=0.03, poisson_ratio=0.4, bounds=(-1.2, 0.1))


@pytest.fixture(scope="module")
def five() -> ReachableSet:
    return solid(five_bundles(), accuracy=1e-2)


def test_five_bundles_reach_what_monte_carlo_says(five):
    # 0.44292 ± 0.0003 by sampling places and asking an inverse for each
    assert abs(five.volume - 0.44292) < five.volume_error + 3e-4
    assert five.volume_error < 1e-2 * five.volume
    rough = solid(five.arm, accuracy=0.1)
    assert abs(rough.volume - 0.44292) < rough.volume_error + 3e-4


def test_random_places_are_inside_as_often_as_the_volume_says(five):
    box = np.array([five.grid[axis].values[[0, -1]] for axis in "xyz"])
    places = np.random.default_rng(0).uniform(box[:, 0], box[:, 1], (40_000, 3))
    share = five.contains(places).mean()
    whole = np.prod(np.diff(box))
    deviation = whole * np.sqrt(share * (1 - share) / len(places))
    assert abs(share * whole - five.volume) < 3 * deviation + five.volume_error


def test_tips_of_faces_of_every_dimension_are_inside_to_a_part_of_a_cell(five):
    rng = np.random.default_rng(1)
    cube = rng.random((20_000, 5))
    bound = rng.random((20_000, 5)) < 0.5
    cube[bound] = rng.integers(0, 2, int(bound.sum()))
    tips = five.tip_map.tips(five.tip_map.box.from_cube(cube))
    outside = five.image.distance(tips) / five.grid.attrs["cell"]
    assert (outside > 1e-2).mean() < 2e-3
    assert outside.max() < 1


@pytest.mark.parametrize(
    ("design", "accuracy"),
    [
        (six_bundles, 1e-2),
        (twelve_bundles, 5e-2),
        pytest.param(five_bundles, 3e-3, marks=pytest.mark.large),
    ],
)
def test_many_bundles_keep_the_accuracy_asked(design, accuracy):
    found = solid(design(), accuracy=accuracy, memory=5e8)
    assert 0 < found.volume_error <= accuracy * found.volume
    assert found.volume < found.convex_volume + found.convex_volume_error


def test_the_surface_of_a_set_with_a_thin_rim_is_closed_and_in_one_piece():
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    four = solid(designs.redundant_trunk(), accuracy=5e-2)
    surface, count = four.surface(), len(four.surface().vertices)
    assert is_closed(surface.faces)
    starts, ends = surface.faces.ravel(), np.roll(surface.faces, -1, axis=1).ravel()
    near = coo_array((np.ones(len(starts)), (starts, ends)), shape=(count, count))
    assert connected_components(near, directed=False)[0] == 1
    assert surface.volume == pytest.approx(four.volume, abs=four.volume_error)
    assert four.distance(surface.vertices).max() < 0.5 * four.grid.attrs["cell"]


def test_little_memory_means_larger_cells_a_larger_error_and_a_warning():
    arm = designs.redundant_trunk()
    least = smallest_memory(as_tip_map(arm))
    with pytest.warns(SoftreachWarning, match="more memory"):
        found = solid(arm, accuracy=1e-3, memory=least)
    assert found.image.grid.reached.size < 2.5e4
    fine = solid(arm, accuracy=1e-2)
    assert fine.volume_error < found.volume_error or fine.grid.attrs["cell"] < 0.05
    assert abs(found.volume - fine.volume) < found.volume_error + fine.volume_error
    with pytest.raises(InvalidInput, match="memory"):
        reachable_set(arm, memory=0.9 * least)
