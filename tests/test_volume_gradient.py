"""Derivatives of the reachable volume: against differences, laws of scale, and what is refused."""

from functools import cache

import numpy as np
import pytest

from softreach.arm import Loads, Manipulator, Material, Ring, Tendon, designs
from softreach.arm.parameters import changed, find_parameter, parameters
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.workspace import VolumeGradient, reachable_set, volume_gradient
from softreach.workspace.gradient import boundary_samples
from softreach.workspace.measure import signed_volume
from softreach.workspace.reach import rasterized_set
from softreach.workspace.tip_derivatives import TipDerivatives
from tests.bodies import rubber
from tests.cable import Cable
from tests.laws import large
from tests.made_arms import one_ring_arm
from tests.sets import trunk_at
from tests.test_redundant_set import FIVE

NARROW = designs.minimal_trunk().with_bounds((-0.9, -0.3))
NAMES = ("taper", "revolution", "left.offset", "rings[0].inner_ratio", "lower", "right.upper")


@pytest.fixture(scope="module")
def narrow() -> VolumeGradient:
    return volume_gradient(NARROW, NAMES)


def difference(arm: Manipulator, steps: dict[str, float], volume) -> float:
    """Derivative by differences of fourth order, along steps of several parameters."""
    start = {name: find_parameter(arm, name).value(arm) for name in steps}

    def at(k):
        return volume(changed(arm, {name: start[name] + k * h for name, h in steps.items()}))

    return (at(-2) - 8 * at(-1) + 8 * at(1) - at(2)) / 12


@pytest.mark.parametrize("names", [NAMES, *large(*((name,) for name in NAMES))], ids=str)
def test_where_the_flux_holds_it_is_exact_to_a_millionth(narrow, names):
    """By each parameter, or along a direction in which all change the volume alike."""

    def raster(arm):
        return rasterized_set(as_tip_map(arm, 1e-9), 42, None, 3e-3).volume

    rows = [narrow.parameters.index(name) for name in names]
    assert narrow.route == "flux"
    assert (narrow.volume_error < 1e-6 * np.abs(narrow.volume)).all()
    steps = dict(zip(names, 1.5e-4 / narrow.volume[rows], strict=True))
    expected = difference(NARROW, steps, raster)
    assert 1.5e-4 * len(names) == pytest.approx(expected, rel=1e-6)


@pytest.mark.large
@pytest.mark.parametrize("name", ["taper", "lower", "left.offset"])
def test_the_convex_volume_s_derivative_is_within_its_error(narrow, name):
    def convex(arm):
        return reachable_set(arm, accuracy=5e-4).convex_volume

    row = narrow.parameters.index(name)
    h = 2e-2 * find_parameter(NARROW, name).value(NARROW)
    expected = difference(NARROW, {name: h}, convex) / h
    error = narrow.convex_volume_error[row]
    assert abs(narrow.convex_volume[row] - expected) < error
    assert error < 0.02 * np.abs(narrow.convex_volume).max()


def test_unreachability_follows_from_both_volumes(narrow):
    solid, step = narrow.solid, 1e-6 / np.abs(narrow.volume)
    moved, convex = solid.volume + step * narrow.volume, step * narrow.convex_volume
    change = (1.0 - moved / (solid.convex_volume + convex)) - solid.unreachability
    assert change / step == pytest.approx(narrow.unreachability, rel=1e-4)
    assert (narrow.unreachability_error > 0).all()


def test_a_longer_and_thicker_arm_reaches_as_the_cube_of_its_size():
    # V = L³ f(R2/L): L ∂V/∂L + R2 ∂V/∂R2 = 3 V
    found = volume_gradient(NARROW, ("length", "outer_radius"))
    sizes = np.array([NARROW.length, float(NARROW.profile.radius(0.0))])
    assert sizes @ found.volume == pytest.approx(3.0 * found.solid.volume, rel=1e-7)
    off = sizes @ found.convex_volume - 3.0 * found.solid.convex_volume
    assert abs(off) < found.convex_volume_error[0]


