"""Reachable sets of four free bundles and more: volumes known otherwise, memory, refusals."""

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidInput, SoftreachWarning
from softreach.workspace import ReachableSet, reachable_set
from softreach.workspace.cells import smallest_memory
from tests.laws import arm_of, large
from tests.sets import is_closed, solid, tips_of_faces


def equidistant(*fibers: tuple[float, float, float, int], **changes) -> Manipulator:
    """Fibers by their revolution, extent and offset in degrees, and their number of bundles."""
    made = (
        FiberArchitecture(
            **dict(zip(("revolution", "extent", "offset"), np.radians(angles), strict=True)),
            bundles=bundles,
        )
        for *angles, bundles in fibers
    )
    fields = {"inner_radius": 0.03, "poisson_ratio": 0.4, "activation_bounds": (-1.2, 0.1)}
    return arm_of(*made, outer_radius=0.06, taper=np.radians(1), **fields | changes)


OTHER = {"inner_radius": 0.05, "poisson_ratio": 0.5, "activation_bounds": (-1.2, 0.0)}
FIVE = equidistant((0, 50, 90, 3), (-90, 30, 20, 2), **OTHER)
SIX = equidistant((90, 40, 90, 3), (-90, 40, 30, 3))
TWELVE = equidistant(*((turn, 25, 20 * i, 3) for i, turn in enumerate((90, -90, 0, 45))))


@pytest.fixture(scope="module")
def five() -> ReachableSet:
    return solid(FIVE, accuracy=1e-2)


def test_five_bundles_reach_what_monte_carlo_says(five):
    # 0.44292 ± 0.0003 by sampling places and asking an inverse for each
    assert abs(five.volume - 0.44292) < five.volume_error + 3e-4
    assert five.volume_error < 1e-2 * five.volume
    rough = solid(five.arm, accuracy=0.1)
    assert abs(rough.volume - 0.44292) < rough.volume_error + 3e-4


def test_random_places_are_inside_as_often_as_the_volume_says(five):
    box = np.array([five.grid[axis].values[[0, -1]] for axis in "xyz"])
    places = np.random.default_rng(0).uniform(box[:, 0], box[:, 1], (15_000, 3))
    share = five.contains(places).mean()
    whole = np.prod(np.diff(box))
    deviation = whole * np.sqrt(share * (1 - share) / len(places))
    assert abs(share * whole - five.volume) < 3 * deviation + five.volume_error


def test_tips_of_faces_of_every_dimension_are_inside_to_a_part_of_a_cell(five):
    tips = tips_of_faces(five.tip_map, 20_000, seed=1)
    outside = five.image.distance(tips) / five.grid.attrs["cell"]
    assert (outside > 1e-2).mean() < 2e-3
    assert outside.max() < 1


@pytest.mark.parametrize("case", [(SIX, 1e-2), (TWELVE, 5e-2), *large((FIVE, 3e-3))])
def test_many_bundles_keep_the_accuracy_asked(case):
    arm, accuracy = case
    found = solid(arm, accuracy=accuracy, memory=5e8)
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
