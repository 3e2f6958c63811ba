"""Laws of tendons driven by length: least energy, closed forms, slack, and derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softreach as sr
from softreach import compute_cloud, configuration, export, plot, reachable_set, solve_inverse
from softreach.arm import (
    FiberArchitecture,
    LengthTendon,
    LinearTaper,
    Loads,
    Manipulator,
    Material,
    Ring,
    Section,
)
from softreach.arm.tensions import LengthLaw
from softreach.cli.app import run
from softreach.rod import TipStatus
from softreach.rod.rods import as_tip_map
from softreach.sampling import SAMPLERS
from softreach.support.errors import InvalidDesign
from tests.laws import tensions_of_lengths
from tests.oracles.pulled_tendons import HeavyPulledArm, PulledArm

LENGTH, RADIUS, MODULUS, DISTANCE = 0.3, 0.01, 1e6, 0.008
K0, K1 = math.pi * MODULUS * RADIUS**2, math.pi / 4 * MODULUS * RADIUS**4
BOUNDS = (-0.02, 0.02)


def section(**matter):
    return Section(rings=(Ring(inner_ratio=0.0, material=Material(poisson_ratio=0.4, **matter)),))


SECTION = section(young_modulus=MODULUS)


def arm_of(*actuators, taper=0.0):
    profile = LinearTaper(length=LENGTH, outer_radius=RADIUS, taper=taper)
    return Manipulator(profile=profile, section=SECTION, actuators=actuators)


def tendons(bundles=3, **fields):
    defaults = {"distance": DISTANCE, "activation_bounds": BOUNDS, "bundles": bundles}
    return LengthTendon(**(defaults | fields))


@st.composite
def pulled_arms(draw):
    """Arms with one or two sets of tendons of any route and stiffness, perhaps with a fiber."""
    number = st.floats
    sets = []
    for k in range(draw(st.integers(1, 2))):
        stiffness = draw(st.none() | number(200, 1e5))
        sets.append(
            tendons(
                bundles=draw(st.integers(1, 4)),
                name=f"t{k}",
                distance=draw(number(0.003, 0.012)),
                offset=draw(number(-3, 3)),
                revolution=draw(st.just(0.0) | number(-3, 3)),
                start_over_length=draw(st.sampled_from([0.0, 0.2])),
                end_over_length=draw(st.sampled_from([0.55, 1.0])),
                tendon_stiffness=stiffness,
                slack=draw(number(-0.002, 0.002)),
                pretension=draw(number(0, 1)) if stiffness else 0.0,
            )
        )
    fiber = FiberArchitecture(revolution=1.0, extent=0.6, activation_bounds=(-0.2, 0.0))
    others = (fiber,) if draw(st.booleans()) else ()
    return arm_of(*sets, *others, taper=draw(number(-0.005, 0.015)))


def random_activations(arm, n, seed=0):
    low, high = arm.bounds.T
    return low + np.random.default_rng(seed).random((n, arm.bundles)) * (high - low)


def test_a_soft_cable_stretches_in_series():
    stiffness, pretension, slack = 500.0, 0.7, 0.001
    tendon = tendons(1, tendon_stiffness=stiffness, pretension=pretension, slack=slack)
    (tension,) = tensions_of_lengths(arm_of(tendon), [[0.01]])[0]
    arm = LENGTH * (1 / K0 + DISTANCE**2 / K1)
    expected = (0.01 - slack + pretension / stiffness) / (arm + 1 / stiffness)
    assert tension == pytest.approx(expected, rel=1e-12)


def test_alike_tendons_compress_the_arm():
    """All pulled in by q: the arm stays straight, and Σ τ = K0 q/L is large but finite."""
    tension = tensions_of_lengths(arm_of(tendons(3)), [[0.01] * 3])[0]
    np.testing.assert_allclose(tension, K0 * 0.01 / LENGTH / 3, rtol=1e-12)


def test_a_tendon_that_is_paid_out_is_slack_and_pulls_nothing():
    tension = tensions_of_lengths(arm_of(tendons(3)), [[0.01, -0.02, -0.02], [-0.01] * 3])
    assert tension[0, 0] > 0
    assert (tension[0, 1:] == 0).all()
    assert (tension[1] == 0).all()


def test_tensions_of_redundant_tendons_are_some_that_shorten_them_as_wanted():
    """Four inextensible tendons around one section: three numbers decide its strains."""
    law = LengthLaw(arm_of(tendons(4)))
    pulled = random_activations(law.arm, 200)
    tension, taut = law.tensions(pulled)
    left = law.works.of(tension) - law.at_rest - pulled
    assert (tension >= 0).all()
    assert (left > -1e-15).all()
    assert (np.abs(left[taut]) < 1e-15).all()


@given(arm=pulled_arms())
def test_slopes_are_those_of_differences_where_the_taut_stay_taut(arm):
    law, step = LengthLaw(arm), 1e-7
    pulled = random_activations(arm, 8)
    tension, taut = law.tensions(pulled)
    inner = law.with_tensions(pulled, tension)
    slopes = law.slopes(inner, taut)[:, law.columns]
    for k in range(arm.bundles):
        moved = pulled + step * np.array([[[-1.0]], [[1.0]]]) * np.eye(arm.bundles)[k]
        ends = [law.tensions(each) for each in moved]
        same = np.all([(each.is_taut == taut).all(axis=1) for each in ends], axis=0)
        difference = (ends[1].tension - ends[0].tension) / (2 * step)
        scale = np.abs(slopes).max() + np.abs(tension).max() / step * 1e-12
        np.testing.assert_allclose(difference[same], slopes[same, :, k], atol=1e-5 * scale)


def test_a_pretension_needs_a_cable_that_stretches():
    with pytest.raises(InvalidDesign, match=r"pretension = 2.*tendon_stiffness"):
        tendons(1, pretension=2.0)


def tip_misses(arm, count, seed=0):
    """Distances of tips from those of least energy [m]."""
    pulled = random_activations(arm, count, seed)
    tips = as_tip_map(arm, 1e-10).tips(pulled)
    return [math.dist(tip, PulledArm(arm, x).tip()) for tip, x in zip(tips, pulled, strict=True)]


@settings(max_examples=4)
@given(arm=pulled_arms())
def test_tips_are_those_of_least_energy(arm):
    assert max(tip_misses(arm, 2)) < 1e-7 * LENGTH


@pytest.mark.large
@settings(max_examples=50)
@given(arm=pulled_arms(), seed=st.integers(0, 2**32 - 1))
def test_tips_of_many_arms_are_those_of_least_energy(arm, seed):
    assert max(tip_misses(arm, 3, seed)) < 1e-7 * LENGTH


def heavy(arm, payload=0.02, gravity=(0.0, 9.81, 0.0)):
    matter = section(young_modulus=4e6, density=1000.0)
    return arm.replace(section=matter, loads=Loads(gravity=gravity, payload=payload))


def loaded_miss(arm, pulled):
    """Distance of the tip from that of least energy [m]."""
    return math.dist(as_tip_map(arm, 1e-9).tips([pulled])[0], HeavyPulledArm(arm, pulled).tip())


def test_a_tip_under_loads_is_that_of_least_energy():
    assert loaded_miss(heavy(arm_of(tendons(3))), np.array([0.004, -0.01, 0.002])) < 1e-7 * LENGTH


@pytest.mark.large
@pytest.mark.parametrize("seed", range(50))
def test_tips_under_loads_are_those_of_least_energy(seed):
    rng = np.random.default_rng(seed)
    turns, slack = rng.choice([0.0, rng.uniform(-2, 2)]), rng.uniform(-1e-3, 1e-3)
    fields = {"revolution": turns, "slack": slack, "distance": rng.uniform(0.004, 0.01)}
    gravity = 9.81 * rng.normal(size=3)
    arm = heavy(arm_of(tendons(int(rng.integers(2, 5)), **fields)), rng.uniform(0, 0.03), gravity)
    assert loaded_miss(arm, random_activations(arm, 1, seed)[0] * 0.7) < 1e-7 * LENGTH


@pytest.mark.parametrize("stiffness", [None, 2000.0])
def test_under_loads_taut_tendons_are_as_long_as_they_are_to_be(stiffness):
    """By the drawn lengths in a plane; slack ones are no longer than what is paid out."""
    arm = heavy(arm_of(tendons(2, offset=math.pi / 2, tendon_stiffness=stiffness)))
    pulled = random_activations(arm, 12)
    shapes = configuration(arm, pulled, tol=1e-9)
    tension, compliance = shapes.bundle_activation.values, 1 / stiffness if stiffness else 0.0
    left = tension * compliance + LENGTH - shapes.line_length.values - pulled
    assert (tension >= 0).all()
    assert (tension > 0).any()
    assert (tension == 0).any()
    assert (left > -1e-9 * LENGTH).all()
    assert (np.abs(left[tension > 0]) < 1e-9 * LENGTH).all()


@pytest.mark.parametrize("loads", [{}, {"follower_force": (0.02, 0.0, 0.0)}])
def test_slopes_under_loads_are_those_of_differences(loads):
    """Dead loads have a linear response; those that follow the tip are moved by hand."""
    arm = heavy(arm_of(tendons(3)))
    arm = arm.replace(loads=arm.loads.replace(**loads))
    rod, step = as_tip_map(arm, 1e-10), 1e-6
    pulled = np.array([[0.01, -0.01, 0.002]])
    slopes = rod.tips_and_slopes(pulled)[1]
    for k, unit in enumerate(np.eye(3)):
        change = rod.tips(pulled + step * unit) - rod.tips(pulled - step * unit)
        np.testing.assert_allclose(slopes[..., k], change / (2 * step), atol=2e-6)


def test_a_displacement_beyond_the_length_is_told():
    with pytest.raises(InvalidDesign, match=r"displacement_bounds.*with extension ζ = -"):
        as_tip_map(arm_of(tendons(1, activation_bounds=(0.0, 1.5), distance=1e-4)))


def test_a_length_driven_arm_has_clouds_sets_and_inverses():
    arm = arm_of(tendons(3), tendons(1, name="out", end_over_length=0.5, offset=1.0))
    rod = as_tip_map(arm)
    cloud = compute_cloud(arm, n=64)
    assert cloud.activation.attrs["units"] == "m"
    np.testing.assert_allclose(rod.tips(cloud.activation.values), cloud.tip, atol=1e-12)
    wanted = rod.tips([[0.012, 0.008, -0.01, 0.004]])
    (answer,) = solve_inverse(arm, wanted)
    assert math.dist(rod.tips(answer.activations)[0], wanted[0]) < 1e-6 * LENGTH


def test_the_set_of_a_length_driven_arm_holds_its_tips():
    arm = arm_of(tendons(3, activation_bounds=(0.0, 0.02)))
    region = reachable_set(arm, accuracy=0.02)
    tips = as_tip_map(arm).tips(random_activations(arm, 50))
    assert np.mean(region.contains(tips)) > 0.9
    assert not region.contains([[0.0, 0.0, 1.1 * LENGTH]]).any()


# A rod without actuators is an arm: against closed forms, and through everything asked of arms


AT_REST = np.zeros((1, 0))
ONE, THIN, DENSITY, YOUNG = 1.0, 1e-4, 1000.0, 1e9


def rod(loads=None, radius=THIN, density=DENSITY, young=YOUNG):
    """So thin that it does not stretch."""
    arm = sr.Manipulator.tapered(
        length=ONE,
        outer_radius=radius,
        inner_radius=0.0,
        young_modulus=young,
        density=density,
        actuators=(),
    )
    return arm.replace(loads=loads)


THICK = rod(sr.Loads(gravity=(9.81, 0.0, 0.0)), radius=0.05, young=1e6)
FREE = rod()
both = pytest.mark.parametrize("arm", [FREE, THICK], ids=["free", "loaded"])


@both
def test_it_has_one_tip_and_shape(arm):
    tip = sr.tip_positions(arm, AT_REST)
    assert sr.tip_jacobian(arm, AT_REST).shape == (1, 6, 0)
    shape = sr.configuration(arm, [])
    np.testing.assert_allclose(shape.position[-1], tip[0], atol=1e-6)
    if arm is FREE:
        np.testing.assert_allclose(tip, [[0.0, 0.0, ONE]], atol=1e-15)
        np.testing.assert_allclose(shape.position[:, 2], shape.Z, atol=1e-14)
    assert shape.sizes["bundle"] == 0
    np.testing.assert_array_equal(as_tip_map(arm).status(np.zeros((3, 0))), [TipStatus.STABLE] * 3)
    with pytest.raises(sr.InvalidInput, match=r"\(n, 0\)"):
        sr.tip_positions(arm, np.zeros((1, 1)))


@both
@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_cloud_repeats_its_tip(arm, sampler):
    cloud = sr.compute_cloud(arm, n=10, sampler=sampler)
    np.testing.assert_allclose(cloud.tip, np.tile(sr.tip_positions(arm, AT_REST), (10, 1)))
    assert sr.convex_hull(cloud.tip).volume == 0.0


@both
def test_its_reachable_set_is_a_point(arm):
    found = sr.reachable_set(arm)
    assert found.dimension == 0
    np.testing.assert_allclose(found.mesh.vertices, sr.tip_positions(arm, AT_REST), atol=1e-6)


@both
def test_the_inverse_reaches_its_tip_and_nothing_else(arm):
    tip = as_tip_map(arm, 1e-10).tips(AT_REST)[0]
    here, elsewhere = sr.solve_inverse(as_tip_map(arm, 1e-10), [tip, tip + [0.0, 0.1, 0.0]])
    assert here.activations.shape == (1, 0)
    assert elsewhere.status.name == "UNREACHABLE"
    assert elsewhere.gap == pytest.approx(0.1, abs=1e-6)


def test_what_never_rests_is_refused():
    upright = THICK.replace(loads=sr.Loads(payload=2.0))
    with pytest.raises(sr.InvalidInput, match="none of 1 activations tried"):
        sr.reachable_set(upright)


@both
def test_files_and_bounds_hold_it(arm, tmp_path):
    arm.save(tmp_path / "rod.toml")
    assert sr.Manipulator.load(tmp_path / "rod.toml") == arm
    assert arm.with_bounds((0, 1)) == arm
    assert "passive" in repr(arm)
    assert sr.describe(arm).bundle_extension.shape == (0, 2)


def test_a_file_without_the_key_has_forgotten_its_actuators():
    text = FREE.to_toml().replace("actuators = []\n", "")
    with pytest.raises(sr.InvalidDesign, match="actuators: required key is missing"):
        sr.Manipulator.from_toml(text)


@both
def test_pictures_and_exports_show_it(arm, tmp_path):
    shape, cloud = sr.configuration(arm, []), sr.compute_cloud(arm, n=10)
    plot.save_figure(plot.plot_views(cloud, arm, shape), tmp_path / "views.png")
    plot.save_figure(plot.plot_cross_section(arm), tmp_path / "section.png")
    plot.save_figure(plot.plot_equilibria(sr.equilibria(arm, [])), tmp_path / "equilibria.png")
    export.export_arm(arm, shape, tmp_path / "arm.stl")
    export.export_cloud(cloud, tmp_path / "cloud.csv")
    sr.save_cloud(cloud, tmp_path / "cloud.zarr")
    assert sr.open_cloud(tmp_path / "cloud.zarr").sizes["bundle"] == 0


def test_the_command_line_takes_it(tmp_path, capsys):
    design, cloud = str(tmp_path / "rod.toml"), str(tmp_path / "rod.zarr")
    THICK.save(design)
    for arguments in (
        ["design", design],
        ["cloud", design, "--n", "10", "--out", cloud],
        ["show", cloud, "--out", str(tmp_path / "rod.png")],
        ["reach", design],
        ["equilibria", design, "--out", str(tmp_path / "all.png")],
        ["equilibria", design, "--json"],
    ):
        assert run(arguments) == 0, capsys.readouterr().err
    assert '"degree": 1' in capsys.readouterr().out