def uneven(**shared: tuple[float, ...]) -> Manipulator:
    """The narrow arm with a value of its own for each fiber."""
    values = {
        f"{fiber.name}.{field}": value
        for field, own in shared.items()
        for fiber, value in zip(NARROW.fibers, own, strict=False)
    }
    return changed(NARROW, values)


BOUNDED = uneven(lower=(-0.9, -0.8, -0.7), upper=(-0.3, -0.35, -0.2))
SHARED = {
    "lower": BOUNDED,
    "upper": BOUNDED,
    "extent": uneven(extent=(0.3, 0.5, 0.4)),
    "revolution": uneven(revolution=(-1.0, 0.5)).with_bounds((-0.7, -0.4)),
    "poisson_ratio": changed(
        designs.lce_arm().with_bounds((-2.0, -1.0)),
        {"core.poisson_ratio": 0.3, "rings[1].material.poisson_ratio": 0.4},
    ),
}


@pytest.mark.parametrize(
    "name", ["lower", "revolution", "poisson_ratio", *large("upper", "extent")]
)
def test_the_derivative_by_what_parts_share_is_the_sum_of_theirs(name):
    """Revolutions grow in their own sense."""
    known = parameters(SHARED[name])
    own = {one: known[one].value(SHARED[name]) for one in known if one.endswith(f".{name}")}
    values = {one: value for one, value in own.items() if value}
    found = volume_gradient(SHARED[name], (name, *values), accuracy=1e-2)
    signs = np.sign([*values.values()])
    way = signs if name == "revolution" else np.ones(len(signs))
    assert found.route == "flux"
    assert found.volume[0] == pytest.approx(way @ found.volume[1:], rel=1e-6)
    off = abs(found.convex_volume[0] - way @ found.convex_volume[1:])
    assert off < found.convex_volume_error.sum()


def test_the_signed_volume_grows_at_a_bound_by_what_the_face_sweeps():
    # ∂/∂upper ∫ det J dγ = ∫ det J over the face
    rod = as_tip_map(NARROW, 1e-11)
    x, w = np.polynomial.legendre.leggauss(16)
    face = np.stack(np.meshgrid((1 + x) / 2, (1 + x) / 2, indexing="ij"), -1).reshape(-1, 2)
    cube = np.column_stack([np.ones(len(face)), face])
    stretch = np.linalg.det(rod.tips_and_slopes(rod.box.from_free_cube(cube))[1])
    swept = (np.outer(w, w).ravel() / 4) @ stretch * np.prod(rod.box.widths[1:])
    name = f"{NARROW.actuators[0].name}.upper"
    found = volume_gradient(NARROW, name).volume[0]
    assert found == pytest.approx(abs(swept), rel=1e-8)
    assert signed_volume(rod).value * swept > 0


def test_at_the_end_of_a_range_the_derivative_is_that_of_the_side_that_exists():
    straight = designs.minimal_trunk(np.radians(108), 0.0).with_bounds((-0.9, -0.3))
    found = volume_gradient(straight, "taper")
    ahead = [reachable_set(changed(straight, {"taper": h})).volume for h in (0.0, 1e-3, 2e-3)]
    expected = (4 * ahead[1] - 3 * ahead[0] - ahead[2]) / 2e-3
    assert found.volume[0] == pytest.approx(expected, rel=1e-3)


