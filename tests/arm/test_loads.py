"""Loads are a part of an arm: values, files, parameters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import PointLoad
from softreach.arm.design_file.keys import keys_of
from softreach.arm.parameters import changed, find_parameter
from softreach.arm.parameters.shown import written_parameters
from softreach.rod.tip_map import has_tip
from softreach.support.errors import InvalidDesign
from tests.bodies import rubber

number = st.floats(-1e3, 1e3)
triples = st.tuples(number, number, number)
points = st.builds(PointLoad, station=st.floats(0, 1), force=triples, moment=triples)
loads = st.builds(
    sr.Loads,
    gravity=triples,
    payload=st.floats(0, 1e3),
    payload_arm=triples,
    tip_force=triples,
    tip_moment=triples,
    follower_force=triples,
    follower_moment=triples,
    point_loads=st.lists(points, max_size=2).map(tuple),
    force_per_length=triples,
)


@given(loads=loads)
def test_loads_survive_a_design_file_to_the_last_bit(loads):
    arm = rubber(sr.designs.minimal_trunk(), loads)
    assert sr.Manipulator.from_toml(arm.to_toml()) == arm


def test_an_arm_without_loads_has_no_table_of_them(trunk):
    assert "loads" not in trunk.to_toml()
    assert sr.Manipulator.from_toml(trunk.to_toml()).loads is None


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("payload_kg = -1", r"loads.payload_kg = -1.*>= 0"),
        ("payload = 1", 'loads.payload = 1: unknown key; did you mean "payload_kg"'),
        ("gravity_m_s2 = [0, 0]", r"loads.gravity_m_s2 = \[0, 0\]"),
        ('gravity_m_s2 = "down"', "loads.gravity_m_s2 = 'down'"),
        ("tip_force_n = [0, 0, nan]", r"loads.tip_force_n = .*three finite numbers"),
        ("[[loads.point_loads]]", r"loads.point_loads\[0\].station_m: required"),
        ("[[loads.point_loads]]\nstation_m = 2", r"loads.point_loads\[0\].station"),
    ],
)
def test_what_cannot_act_is_refused_in_the_files_own_names(line, message):
    text = rubber(sr.designs.minimal_trunk(), None).to_toml()
    with pytest.raises(InvalidDesign, match=message):
        sr.Manipulator.from_toml(f"{text}\n[loads]\n{line}\n")


def test_moduli_and_densities_are_asked_for_by_name(trunk):
    with pytest.raises(InvalidDesign) as caught:
        trunk.replace(loads=sr.Loads())
    assert [fault.path for fault in caught.value.faults] == [
        "rings[0].material.young_modulus",
        "rings[0].material.density",
    ]
    with pytest.raises(InvalidDesign) as caught:
        trunk.replace(loads=sr.Loads(gravity=(0, 0, 0), tip_force=(1, 0, 0)))
    assert [fault.path for fault in caught.value.faults] == ["rings[0].material.young_modulus"]


@pytest.mark.parametrize("wrong", [0.2, "gravity", (0, 0, -9.81)])
def test_loads_are_nothing_else(trunk, wrong):
    with pytest.raises(InvalidDesign, match="must be Loads or None"):
        trunk.replace(loads=wrong)


def test_payload_and_gravity_are_parameters(trunk):
    arm = rubber(trunk, sr.Loads(payload=0.1))
    assert find_parameter(arm, "loads.payload").value(arm) == 0.1
    found = changed(arm, {"loads.payload": 0.3, "loads.gravity[2]": -1.62}).loads
    assert found == sr.Loads(payload=0.3, gravity=(0, 0, -1.62))
    assert not any(name.startswith("loads") for name in sr.arm.parameters.parameters(trunk))


def test_parameters_of_loads_are_written_as_the_keys_of_files(trunk):
    written = written_parameters(rubber(trunk, sr.Loads()))
    names = {name.partition("[")[0] for name in written if name.startswith("loads.")}
    keys = {f"loads.{key}" for key in keys_of(sr.Loads)}
    assert names == keys - {"loads.point_loads"}


def test_a_cloud_of_a_loaded_arm_says_which_samples_are_stable(trunk):
    hanging = sr.Loads(gravity=(0, 0, 9.81), payload=0.03)
    heavy = sr.designs.lce_arm().replace(loads=hanging)
    cloud = sr.compute_cloud(heavy, n=2000)
    assert set(np.unique(cloud.status)) > {0}
    np.testing.assert_array_equal(~has_tip(cloud.status), np.isnan(cloud.tip).any("axis"))
    rod = sr.rod.tip_map(heavy)
    np.testing.assert_array_equal(cloud.status, rod.status(cloud.activation.values))
    assert "status" not in sr.compute_cloud(trunk, n=10)


def test_weight_shrinks_to_nothing_with_stiffness(trunk):
    volumes = [
        sr.reachable_set(rubber(trunk, sr.Loads(gravity=(9.81, 0, 0)), young=young), accuracy=0.02)
        for young in (1e6, 1e8)
    ]
    free = sr.reachable_set(trunk, accuracy=0.02).volume
    soft, stiff = (abs(one.volume - free) for one in volumes)
    assert stiff < 0.02 * soft


def test_the_inverse_of_a_loaded_arm_finds_what_was_drawn(trunk):
    arm = rubber(trunk, sr.Loads(gravity=(9.81, 0, 0), payload=0.1))
    cloud = sr.compute_cloud(arm, n=30, seed=4)
    found = sr.solve_inverse(arm, cloud.tip.values)
    assert (found.statuses == 0).all()
    for drawn, one in zip(cloud.activation.values, found, strict=True):
        assert np.abs(one.activations - drawn).max(axis=1).min() < 1e-5
