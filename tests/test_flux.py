"""Volumes by what flows through the faces: of known maps, when believed, and the faces' image."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest

from softreach.arm import Loads, Manipulator, designs
from softreach.arm.parameters import changed
from softreach.rod import tip_positions
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.workspace import reachable_set, volume_gradient
from softreach.workspace.image import DIAGONAL, boundary_surface
from softreach.workspace.measure import face_image, signed_volume
from softreach.workspace.reach import rasterized_set
from tests.bodies import rubber
from tests.sets import is_closed, solid, trunk_at

Map = Callable[[np.ndarray], np.ndarray]

ARM = designs.minimal_trunk()
STEP = 1e-20


@dataclass(frozen=True, repr=False, eq=False)
class Mapped(TipMap):
    """Any analytic map of the unit cube, with slopes by complex steps: exact to rounding."""

    of: Map
    arm: Manipulator = ARM
    tol: float = 1e-12

    @cached_property
    def box(self):
        return ActivationBox.between(((0.0, 1.0),) * 3, tuple("abc"))

    def fill(self, gamma, out):
        out.tips[:] = self.of(gamma)
        if out.slopes is None:
            return
        for k in range(3):
            moved = gamma.astype(complex)
            moved[:, k] += 1j * STEP
            out.slopes[:, :, k] = np.imag(self.of(moved)) / STEP


def columns(*each: np.ndarray) -> np.ndarray:
    return np.stack(each, axis=1)


MATRIX = np.array([[1.0, 0.4, -0.2], [0.1, 0.5, 0.3], [0.0, -0.6, 0.8]])


def affine(x: np.ndarray) -> np.ndarray:
    return 3.0 + x @ MATRIX.T


def mirrored(x: np.ndarray) -> np.ndarray:
    return affine(x) * [-1.0, 1.0, 1.0]


def twisted(x: np.ndarray) -> np.ndarray:
    """A square bar twisted by 2.5 rad along its axis: volume 1."""
    angle, a, b = 2.5 * x[:, 2], x[:, 0] - 0.5, x[:, 1] - 0.5
    cos, sin = np.cos(angle), np.sin(angle)
    return columns(cos * a - sin * b, sin * a + cos * b, x[:, 2])


def around(turns: float, rise: float) -> Map:
    """A bar of radii 1 to 2 and height 1 bent around the z axis, rising by so much a turn."""

    def bent(x):
        angle, radius = 2 * np.pi * turns * x[:, 0], 1.0 + x[:, 1]
        height = x[:, 2] + rise * turns * x[:, 0]
        return columns(radius * np.cos(angle), radius * np.sin(angle), height)

    return bent


def ring_volume(turns: float) -> float:
    return np.pi * 3.0 * turns


def pressed(x: np.ndarray) -> np.ndarray:
    """det J = 1 + 3 (x - y - 0.2): zero on a plane through the box."""
    return columns(x[:, 0] + 1.5 * (x[:, 0] - x[:, 1] - 0.2) ** 2, x[:, 1], x[:, 2])


pytestmark = pytest.mark.filterwarnings("ignore:volume .* may be off")


def is_injective(of: Map) -> bool:
    return solid(Mapped(of), accuracy=0.02).route == "flux"


KNOWN = {
    "affine": (affine, np.linalg.det(MATRIX)),
    "mirrored": (mirrored, np.linalg.det(MATRIX)),
    "twisted": (twisted, 1.0),
    "three quarters of a ring": (around(0.75, 0.0), ring_volume(0.75)),
    "a spiral ramp that clears itself": (around(1.15, 1.3), ring_volume(1.15)),
}


@pytest.mark.parametrize("name", KNOWN)
def test_where_a_map_is_one_to_one_the_flux_is_the_volume(name):
    of, volume = KNOWN[name]
    found = solid(Mapped(of), accuracy=0.02)
    assert found.route == "flux"
    assert found.volume == pytest.approx(volume, rel=1e-10)
    assert found.volume_error < 1e-9
    assert found.multiplicity == {1: found.volume}
    assert found.fold_volume == found.fold_volume_error == 0.0
    surface = found.surface()
    assert is_closed(surface.faces)
    assert surface.volume == pytest.approx(volume, rel=2e-4 if of in (twisted, mirrored) else 3e-3)


@pytest.mark.parametrize("rise", [0.0, 0.8])
def test_a_ramp_that_lies_on_itself_is_not_one_to_one_though_it_has_no_fold(rise):
    rod, turns = Mapped(around(1.15, rise)), 1.15
    found = solid(rod, accuracy=0.02)
    assert found.route == "raster"
    twice = np.pi * 3.0 * (turns - 1.0) * (1.0 - rise)
    assert abs(signed_volume(rod).value) == pytest.approx(ring_volume(turns), rel=1e-10)
    assert found.volume == pytest.approx(ring_volume(turns) - twice, abs=found.volume_error)
    assert sum(v for k, v in found.multiplicity.items() if k == 2) == pytest.approx(twice, rel=0.05)


def test_faces_that_overlap_a_little_are_told_from_those_that_do_not_touch():
    assert is_injective(around(0.95, 0.0))
    assert not is_injective(around(1.01, 0.0))


def test_a_fold_is_found_before_anything_is_believed():
    found = solid(Mapped(pressed), accuracy=0.02)
    assert found.route == "raster"
    assert found.fold_volume > 0.0
    assert abs(signed_volume(found.tip_map).value) < found.volume


def test_a_fold_at_one_corner_is_found():
    # det J = 1 - s - (1 - x)(1 - y)(1 - z) is below 0 next to one corner only, or nowhere.
    def dented(sign):
        def of(x):
            rest = (1 - x[:, 1]) * (1 - x[:, 2])
            return columns((1 - sign) * x[:, 0] + 0.5 * rest * (1 - x[:, 0]) ** 2, x[:, 1], x[:, 2])

        return of

    assert not is_injective(dented(0.001))
    assert is_injective(dented(-0.6))


@pytest.mark.parametrize("accuracy", [0.1, pytest.param(0.02, marks=pytest.mark.large)])
def test_folds_thinner_than_a_cell_of_the_grid_are_found_at_its_vertices(accuracy):
    # det J = 1 + 2 cos(2 π k x - phase)
    for turns in (3, 7):
        for phase in (0.0, 1.0, 4.0):

            def waved(x, rate=2 * np.pi * turns, phase=phase):
                return columns(x[:, 0] + 2.0 * np.sin(rate * x[:, 0] - phase) / rate, *x.T[1:])

            assert solid(Mapped(waved), accuracy=accuracy).route == "raster"


ONE_TO_ONE = {
    "minimal trunk": ARM.with_bounds((-0.9, -0.3)),
    "laboratory arm": designs.lce_arm().with_bounds((-3.0, -1.0)),
    "laboratory arm from rest": designs.lce_arm().with_bounds((-2.0, 0.0)),
    "little twist": trunk_at(36, 1).with_bounds((-0.9, -0.3)),
}


@pytest.mark.parametrize("name", ONE_TO_ONE)
def test_flux_and_raster_agree_within_the_error_of_the_raster(name):
    arm = ONE_TO_ONE[name]
    found = solid(arm)
    raster = rasterized_set(as_tip_map(arm), 72, None, 1e-3)
    assert found.route == "flux"
    assert abs(found.volume - raster.volume) < raster.volume_error + found.volume_error
    assert found.volume_error < 1e-3 * raster.volume_error + 1e-8 * found.volume
    between = raster.convex_volume_error + found.convex_volume_error
    assert abs(found.convex_volume - raster.convex_volume) < between
    assert sum(v for k, v in raster.multiplicity.items() if k > 1) <= raster.multiplicity_error


def test_the_flux_is_the_integral_of_det_j_whether_the_map_folds_or_not():
    for arm in (ARM, trunk_at(75, 3)):
        rod = as_tip_map(arm, 1e-9)
        x, w = np.polynomial.legendre.leggauss(20)
        cube = np.stack(np.meshgrid(*[(1 + x) / 2] * 3, indexing="ij"), -1).reshape(-1, 3)
        weights = np.einsum("i,j,k->ijk", w, w, w).ravel() / 8
        stretch = np.linalg.det(rod.tips_and_slopes(rod.box.from_free_cube(cube))[1])
        whole = float(weights @ stretch) * rod.box.volume
        assert signed_volume(rod).value == pytest.approx(whole, rel=1e-8)


def test_the_paper_s_design_folds_in_a_corner_and_is_rasterized_and_so_are_loaded_arms():
    assert solid(ARM, accuracy=0.02).route == "raster"
    arm = rubber(ONE_TO_ONE["minimal trunk"], Loads(payload=1e-6))
    assert solid(arm, accuracy=0.1).route == "raster"


@pytest.mark.parametrize("accuracy", [0.1, 0.01])
@pytest.mark.parametrize("arm", [designs.three_tendon_robot, designs.three_chamber_arm])
def test_corners_of_the_box_are_corners_of_the_mesh(arm, accuracy):
    found = solid(arm(), accuracy=accuracy)
    corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    tips = found.tip_map.tips(found.tip_map.box.from_free_cube(corners))
    assert found.surface().distance(tips).max() < 1e-12
    assert found.volume_error < 3e-7 * found.volume
    slope = volume_gradient(arm(), "length", accuracy=accuracy)
    assert slope.volume_error < 1e-3 * abs(slope.volume)


@pytest.mark.parametrize("arm", [designs.filament, designs.minimal_trunk, designs.lce_arm])
def test_a_surface_found_in_a_raster_leaves_no_spike_out(arm):
    found = solid(arm(), accuracy=0.05)
    corners = found.tip_map.tips(found.tip_map.box.corners())
    outer = corners[~found.image.are_deep(corners)]
    assert found.surface().distance(outer).max() < DIAGONAL * found.image.lattice.cell


# The boundary by the faces of the activation box: whole and sharp where a raster frays


@pytest.fixture(scope="module")
def folded():
    """A set with rims thinner than a cell."""
    found = reachable_set(ARM, accuracy=0.02)
    assert found.route == "raster"
    return found


def test_sheets_reach_the_outermost_tips_where_the_raster_ends_before_them(folded):
    from scipy.spatial import ConvexHull

    faces = face_image(folded.tip_map, 120)
    outermost = faces.vertices[ConvexHull(faces.vertices).vertices]
    cell = folded.image.lattice.cell
    raster = boundary_surface(folded.image, folded.volume)
    assert raster.distance(outermost).max() > cell
    assert folded.surface().distance(outermost).max() < 0.2 * cell
    assert folded.sheets().distance(outermost).max() < 0.05 * cell


def test_sheets_end_where_they_cross_and_no_reach_is_before_them():
    arm = changed(ARM, {"taper": np.deg2rad(3), "revolution": 0.2 * np.pi})
    reached = reachable_set(arm, accuracy=0.02)
    sheets = reached.sheets()
    corners = sheets.vertices[sheets.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    some = area > 1e-9
    before = corners[some].mean(axis=1) + 0.01 * normals[some] / area[some, None]
    outside = ~reached.contains(before)
    assert area[some][outside].sum() > 0.97 * area.sum()


def test_sheets_know_their_activations_and_lines(folded):
    sheets = folded.sheets()
    tips = tip_positions(folded.arm, sheets.activation)
    np.testing.assert_allclose(tips, sheets.vertices, atol=1e-5)
    low, high = folded.arm.bounds.T
    at_bound = np.isclose(sheets.activation, low) | np.isclose(sheets.activation, high)
    at_bound = at_bound.sum(axis=1)
    on_lines = np.zeros(len(sheets.vertices), bool)
    on_lines[sheets.lines] = True
    assert on_lines[at_bound >= 2].all()  # edges of the box
    assert (on_lines & (at_bound < 2)).any()  # folds and crossings


def test_sheets_look_outwards_and_bound_the_volume(folded):
    assert folded.sheets().volume == pytest.approx(folded.volume, rel=0.02)