def test_the_derivative_by_a_field_of_an_own_actuator_is_that_of_the_same_tendon():
    """A cable at p = r (cos θ, sin θ) is a tendon: ∂V/∂r = cos θ ∂V/∂px + sin θ ∂V/∂py."""
    r, angle, bounds = 0.015, 0.1, (0.0, 2.0)
    x, y = r * np.cos(angle), r * np.sin(angle)
    ring = Ring(inner_ratio=0.5, material=Material(young_modulus=1e5))

    def driven_by(actuator):
        others = (Tendon(distance=r, offset=2.1 * k, activation_bounds=bounds) for k in (1, 2))
        return one_ring_arm(*others, actuator, rings=(ring,))

    cable = driven_by(Cable(name="c", place=(x, y), activation_bounds=bounds))
    tendon = driven_by(Tendon(name="t", distance=r, offset=angle, activation_bounds=bounds))
    own = volume_gradient(cable, ("c.place[0]", "c.place[1]")).volume
    same = volume_gradient(tendon, ("t.distance",)).volume
    assert own @ [np.cos(angle), np.sin(angle)] == pytest.approx(same[0], rel=1e-6)


def test_a_parameter_without_effect_has_derivative_zero():
    arm = rubber(NARROW, Loads()).replace(loads=None)
    found = volume_gradient(arm, "rings[0].material.density")
    assert found.volume[0] == pytest.approx(0.0, abs=1e-12)
    assert found.volume_error[0] < 1e-9


def test_units_and_route_are_told(narrow):
    stored = narrow.to_dataset()
    assert stored.attrs["route"] == "flux"
    assert dict(zip(narrow.parameters, narrow.units, strict=True))["taper"] == "rad"
    assert list(stored.parameter.values) == list(NAMES)
    assert "∂V/∂(taper)" in repr(narrow)


@pytest.mark.parametrize(
    ("arm", "names", "said"),
    [
        (NARROW, (), "parameters = none"),
        (NARROW, "tapper", 'did you mean "taper"'),
        (NARROW, ["taper", "taper"], "parameters = taper: must be given once"),
        (NARROW, "left.bundles", "continuously"),
        (NARROW, "rings[0].material.young_modulus", "one number"),
        (NARROW.with_bounds([(-0.5, -0.5), (-1, 0), (-1, 0)]), "taper", "2 free bundles"),
    ],
)
def test_what_has_no_derivative_is_refused_in_one_line(arm, names, said):
    with pytest.raises(InvalidInput) as caught:
        volume_gradient(arm, names)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_bound_that_would_free_a_held_bundle_is_refused():
    held = FOUR.with_bounds([(-0.5, -0.5), *FOUR.bounds[1:]])
    first = f"{held.actuators[0].name}.lower"
    with pytest.raises((InvalidInput, InvalidDesign)):
        volume_gradient(held, first)


def test_loaded_arms_have_derivatives_too():
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0, 0, 9.81)))
    found = volume_gradient(arm, "upper", accuracy=0.02)
    assert found.route == "raster"

    def volume(arm):
        return rasterized_set(as_tip_map(arm), 32, None, 0.02).volume

    value = find_parameter(arm, "upper").value(arm)
    low, high = (volume(changed(arm, {"upper": value + step})) for step in (-0.1, 0.1))
    expected = (high - low) / 0.2
    assert found.volume[0] == pytest.approx(expected, rel=0.05)


TURNS = {"left": -176, "right": 181, "longitudinal": 8}
FOLDED = changed(
    trunk_at(54, 2.7), {f"{name}.revolution": np.radians(turn) for name, turn in TURNS.items()}
)
FOUR = designs.redundant_trunk()


@cache
def rough(arm: Manipulator, *names: str) -> VolumeGradient:
    return volume_gradient(arm, names, accuracy=0.03)


of_some = pytest.mark.parametrize("arm", [FOLDED, FOUR], ids=["three", "four"])


@of_some
def test_rough_derivatives_grow_with_the_size_too(arm):
    found = rough(arm, "length", "outer_radius")
    sizes = np.array([arm.length, float(arm.profile.radius(0.0))])
    solid = found.solid
    assert found.route == ("raster" if arm is FOLDED else "search")
    off = sizes @ found.volume - 3.0 * solid.volume
    assert abs(off) < sizes @ found.volume_error + 3.0 * solid.volume_error
    assert abs(off) < 0.01 * solid.volume
    off = sizes @ found.convex_volume - 3.0 * solid.convex_volume
    assert abs(off) < sizes @ found.convex_volume_error + 3.0 * solid.convex_volume_error


