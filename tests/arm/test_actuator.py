"""A new kind of actuator is one object: nothing else needs to know of it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    Chamber,
    Drive,
    FiberArchitecture,
    LengthTendon,
    Manipulator,
    Tendon,
    designs,
    parameters,
)
from softreach.arm.parameters import changed
from softreach.arm.tables import tables
from softreach.cli.app import run
from softreach.export import export_cloud
from softreach.rod.rods import as_tip_map
from softreach.rod.summary import design_warnings
from softreach.support.errors import InvalidDesign
from tests.cable import Cable
from tests.laws import arm_of, in_box, integrated_tip
from tests.made_arms import antagonists, one_ring_arm

PLACE = (0.03, 0.04)


def cylinder(*actuators, **changes):
    return arm_of(*actuators, activation_bounds=None, **changes)


@given(
    place=st.tuples(st.floats(-0.06, 0.06), st.floats(-0.06, 0.06)).filter(
        lambda p: math.hypot(*p) > 1e-3
    ),
    tension=st.floats(1e-5, 1e-3),
)
def test_a_cable_bends_a_shortened_arm_to_a_circle(place, tension):
    """ζ = 1 - T/K0, and the curvature T |p| / K1 per length at rest, toward the cable."""
    arm = cylinder(Cable(place=place))
    radius = arm.profile.outer_radius
    zeta = 1 - tension / (math.pi * radius**2)
    curvature = tension * math.hypot(*place) / (math.pi / 4 * radius**4)
    angle, bent = curvature * arm.length, zeta / curvature
    x, y, z = sr.tip_positions(arm, [[tension]], tol=1e-12)[0]
    assert z == pytest.approx(bent * math.sin(angle), abs=1e-12)
    assert math.hypot(x, y) == pytest.approx(bent * (1 - math.cos(angle)), abs=1e-12)
    away = math.remainder(math.atan2(y, x) - math.atan2(place[1], place[0]), 2 * math.pi)
    assert math.hypot(x, y) * abs(away) < 1e-12


def test_actuators_of_different_kinds_add_up(trunk):
    mixed = trunk.replace(actuators=(*trunk.actuators, Cable(place=PLACE)))
    stations = np.linspace(0, 1, 5)
    whole, fibers = tables(mixed, stations), tables(trunk, stations)
    alone = tables(trunk.replace(actuators=(Cable(place=PLACE),)), stations)
    np.testing.assert_array_equal(whole.extension, np.hstack([fibers.extension, alone.extension]))
    np.testing.assert_array_equal(
        whole.curvature, np.concatenate([fibers.curvature, alone.curvature], axis=2)
    )
    gamma = in_box(mixed, 3)
    np.testing.assert_allclose(
        sr.tip_positions(mixed, gamma, tol=1e-9),
        [integrated_tip(mixed, one) for one in gamma],
        atol=1e-9,
    )


@pytest.fixture(scope="module")
def mixed(trunk):
    """Two fibers and a cable of another unit and other bounds."""
    return trunk.replace(actuators=(*trunk.actuators[:2], Cable(place=PLACE)))


class TestEverythingElseWorks:
    def test_it_is_named_and_bounded_like_any_other(self, mixed):
        assert mixed.bundle_names == ("left", "right", "cable 3")
        np.testing.assert_array_equal(mixed.bounds[2], [0.0, 1e-3])
        other = mixed.with_bounds(((-1, 0), (-1, 0), (0, 5e-4)))
        assert other.actuators[2].activation_bounds == (0.0, 5e-4)

    def test_clouds_of_it_are_computed_saved_and_opened(self, mixed, tmp_path):
        cloud = sr.compute_cloud(mixed, n=500)
        sr.save_cloud(cloud, tmp_path / "cloud.zarr")
        opened = sr.open_cloud(tmp_path / "cloud.zarr")
        assert opened.identical(cloud)
        assert sr.cloud.design_of(opened) == mixed
        low, high = mixed.bounds.T
        assert (cloud.activation >= low).all()
        assert (cloud.activation <= high).all()

    def test_datasets_name_the_unit_of_each_of_its_bundles(self, mixed, tmp_path):
        cloud = sr.compute_cloud(mixed, n=50)
        gamma = cloud.activation.values[:3]
        path = sr.tip_positions(mixed, gamma[:1])
        for found in (
            cloud,
            sr.configuration(mixed, gamma),
            sr.solve_inverse(mixed, path).to_dataset(),
            sr.track_path(mixed, path, start=gamma[0]),
        ):
            assert dict(zip(found.bundle.values, found.unit.values, strict=True)) == {
                "left": "1",
                "right": "1",
                "cable 3": "N",
            }
            assert "units" not in found.activation.attrs
        parquet = pytest.importorskip("pyarrow.parquet")
        export_cloud(cloud, tmp_path / "cloud.parquet")
        schema = parquet.read_schema(tmp_path / "cloud.parquet")
        assert schema.field("gamma_cable_3").metadata[b"units"] == b"N"
        assert schema.metadata[b"activation_units"] == b"1, 1, N"

    def test_datasets_of_one_unit_have_it_once(self, trunk):
        cable = sr.compute_cloud(cylinder(Cable(place=PLACE)), n=10)
        assert cable.activation.attrs["units"] == "N"
        fibers = sr.compute_cloud(trunk, n=10)
        assert fibers.activation.attrs["units"] == "1"
        assert "unit" not in cable.coords
        assert "unit" not in fibers.coords

    def test_its_reachable_set_holds_its_tips(self, mixed):
        reached = sr.reachable_set(mixed, accuracy=0.03)
        assert reached.volume > 0
        assert (reached.distance(sr.compute_cloud(mixed, n=200).tip.values) < 1e-2).all()

    def test_inverse_solutions_are_activations_of_it(self, mixed):
        gamma = in_box(mixed, 5)
        targets = sr.tip_positions(mixed, gamma)
        for target, solution in zip(targets, sr.solve_inverse(mixed, targets), strict=True):
            tips = sr.tip_positions(mixed, solution.activations)
            assert len(tips) >= 1
            np.testing.assert_allclose(tips, np.broadcast_to(target, tips.shape), atol=1e-5)

    def test_it_is_drawn(self, mixed):
        pytest.importorskip("matplotlib")
        shape = sr.configuration(mixed, [-1.0, -0.5, 5e-4], stations=21)
        axes = sr.plot.plot_arm(mixed, shape)
        assert axes.images
        axes.figure.clear()

    def test_bundles_that_its_loads_do_not_have_are_refused(self, mixed):
        said = r"cable 3.bundles = 2: must be that of Cable.resultants, whose .* \(\d+, 3, 1\)"
        with pytest.raises(sr.InvalidDesign, match=said):
            tables(changed(mixed, {"cable 3.bundles": 2}), [0.0, 0.5])

    def test_its_activations_are_not_taken_for_those_of_fibers(self):
        strong = Cable(place=PLACE, activation_bounds=(0.0, 5.0))
        assert not any("|γ|" in line for line in design_warnings(cylinder(strong)))


class TestFiles:
    def written(self, text):
        return designs.minimal_trunk().to_toml().partition("[[actuators]]")[0] + text

    @pytest.mark.parametrize(
        ("table", "message"),
        [
            ("kind = 'Cables'", r"actuators\[0\].kind = 'Cables': must be one of fiber, .*Cable"),
            ("kind = 'Cable'", r"actuators\[0\] = 'Cable': has other fields: .*'place'"),
            (
                "kind = 'Cable'\nplace = [0, 0]\nstart_over_length = 2",
                r"actuators\[0\].start_over_length = 2: must be",
            ),
            ("kind = 'FiberArchitecture'", r'did you mean "fiber"\?'),
        ],
    )
    def test_a_faulty_table_is_refused_with_its_place(self, table, message):
        with pytest.raises(sr.InvalidDesign, match=message):
            sr.Manipulator.from_toml(self.written(f"[[actuators]]\n{table}\n"))

    @pytest.mark.parametrize("tag", [(np.float32(0.03), 0.0), (0.03, None), {"x": 0.03}])
    def test_what_is_no_plain_value_is_not_written(self, trunk, tag):
        @dataclass(frozen=True, kw_only=True)
        class TaggedCable(Cable):
            tag: object

        arm = trunk.replace(actuators=(TaggedCable(place=PLACE, tag=tag),))
        with pytest.raises(sr.InvalidDesign, match=r"TaggedCable.tag.*to fit in a design file"):
            arm.to_toml()


# Laws of drives: inputs that activate several bundles, by hand and in files


FIBER = FiberArchitecture(name="fiber", revolution=1.0, extent=0.5, activation_bounds=(-0.5, 0.0))


def four(kind=Tendon, **fields):
    """Four of a kind around the arm, and a fiber."""
    defaults = {"name": "t", "distance": 0.015, "bundles": 4, "activation_bounds": (0.0, 2.0)}
    return one_ring_arm(kind(**(defaults | fields)), FIBER)


def pairs(arm, **fields):
    """Two antagonistic pairs."""
    defaults = {"bounds": (-1.0, 1.0), "gain": 0.8, "offset": 0.3, "unit": "turns"} | fields
    return arm.replace(
        drives=(
            antagonists("x", "t 1", "t 3", **defaults),
            antagonists("y", "t 2", "t 4", **defaults),
        )
    )


def test_inputs_are_drives_and_then_the_bundles_that_none_names():
    arm = pairs(four())
    assert arm.input_names == ("x", "y", "fiber")
    assert arm.input_units == ("turns", "turns", "1")
    np.testing.assert_array_equal(arm.input_bounds, [[-1, 1], [-1, 1], [-0.5, 0]])
    assert as_tip_map(arm).box.names == arm.input_names


def test_an_antagonistic_pair_pulls_one_tendon_and_releases_the_other():
    """By hand: offset + g dz(u), and no tendon pushes."""
    plain, arm = four(), pairs(four(), dead_zone=0.1)
    inputs = [[0.5, -0.2, -0.3], [-1.0, 0.05, 0.0]]
    activations = [
        [0.3 + 0.8 * 0.4, 0.3 - 0.8 * 0.1, 0.0, 0.3 + 0.8 * 0.1, -0.3],
        [0.0, 0.3, 0.3 + 0.8 * 0.9, 0.3, 0.0],
    ]
    tips = sr.tip_positions(plain, activations, tol=1e-10)
    np.testing.assert_allclose(sr.tip_positions(arm, inputs, tol=1e-10), tips, atol=1e-10)


def test_gains_of_drives_that_share_a_bundle_add_up():
    plain = four(Chamber, radius=0.003, activation_bounds=(-9e3, 9e3))
    both = {"t 1": 2e3, "t 2": -1e3}
    arm = plain.replace(
        drives=(
            Drive(name="a", unit="V", bounds=(0, 2), gains=both, offsets={"t 1": 500.0}),
            Drive(name="b", unit="V", bounds=(0, 2), gains={"t 2": 3e3}),
        )
    )
    activation = [500 + 2e3, -1e3 + 3e3 * 0.5, 100.0, 200.0, 0.0]
    tip = sr.tip_positions(arm, [1.0, 0.5, 100.0, 200.0, 0.0], tol=1e-10)
    expected = sr.tip_positions(plain, activation, tol=1e-10)
    np.testing.assert_allclose(tip, expected, atol=1e-10)


PULLED = {"kind": LengthTendon, "activation_bounds": (-0.02, 0.02), "tendon_stiffness": 900.0}


@pytest.mark.parametrize(("kind", "gain"), [({}, 0.8), (PULLED, 0.01)])
def test_slopes_are_those_of_differences(kind, gain):
    arm = pairs(four(**kind), gain=gain, dead_zone=0.05)
    rod, step = as_tip_map(arm, 1e-9), 1e-6
    rng = np.random.default_rng(2)
    x = rod.box.low + rng.random((20, rod.box.bundles)) * rod.box.widths
    slopes = rod.tips_and_slopes(x)[1]
    for k, unit in enumerate(np.eye(rod.box.bundles)):
        change = rod.tips(x + step * unit) - rod.tips(x - step * unit)
        np.testing.assert_allclose(slopes[..., k], change / (2 * step), atol=2e-8)


def test_an_arm_with_drives_is_what_its_file_says():
    arm = pairs(four(), dead_zone=0.1)
    assert Manipulator.from_toml(arm.to_toml()) == arm
    assert hash(Manipulator.from_toml(arm.to_toml())) == hash(arm)
    assert "[[drives]]" in arm.to_toml()


def test_parameters_of_drives_change_gains_and_keep_their_signs():
    arm = pairs(four())
    known = parameters.parameters(arm)
    assert known["x.gain"].value(arm) == 0.8
    wanted = {"x.gain": 0.5, "y.gains[t 2]": 0.9, "y.offsets[t 4]": 0.1, "x.upper": 2.0}
    made = parameters.changed(arm, wanted | {"x.dead_zone": 0.2})
    x, y = made.drives
    assert dict(x.gains) == {"t 1": 0.5, "t 3": -0.5}
    assert dict(y.gains) == {"t 2": 0.9, "t 4": -0.8}
    assert dict(y.offsets) == {"t 2": 0.3, "t 4": 0.1}
    assert x.bounds == (-1.0, 2.0)
    assert x.dead_zone == 0.2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gains": {"t 9": 1.0}}, r"drives\[0\].gains = 't 9': must be a bundle of the arm: t 1"),
        ({"name": "fiber"}, r"drives\[0\].name = 'fiber': must be unlike"),
        ({"bounds": (1.0, 0.0)}, r"bounds = \(1.0, 0.0\): must be a pair"),
        ({"gains": {}}, r"gains: must be a mapping"),
        ({"offsets": {"t 2": 1.0}}, r"offsets\[t 2\] = 1: must be that of a bundle in gains"),
        ({"dead_zone": -1.0}, r"dead_zone = -1: must be a finite number >= 0"),
    ],
)
def test_faults_of_drives_are_told(changes, message):
    drive = {"name": "a", "bounds": (0.0, 1.0), "gains": {"t 1": 1.0}} | changes
    with pytest.raises(InvalidDesign, match=message):
        four().replace(drives=(Drive(**drive),))


def test_a_fault_of_a_drive_in_a_file_is_told_by_its_key():
    text = pairs(four()).to_toml().replace("bounds = [-1.0, 1.0]", 'bounds = "wide"', 1)
    with pytest.raises(InvalidDesign, match=r"drives\[0\].bounds = 'wide'"):
        Manipulator.from_toml(text)


def test_a_cloud_speaks_the_inputs_of_the_user():
    cloud = sr.compute_cloud(pairs(four()), n=50)
    assert list(cloud.bundle.values) == ["x", "y", "fiber"]
    assert list(cloud["unit"].values) == ["turns", "turns", "1"]
    assert cloud.activation.shape == (50, 3)


def test_an_input_that_reaches_a_place_is_found():
    """Proved too: a pair whose tendons stay taut is linear in its input."""
    arm = pairs(four(), gain=0.25)
    wanted = np.array([[0.4, -0.3, -0.2]])
    (solutions,) = sr.solve_inverse(arm, sr.tip_positions(arm, wanted))
    assert np.abs(solutions.activations - wanted).max(axis=1).min() < 1e-4


def test_the_command_line_speaks_inputs(tmp_path, capsys):
    path = str(tmp_path / "arm.toml")
    pairs(four()).save(path)
    run(["design", path])
    assert "drive x" in (said := capsys.readouterr().out)
    assert "-1 to 1 turns: +0.8 t 1, -0.8 t 3" in said
    run(["design", path, "--json"])
    inputs = json.loads(capsys.readouterr().out)["inputs"]
    assert inputs[0] == {"name": "x", "unit": "turns", "bounds": [-1.0, 1.0]}
    assert [each["name"] for each in inputs] == ["x", "y", "fiber"]
