"""What loaded arms hold without a snap: sheets of postures, their shares and their surfaces."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import softreach as sr
from softreach.arm import Loads, Manipulator, designs
from softreach.picture.zbuffer import vertex_normals
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import Held
from softreach.workspace import ReachableSet, reachable_set
from softreach.workspace.grid import LiftedGrid
from softreach.workspace.reach import rasterized_set
from tests.laws import large

EXAMPLES = Path(__file__).parent.parent / "examples"

pytestmark = pytest.mark.filterwarnings("ignore:volume .* may be off")


def loaded(name: str, grams: float, points: str = "down") -> Manipulator:
    arm = designs.lce_arm() if name == "lce" else Manipulator.load(EXAMPLES / f"{name}.toml")
    loads = arm.loads or Loads()
    return arm.replace(base=sr.Base(points=points), loads=loads.replace(payload=grams / 1000))


@cache
def held(name: str, grams: float, points: str, n: int) -> Held:
    rod = as_tip_map(loaded(name, grams, points))
    m = rod.box.dimension
    cube = np.indices((n + 1,) * m).reshape(m, -1).T / n
    found = rod.held(rod.box.from_free_cube(cube), (n + 1,) * m)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("name", "grams", "points", "n", "percent"),
    [
        ("lce", 10, "down", 16, 2.6),
        ("lce", 30, "down", 10, 8.4),
        ("lce", 5, "x", 16, 0.3),
        ("tentacle", 20, "x", 32, 3.4),
        ("tentacle", 20, "down", 32, 0.0),
        ("tendon_arm", 50, "down", 16, 0.0),
    ],
)
def test_nodes_hold_two_postures_as_other_continuations_found(name, grams, points, n, percent):
    assert 100 * held(name, grams, points, n).is_doubled.mean() == pytest.approx(percent, abs=0.15)


def test_an_arm_that_leans_holds_both_mirror_images():
    found = held("tentacle", 20, "down", 8)
    (at,) = np.unravel_index([8 * 9 + 2], (81,))[0]  # (8, 2) N
    tips = 1000 * found.tips[found.node == at]
    sides = np.array([[85.22934, 17.88536, -259.39666], [14.59408, 85.85417, -259.39666]])
    assert len(tips) == 2
    for side in sides:  # by shooting from the base
        assert np.linalg.norm(tips - side, axis=1).min() < 1e-3


@pytest.fixture(scope="module")
def snapping() -> ReachableSet:
    found = reachable_set(loaded("lce", 10), accuracy=0.05)
    assert found.dimension == 3
    return found


def test_all_that_is_held_is_in_the_set(snapping):
    tips = held("lce", 10, "down", 16).tips
    assert snapping.is_torn
    assert snapping.contains(tips).mean() > 0.8  # a third of them are on the boundary
    assert snapping.distance(tips).max() < 2.5 * snapping.image.lattice.cell


def test_a_finer_grid_agrees_to_the_errors(snapping):
    finer = rasterized_set(as_tip_map(loaded("lce", 10)), 2 * snapping.cells, None, 0.05)
    assert abs(finer.volume - snapping.volume) < finer.volume_error + snapping.volume_error
    assert snapping.volume_error < 0.1 * snapping.volume
    assert finer.hysteresis_share == pytest.approx(snapping.hysteresis_share, abs=0.01)


@pytest.mark.large
def test_of_several_sheets_twice_the_error_asked_for_has_to_do_and_is_not_warned_of():
    found = reachable_set(loaded("lce", 5), accuracy=0.01)
    assert 0.01 < found.volume_error / found.volume <= 0.02


@pytest.mark.parametrize(
    ("name", "grams", "points"),
    [
        *(("lce", 30, "down"), ("tendon_arm", 50, "x")),
        pytest.param("lce", 5, "x", marks=pytest.mark.large),
        pytest.param("tendon_arm", 50, "down", marks=pytest.mark.large),
    ],
)
def test_what_is_torn_is_one_surface_of_the_stated_volume(name, grams, points):
    found = reachable_set(loaded(name, grams, points), accuracy=0.05)
    assert found.dimension == 3
    surface = found.surface()
    edges = np.sort(surface.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    size = len(surface.vertices)
    graph = coo_array((np.ones(len(unique)), tuple(unique.T)), shape=(size, size))
    assert (count == 2).all()
    assert connected_components(graph, directed=False)[0] <= 3
    assert surface.volume == pytest.approx(found.volume, rel=0.01)


def test_pictures_of_loaded_sets_have_no_slivers_that_look_inward():
    found = reachable_set(designs.lce_arm().replace(loads=Loads(payload=3e-4)), accuracy=0.05)

    def turned(surface) -> int:
        a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
        normals = vertex_normals(surface.vertices, surface.faces)[surface.faces]
        ahead = np.einsum("fki,fi->fk", normals, np.cross(b - a, c - a))
        return int((ahead < 0.0).any(axis=1).sum())

    surface, sheets = found.surface(), found.sheets()
    assert turned(sheets) < 0.01 * turned(surface)
    assert sheets.volume == pytest.approx(surface.volume, rel=2e-3)


def test_sheets_of_two_bundles_hang_together():
    grid = LiftedGrid.of(as_tip_map(loaded("tentacle", 20)), 32)
    size = len(grid.tips)
    starts, ends = grid.cells[:, [0, 0, 1, 2]].ravel(), grid.cells[:, [1, 2, 3, 3]].ravel()
    graph = coo_array((np.ones(len(starts)), (starts, ends)), shape=(size, size))
    assert connected_components(graph, directed=False)[0] == 1
    assert grid.is_torn
    assert grid.lost_share == 0.0


@pytest.mark.parametrize("name", ["tool", *large("end", "middle")])
def test_the_set_of_a_marker_holds_its_places(name):
    arm = loaded("lce", 10)
    markers = (
        sr.arm.Marker(name="end", station=arm.length),
        sr.arm.Marker(name="tool", station=arm.length, offset=(0.0, 0.01, 0.02)),
        sr.arm.Marker(name="middle", station=0.6 * arm.length),
    )
    found = reachable_set(arm.replace(markers=markers), accuracy=0.1, point=name)
    assert found.dimension == 3
    places = sr.compute_cloud(found.arm, 2000).tip.values
    places = places[np.isfinite(places[:, 0])]
    assert found.contains(places).mean() > 0.95
    assert found.distance(places).max() < found.image.lattice.cell
    if name == "end":
        assert found.volume == pytest.approx(reachable_set(arm, accuracy=0.1).volume, rel=1e-6)


def test_the_area_of_sheets_is_that_of_finer_grids_to_its_error():
    arm = loaded("lce", 30, "up")
    two = arm.with_bounds([*arm.bounds[:2], (-1.5, -1.5)])  # between forks, met by luck
    found = reachable_set(two)
    assert found.dimension == 2
    assert found.area_error < 0.1 * found.area
    grid = LiftedGrid.of(as_tip_map(two), 192)
    corners = grid.tips[grid.cells]
    sides = np.diff(corners[:, [[0, 1], [0, 3], [0, 2]]], axis=2)[:, :, 0]
    areas = [np.linalg.norm(np.cross(sides[:, k], sides[:, k + 1]), axis=1) for k in (0, 1)]
    assert abs(np.sum(areas) / 2.0 - found.area) < found.area_error