@of_some
def test_where_all_actuators_turn_the_volume_stays(arm):
    found = rough(arm, *(f"{actuator.name}.offset" for actuator in arm.actuators))
    assert abs(found.volume.sum()) < found.volume_error.sum()
    assert found.volume_error.sum() < 0.4 * np.abs(found.volume).sum()
    assert abs(found.convex_volume.sum()) < found.convex_volume_error.sum()


@pytest.mark.parametrize(
    ("arm", "name", "step"),
    [
        (FOLDED, "left.offset", 0.01),
        (FOLDED, "taper", 0.02),
        pytest.param(FOUR, "lower", 0.05, marks=pytest.mark.large),
        pytest.param(FOUR, "left.extent", 0.05, marks=pytest.mark.large),
    ],
)
def test_rough_derivatives_are_those_of_finer_volumes_within_their_errors(arm, name, step):
    value = find_parameter(arm, name).value(arm)
    h, found = step * abs(value), rough(arm, name)
    ends = [reachable_set(changed(arm, {name: value + k * h}), accuracy=2e-3) for k in (-1, 1)]
    expected = (ends[1].volume - ends[0].volume) / (2 * h)
    assert abs(found.volume[0] - expected) < found.volume_error[0]
    assert found.volume_error[0] < 0.15 * abs(expected)


@pytest.mark.large
def test_five_bundles_have_derivatives_of_finer_volumes():
    found = volume_gradient(FIVE, ("length", "outer_radius", "lower"), accuracy=0.02)
    scaled, error = (each[:2] @ [1.0, 0.06] / 3.0 for each in (found.volume, found.volume_error))
    assert abs(scaled - found.solid.volume) < error + found.solid.volume_error
    ends = [reachable_set(changed(FIVE, {"lower": low}), accuracy=5e-3) for low in (-1.25, -1.15)]
    change = (ends[1].volume - ends[0].volume) / 0.1
    assert found.volume[2] == pytest.approx(change, abs=found.volume_error[2])


@of_some
def test_what_moves_in_two_halves_of_space_is_what_moves(arm):
    samples, parameter = boundary_samples(rough(arm, "taper").solid.image), "taper"
    tips = TipDerivatives(as_tip_map(arm), [find_parameter(arm, parameter)])
    slopes, right = tips.at(samples.cube), samples.places[:, 0] > 0.0
    halves = [samples.derivative(slopes, weights)[0] for weights in (right, ~right)]
    assert sum(halves) == pytest.approx(samples.derivative(slopes)[0], rel=1e-12)
    assert samples.area.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    volume = (samples.area * samples.places).sum() / 3.0
    assert volume == pytest.approx(rough(arm, "taper").solid.volume, rel=0.05)
    # A tip map takes each sample's activation to where the boundary is.
    rod = as_tip_map(arm)
    off = rod.tips(rod.box.from_free_cube(samples.cube)) - samples.places
    assert np.median(np.linalg.norm(off, axis=1)) < 0.01


def test_what_moves_in_one_half_is_the_volume_s_derivative_there():
    """All actuators turned about the axis turn the set: what enters a half crosses its plane."""
    arm = FOLDED
    solid = rough(arm, "taper").solid
    names = [f"{actuator.name}.offset" for actuator in arm.actuators]
    samples = boundary_samples(solid.image)
    tips = TipDerivatives(as_tip_map(arm), [find_parameter(arm, name) for name in names])
    found = samples.derivative(tips.at(samples.cube), samples.places[:, 0] > 0.0).sum()
    # ω × r = (-y, x, 0): through the plane x = 0 into x > 0 flows ∫ -y over the cut.
    grid = solid.grid
    cut = grid.occupied.astype(float).interp(x=0.0)
    expected = float((-cut * grid.y).sum()) * grid.attrs["cell"] ** 2
    assert found == pytest.approx(expected, rel=0.05, abs=0.005)
