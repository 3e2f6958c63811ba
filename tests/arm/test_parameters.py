"""Laws of design parameters: what an arm has of each, and what becomes of it when one changes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm import designs
from softreach.arm.actuators import Chamber, FiberArchitecture, Tendon
from softreach.arm.base import Base
from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Written, changed, find_parameter, parameters, shifted
from softreach.arm.part import Samples
from softreach.arm.profile import PiecewiseTaper
from softreach.arm.section import Material, Measured, Ring, Section, name_faults
from softreach.rod.kinematics import tip_positions
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.cable import Cable
from tests.calibration.arms import pulled_wire
from tests.laws import arm_of, arms, in_box

SAMPLED = Samples(stations_over_length=(0.0, 0.3, 1.0), values=(0.0, 0.1, 0.3))
SKIN = Material(young_modulus=2e5, density=1100.0)


def made_arm() -> Manipulator:
    """An arm of many parts, with every kind of number that an arm can have."""
    rings = (
        Ring(inner_ratio=0.5, outer_ratio=0.8, material=SKIN.replace(young_modulus=1e5)),
        Ring(inner_ratio=0.8, material=SKIN, name="skin"),
    )
    return Manipulator(
        profile=PiecewiseTaper(
            length=0.3, stations_over_length=(0.0, 0.4, 1.0), radii=(0.02, 0.015, 0.01)
        ),
        section=Section(
            rings=rings,
            core=Material(young_modulus=5e4, density=900.0),
            bore_ratio=0.1,
            measured=Measured(bending_stiffness=0.1, mass_per_length=0.3),
        ),
        actuators=(
            FiberArchitecture(
                name="left", ring="skin", helical_angle=SAMPLED, extent=0.5, bundles=2
            ),
            Tendon(name="pull", distance=0.008, revolution=-1.0, activation_bounds=(0.0, 5.0)),
            Tendon(
                name="bent",
                distance=Samples(stations_over_length=(0.0, 1.0), values=(0.01, 0.005)),
                routing=SAMPLED,
                activation_bounds=(0.0, 5.0),
            ),
            Chamber(name="air", distance_ratio=0.5, radius_ratio=0.1, activation_bounds=(0.0, 1e4)),
        ),
        loads=Loads(payload=0.1),
        base=Base(position=(0.3, -0.2, 1.5), points="down", turn=0.7),
    )


VALUES = {"lower": -0.8, "upper": -0.05}
"""Of fields that 0.3 would make an impossible trunk of."""


def value_of(arm, name):
    return find_parameter(arm, name).value(arm)


@given(arms())
def test_the_values_that_an_arm_has_make_the_same_arm(arm):
    gamma = in_box(arm, 3)
    tips = tip_positions(arm, gamma)
    # Ω and α say the same
    own = {n: one.value(arm) for n, one in parameters(arm).items() if one.field != "helical_angle"}
    own = {name: value for name, value in own.items() if not math.isnan(value)}
    np.testing.assert_allclose(tip_positions(changed(arm, own), gamma), tips, atol=1e-9)


def uneven_arm() -> Manipulator:
    """An arm whose parts have different values of all that they share."""
    trunk = designs.minimal_trunk()
    left, right, longitudinal = trunk.fibers
    return trunk.replace(
        actuators=(
            left.replace(revolution=-1.0, extent=0.3, activation_bounds=(-0.9, -0.3)),
            right.replace(revolution=0.5, extent=0.4, activation_bounds=(-0.8, -0.35)),
            longitudinal.replace(bundles=2, activation_bounds=((-0.7, -0.2), (-0.6, -0.1))),
        )
    )


ARMS = {name: getattr(designs, name) for name in designs.__all__} | {"uneven_arm": uneven_arm}


@pytest.mark.parametrize(
    "design",
    [
        pytest.param(name, marks=[pytest.mark.large] if name == "elephant_trunk" else [])
        for name in ARMS
    ],
)
def test_an_arm_that_is_given_a_value_that_it_has_stays_as_it_is(design):
    arm = ARMS[design]()
    for name, one in parameters(arm).items():
        if not math.isnan(value := one.value(arm)):
            assert_alike(changed(arm, {name: value}), arm)


UNEVEN = ("revolution", "extent", "lower", "upper", "longitudinal.lower", "longitudinal.upper")


@pytest.mark.parametrize("name", UNEVEN)
def test_what_parts_share_has_no_value_where_they_differ_and_can_be_set(name):
    arm = uneven_arm()
    assert math.isnan(value_of(arm, name))
    value = VALUES.get(name.rpartition(".")[2], 0.3)
    assert value_of(changed(arm, {name: value}), name) == value


@pytest.mark.parametrize("name", UNEVEN)
def test_a_shift_moves_all_that_share_a_parameter_from_their_own_values(name):
    arm = uneven_arm()
    one = find_parameter(arm, name)
    made, moved = shifted(arm, one, 0.01), np.array(one.values(arm)) + 0.01
    np.testing.assert_allclose(one.values(made), moved, rtol=1e-12)
    assert value_of(made, "left.revolution") < 0.0  # it keeps its sense


def test_no_values_change_nothing(trunk):
    assert changed(trunk, {}) is trunk


NAMES = st.text(min_size=1, max_size=8).filter(lambda name: not [*name_faults([name], "actuators")])


@given(st.lists(NAMES, min_size=2, max_size=3, unique=True))
def test_every_actuator_has_parameters_of_its_own_whatever_it_is_called(names):
    fibers = [FiberArchitecture(name=name, revolution=0.5, extent=0.3) for name in names]
    arm = arm_of(*fibers)
    assert len([one for one in parameters(arm).values() if one.field == "offset"]) == len(names)
    made = changed(arm, {f"{name}.offset": k + 1 for k, name in enumerate(names)})
    assert [fiber.offset for fiber in made.fibers] == list(range(1, len(names) + 1))


def test_a_valid_design_behind_an_invalid_one_is_found():
    base = designs.minimal_trunk(taper=np.radians(3))
    with pytest.raises(InvalidDesign, match="leaves no tip"):
        changed(base, {"outer_radius": 0.01})
    assert value_of(changed(base, {"outer_radius": 0.01, "taper": 0.0}), "outer_radius") == 0.01


def test_all_faults_are_named_at_once_and_by_their_owner(trunk):
    with pytest.raises(InvalidDesign) as caught:
        changed(trunk, {"radius_ratio": 1.0, "left.extent": 7.0, "right.bundles": 1.5})
    paths = [fault.path for fault in caught.value.faults]
    assert paths == ["radius_ratio", "left.extent", "right.bundles"]


@pytest.mark.parametrize("name", ["revolution", "left.revolution"])
def test_revolutions_stay_when_the_taper_changes(name):
    angled = [
        FiberArchitecture(name="left", helical_angle=-0.1, extent=0.3),
        FiberArchitecture(name="right", helical_angle=0.1, extent=0.3),
    ]
    arm = arm_of(*angled)
    tapered = changed(arm, {"taper": 0.02})
    assert value_of(tapered, name) == pytest.approx(value_of(arm, name), rel=1e-12)
    assert value_of(tapered, "left.helical_angle") != value_of(arm, "left.helical_angle")


def test_a_new_outer_radius_keeps_the_ratio_and_the_helical_angles():
    arm = arm_of(FiberArchitecture(name="left", helical_angle=0.1, extent=0.3))
    wide = changed(arm, {"outer_radius": 0.1})
    assert value_of(wide, "radius_ratio") == value_of(arm, "radius_ratio")
    assert value_of(wide, "left.helical_angle") == 0.1


def test_helical_fibers_keep_their_sense_and_longitudinal_ones_stay(trunk):
    turned = changed(trunk, {"revolution": 0.7})
    turns = [value_of(turned, f"{name}.revolution") for name in ("left", "right", "longitudinal")]
    assert turns == [-0.7, 0.7, 0.0]


@pytest.mark.parametrize("order", [1, -1])
def test_an_actuators_own_value_wins_over_that_of_all(trunk, order):
    pairs = [("extent", 0.5), ("left.extent", 0.2), ("taper", 0.0), ("left.helical_angle", 0.05)]
    made = changed(trunk, dict(pairs[::order]))
    assert [fiber.extent for fiber in made.fibers] == [0.2, 0.5, 0.5]
    assert value_of(made, "left.helical_angle") == 0.05


def test_a_bound_changes_alone():
    pairs = ((-1.0, 0.1), (-0.5, 0.2))
    fiber = FiberArchitecture(revolution=0.0, extent=0.3, bundles=2, activation_bounds=pairs)
    arm = arm_of(fiber, activation_bounds=None)
    np.testing.assert_array_equal(changed(arm, {"lower": -0.8}).bounds, [[-0.8, 0.1], [-0.8, 0.2]])


@pytest.mark.parametrize(
    ("name", "meant"),
    [("tapper", "taper"), ("offset_left", "left.offset"), ("lefd.offset", "left.offset")],
)
def test_an_unknown_parameter_costs_one_line_with_the_closest_one(trunk, name, meant):
    for ask in (lambda: changed(trunk, {name: 1.0}), lambda: find_parameter(trunk, name)):
        with pytest.raises(
            InvalidInput, match=f'parameter = {name}.*did you mean "{meant}"'
        ) as caught:
            ask()
        assert "\n" not in str(caught.value)


def nudged(name: str, value: float) -> float:
    """Another value near one that an arm has, at which it can still exist."""
    if math.isnan(value):
        return 0.1 if any(each in name for each in ("angle", "distance", "disk")) else 1000.0
    if name.endswith(("bundles", "guides")):
        return value + 1
    below = name.endswith(("end_over_length", ".end", "inner_ratio", "bore_ratio", "poisson_ratio"))
    step = 0.01 * abs(value) or 0.005
    return value - step if below else value + step


@pytest.mark.parametrize(
    "name", [name for name in parameters(made_arm()) if name != "rings[1].outer_ratio"]
)
def test_every_number_of_any_arm_is_a_parameter_that_changes_alone(name):
    arm = made_arm()
    was = {other: one.value(arm) for other, one in parameters(arm).items()}
    made = changed(arm, {name: (value := nudged(name, was[name]))})
    assert find_parameter(made, name).value(made) == pytest.approx(value, rel=1e-12)
    # Setting the old value again leads back, so nothing else was touched or lost on the way.
    if not math.isnan(was[name]) and name not in REPLACING:
        assert_alike(changed(made, {name: was[name]}), arm)


REPLACING = {
    "left.revolution",  # of an angle along the arm: replaces it
    "bent.revolution",  # of a routing: replaces it
    "pull.distance_ratio",  # replaces a distance
    "air.distance",  # replaces a ratio
    "air.radius",
}


def assert_alike(made, arm):
    """Equal but for rounding."""
    assert parameters(made).keys() == parameters(arm).keys()
    for name, one in parameters(arm).items():
        assert one.value(made) == pytest.approx(one.value(arm), rel=1e-12, nan_ok=True), name


def test_every_number_that_an_arm_holds_is_listed():
    listed = parameters(made_arm())
    wanted = (
        "length bore_ratio profile.stations_over_length[1] profile.radii[2] rings[1].inner_ratio "
        "rings[0].outer_ratio rings[0].material.young_modulus rings[1].material.poisson_ratio "
        "rings[1].material.density core.young_modulus core.poisson_ratio left.offset left.extent "
        "left.bundles left.helical_angle.values[2] left.helical_angle.stations_over_length[1] "
        "left.lower left.upper left.lower[1] left.upper[0] left.start_over_length "
        "pull.distance pull.distance_ratio pull.revolution pull.end_over_length pull.upper "
        "bent.distance.values[1] bent.routing.values[2] bent.routing.stations_over_length[1] "
        "air.distance air.distance_ratio air.radius air.radius_ratio air.area_factor air.offset"
    )
    assert set(wanted.split()) <= listed.keys()


def test_parameters_of_the_whole_arm_come_first():
    owned = [bool(one.owner) for one in parameters(made_arm()).values()]
    assert owned == sorted(owned)


def test_a_ring_may_be_called_by_its_name():
    arm, name = made_arm(), "rings[skin].material.young_modulus"
    made = changed(arm, {name: 3e5})
    assert value_of(made, "rings[1].material.young_modulus") == value_of(made, name) == 3e5
    with pytest.raises(InvalidDesign, match=r"^rings\[skin\]\.inner_ratio = 2"):
        changed(arm, {"rings[skin].inner_ratio": 2})
    with pytest.raises(InvalidInput, match="given once"):
        changed(arm, {name: 3e5, "rings[1].material.young_modulus": 3e5})


def test_one_modulus_of_several_materials_asks_for_the_others(trunk):
    ring = trunk.section.rings[0]
    halves = (ring.replace(outer_ratio=0.9), ring.replace(inner_ratio=0.9))
    arm = trunk.replace(section=Section(rings=halves))
    with pytest.raises(InvalidDesign, match=r"^rings\[1\]\.material\.young_modulus: must be given"):
        changed(arm, {"rings[0].material.young_modulus": 1e5})
    both = {f"rings[{k}].material.young_modulus": 1e5 * (k + 1) for k in range(2)}
    assert all(value_of(changed(arm, both), name) == both[name] for name in both)


def test_one_ratio_of_poisson_is_of_all_materials():
    made = changed(made_arm(), {"poisson_ratio": 0.4, "core.poisson_ratio": 0.3})
    ratios = [layer.material.poisson_ratio for layer in made.section.layers]
    assert ratios == [0.3, 0.4, 0.4]


def test_rings_that_begin_together_have_one_ratio(trunk):
    ring = trunk.section.rings[0]
    arm = trunk.replace(section=Section(rings=(ring, ring, ring)))
    made = changed(arm, {"radius_ratio": 0.5, "rings[1].inner_ratio": 0.6})
    assert [one.inner_ratio for one in made.section.rings] == [0.5, 0.6, 0.5]
    assert "radius_ratio" not in parameters(made_arm())


def test_a_new_outer_radius_scales_all_radii_but_those_given():
    made = changed(made_arm(), {"outer_radius": 0.04, "profile.radii[2]": 0.012})
    radii = [value_of(made, f"profile.radii[{k}]") for k in range(3)]
    assert radii == pytest.approx([0.04, 0.03, 0.012], rel=1e-15)


def test_angles_along_the_arm_stay_when_the_taper_changes(trunk):
    arm = trunk.replace(actuators=(trunk.fibers[0].replace(helical_angle=SAMPLED),))
    made = changed(arm, {"taper": 0.01, "revolution": 1.0})
    assert made.fibers[0].helical_angle == SAMPLED


@pytest.mark.parametrize(("name", "value"), [("left.helical_angle", 0.1), ("left.revolution", 1.0)])
def test_one_number_replaces_values_along_the_arm(name, value):
    assert value_of(changed(made_arm(), {name: value}), name) == value


def test_all_that_is_helical_turns_in_its_own_sense():
    made = changed(made_arm(), {"revolution": 2.0})
    assert value_of(made, "pull.revolution") == -2.0
    assert value_of(made, "bent.routing.values[2]") == SAMPLED.values[2]


@pytest.mark.parametrize(
    ("values", "faults"),
    [
        ({"left.lower[1]": 1.0}, [r"left.lower[1] = 1: must have lower <= upper"]),
        ({"pull.lower": -1.0}, ["pull.lower = -1: must be at least 0 N"]),
        ({"left.bundles": 1, "left.lower[1]": -1.0}, ["left.lower[1] = -1: has no bundle"]),
        (
            {"left.helical_angle.stations_over_length[1]": 1.0},
            ["left.helical_angle.stations_over_length[1] = 1: must be a finite number > 0"],
        ),
        ({"pull.distance": 0.1, "pull.distance_ratio": 0.1}, ["pull.distance, pull.distance_rat"]),
        (
            {"length": -1.0, "rings[0].inner_ratio": 2.0, "core.density": -1.0, "bore_ratio": -1.0}
            | {"left.helical_angle.values[0]": 9.0, "air.area_factor": 0.0},
            ["length = -1", "bore_ratio = -1", "rings[0].inner_ratio = 2", "core.density = -1"]
            + ["left.helical_angle.values[0] = 9", "air.area_factor = 0"],
        ),
    ],
)
def test_faults_bear_the_names_that_were_asked_for(values, faults):
    with pytest.raises(InvalidDesign) as caught:
        changed(made_arm(), values)
    said = str(caught.value).splitlines()
    for text, start in zip(said, faults, strict=True):
        assert text.startswith(start)


def test_an_unknown_name_costs_the_parameters_of_its_part():
    with pytest.raises(InvalidInput) as caught:
        find_parameter(made_arm(), "left.helical_angle.value[1]")
    said = str(caught.value)
    assert "left.helical_angle.values[0] to [2]" in said
    assert "pull.offset" not in said
    assert said.endswith('did you mean "left.helical_angle.values[1]"?')


@pytest.mark.parametrize(
    "name", ["core", "profile", "loads", "rings[0]", "rings[0].material", "a.b", "a\nb", " a", "]"]
)
def test_an_actuator_whose_name_paths_would_mix_up_is_refused(trunk, name):
    first, *others = trunk.actuators
    with pytest.raises(InvalidDesign, match=r"actuators\[0\]\.name = ") as caught:
        trunk.replace(actuators=(first.replace(name=name), *others))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["0", "12", "a.b", "a]", "a\tb"])
def test_a_ring_whose_name_paths_would_mix_up_is_refused(trunk, name):
    ring = trunk.section.rings[0].replace(name=name)
    with pytest.raises(InvalidDesign, match=r"rings\[0\]\.name = "):
        trunk.section.replace(rings=(ring,))


@pytest.mark.parametrize("value", ["x", None, [1], True, 1j, np.array([1.0, 2.0])])
@pytest.mark.parametrize(
    "name", ["taper", "revolution", "left.bundles", "left.lower", "outer_radius", "extent"]
)
def test_a_value_that_is_no_number_is_refused_by_the_name_of_the_parameter(trunk, name, value):
    with pytest.raises(InvalidDesign, match=f"^{name}.*must be a (finite|whole) number"):
        changed(trunk, {name: value})


def test_written_names_carry_their_unit_before_the_place_in_a_series():
    written = Written.of(made_arm()).written
    wanted = (
        "length_m bore_ratio profile.radii_m[1] rings[0].material.young_modulus_pa "
        "rings[skin].material.density_kg_m3 left.helical_angle.values_deg[2] left.lower[1] "
        "pull.upper_n air.upper_pa left.bundles"
    )
    assert set(wanted.split()) <= written.keys()
    assert written["left.helical_angle.values_deg[2]"].name == "left.helical_angle.values[2]"


def test_bounds_of_different_units_are_no_common_parameter(trunk):
    known = parameters(trunk.replace(actuators=(*trunk.actuators, Cable(place=(0.0, 0.01)))))
    assert known["cable 4.lower"].unit == "N"
    assert "lower" not in known


def test_a_number_of_each_bundle_is_one_for_all_or_one_for_each():
    arm = pulled_wire()
    one = changed(arm, {"s1.slack[1]": 1e-3})
    assert one.actuators[0].slack == (0.0, 1e-3, 0.0)
    assert parameters(one)["s1.slack"].values(one) == (0.0, 1e-3, 0.0)
    assert changed(one, {"s1.slack": 2e-3}).actuators[0].slack == 2e-3
    assert Manipulator.from_toml(one.to_toml()) == one
    for wrong in ([1e-3], [1e-3, np.nan, 0.0], [], "x", (1e-3, True, 0.0), [[1e-3] * 3]):
        with pytest.raises(InvalidDesign, match="slack"):
            arm.actuators[0].replace(slack=wrong)


def test_bundles_may_be_counted_clockwise_or_stand_unevenly():
    """The angle of each is a number of its own, and the shape is that of bundles by themselves."""
    arm = pulled_wire()
    inner = arm.actuators[0]
    clockwise = inner.replace(offset=np.radians([0.0, -120.0, -240.0]).tolist())
    np.testing.assert_allclose(
        np.cos(clockwise.start_angles), np.cos(inner.replace(offset=0.0).start_angles)
    )
    turned = arm.replace(actuators=(clockwise, arm.actuators[1]))
    pulled = np.array([[0.002, 0.0, 0.001, 0.0, 0.001, 0.0]])
    other = changed(arm, {"s1.offset": 0.0})
    np.testing.assert_allclose(
        tip_positions(turned, pulled), tip_positions(other, pulled[:, [0, 2, 1, 3, 4, 5]])
    )
    assert Manipulator.from_toml(turned.to_toml()) == turned
    one = changed(arm, {"s1.offset[2]": 0.5})
    np.testing.assert_array_equal(one.actuators[0].start_angles[:2], inner.start_angles[:2])
    assert one.actuators[0].start_angles[2] == 0.5
    assert changed(turned, {"s1.offset": 0.0}).actuators[0] == inner
