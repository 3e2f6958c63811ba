"""Laws of drives: inputs that activate several bundles, by hand and in files."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import softreach as sr
from softreach.arm import (
    Chamber,
    Drive,
    FiberArchitecture,
    LengthTendon,
    Manipulator,
    Tendon,
    parameters,
)
from softreach.cli.app import run
from softreach.rod.rods import tip_map
from softreach.support.errors import InvalidDesign
from tests.made_arms import one_ring_arm

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
            Drive.antagonists("x", "t 1", "t 3", **defaults),
            Drive.antagonists("y", "t 2", "t 4", **defaults),
        )
    )


def test_inputs_are_drives_and_then_the_bundles_that_none_names():
    arm = pairs(four())
    assert arm.input_names == ("x", "y", "fiber")
    assert arm.input_units == ("turns", "turns", "1")
    np.testing.assert_array_equal(arm.input_bounds, [[-1, 1], [-1, 1], [-0.5, 0]])
    assert tip_map(arm).box.names == arm.input_names


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
    rod, step = tip_map(arm, 1e-9), 1e-6
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
    assert "drives" not in four().to_toml()


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
        ({"gains": {}}, r"gains = \{\}: must be a mapping"),
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


def test_drives_are_plain_values():
    drive = Drive(name="a", bounds=(0, 1), gains={"t": 1})
    assert dataclasses.replace(drive) == drive
    assert hash(drive) == hash(dataclasses.replace(drive))
