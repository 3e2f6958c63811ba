"""The pose of a base: a value, checked when it is made, and a table of design files."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm.base import POINTS
from softreach.arm.design_file import keys_of
from softreach.arm.parameters import Written
from softreach.rod.tip_map import has_tip
from softreach.support.errors import InvalidDesign
from tests.bodies import rubber
from tests.laws import bases, rotvec

POSE = sr.Base(position=(0.3, -0.2, 1.5), points=rotvec((0.3, 1.1, -0.4)), turn=0.7)


class TestPose:
    """What a base is."""

    @given(base=bases())
    def test_it_is_a_rotation_and_a_place(self, base):
        np.testing.assert_allclose(base.rotation @ base.rotation.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(base.rotation) == pytest.approx(1.0)
        points = np.array([[0, 0, 0], [0.1, -0.2, 0.3]])
        np.testing.assert_array_equal(base.to_world(points[0]), base.position)
        np.testing.assert_allclose(base.to_base(base.to_world(points)), points, atol=1e-14)

    @pytest.mark.parametrize("points", POINTS)
    def test_the_straight_arm_points_where_the_word_says_exactly(self, points):
        along = np.array({"up": "z", "down": "-z"}.get(points, points))
        axis = np.eye(3)["xyz".index(str(along)[-1])] * (-1 if "-" in str(along) else 1)
        for turn in (0.0, 1.0):
            base = sr.Base(points=points, turn=turn)
            np.testing.assert_array_equal(base.directions_to_world([0, 0, 1]), axis)
        assert set(np.unique(sr.Base(points=points).rotation)) <= {-1.0, 0.0, 1.0}

    def test_it_turns_about_the_way_it_points_by_the_right_hand(self):
        base = sr.Base(points="down", turn=np.pi / 2)
        np.testing.assert_allclose(base.rotation[:, 0], [0, -1, 0], atol=1e-15)
        spun = sr.Base(points="down").rotation @ rotvec([0, 0, np.pi / 2]).as_matrix()
        np.testing.assert_allclose(base.rotation, spun, atol=1e-15)

    @given(angles=st.tuples(*[st.floats(-2, 2)] * 3))
    def test_a_rotation_may_be_a_matrix_a_quaternion_or_scipys(self, angles):
        rotation = rotvec(angles)
        x, y, z, w = rotation.as_quat()
        for points in (rotation, rotation.as_matrix(), (w, x, y, z)):
            made = sr.Base(points=points)
            np.testing.assert_allclose(made.rotation, rotation.as_matrix(), atol=1e-14)

    def test_what_is_typed_with_seven_digits_is_the_rotation_nearest_to_it(self):
        typed = [[0.7071068, -0.7071068, 0], [0.7071068, 0.7071068, 0], [0, 0, 1]]
        exact = rotvec([0, 0, np.pi / 4]).as_matrix()
        np.testing.assert_allclose(sr.Base(points=typed).rotation, exact, atol=1e-14)

    def test_it_is_a_frozen_value(self):
        twin = sr.Base(position=POSE.position, points=POSE.points, turn=POSE.turn)
        assert (twin, hash(twin)) == (POSE, hash(POSE))
        assert pickle.loads(pickle.dumps(POSE)) == POSE
        assert POSE.replace(turn=0.0) != POSE
        with pytest.raises(ValueError, match="read-only"):
            POSE.rotation[0, 0] = 1.0

    @pytest.mark.parametrize(
        ("fields", "message"),
        [
            ({"points": "left"}, "points = 'left': must be one of up, down, x, -x, y, -y, or a"),
            ({"points": np.diag([1, 1, -1])}, "must be a rotation; these axes are left-handed"),
            ({"points": np.diag([1, 1, 2])}, "not of length 1 and at right angles, by 3"),
            ({"points": (1, 0, 0, 1)}, "a quaternion .* of length 1, not 1.414"),
            ({"points": (0, 0, -1)}, "points = .*must be one of up, down"),
            ({"position": (0, 0)}, "position = .*three finite numbers"),
            ({"turn": "90deg"}, "turn = '90deg'"),
        ],
    )
    def test_what_is_none_is_refused_in_one_line(self, fields, message):
        with pytest.raises(InvalidDesign, match=message) as caught:
            sr.Base(**fields)
        assert "\n" not in str(caught.value)


class TestFiles:
    """`[base]` in design files."""

    def test_what_an_arm_does_not_have_has_no_table(self, trunk):
        assert not any(name in trunk.to_toml() for name in ("base", "loads", "drives"))
        assert (trunk.base, trunk.loads, trunk.drives) == (sr.Base(), None, ())
        assert trunk.base.is_identity

    def test_words_and_degrees_are_as_people_write_them(self, trunk):
        text = trunk.to_toml() + '[base]\nposition_m = [0, 0, 1]\npoints = "down"\nturn_deg = 90\n'
        base = sr.Manipulator.from_toml(text).base
        assert base == sr.Base(position=(0, 0, 1), points="down", turn=np.pi / 2)

    @pytest.mark.parametrize(
        ("lines", "message"),
        [
            ('points = "sideways"', "base.points = 'sideways': must be one of up, down"),
            ("position = [0, 0, 1]", r"base.position = .*did you mean .position_m."),
            ('turn_deg = "x"', "base.turn_deg = 'x': must be a finite number"),
        ],
    )
    def test_faults_are_told_in_the_terms_of_the_file(self, trunk, lines, message):
        with pytest.raises(InvalidDesign, match=message):
            sr.Manipulator.from_toml(f"{trunk.to_toml()}[base]\n{lines}\n")


# Loads are a part of an arm: values, files, parameters


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("payload = 1", 'loads.payload = 1: unknown key; did you mean "payload_kg"'),
        ('gravity_m_s2 = "down"', "loads.gravity_m_s2 = 'down'"),
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


def test_parameters_of_loads_are_written_as_the_keys_of_files(trunk):
    written = Written.of(rubber(trunk, sr.Loads())).written
    names = {name.partition("[")[0] for name in written if name.startswith("loads.")}
    keys = {f"loads.{key}" for key in keys_of(sr.Loads)}
    assert names == keys - {"loads.point_loads"}


def test_a_cloud_of_a_loaded_arm_says_which_samples_are_stable(trunk):
    aside = sr.Loads(gravity=(9.81, 0, 0), payload=0.005)
    heavy = sr.designs.lce_arm().replace(loads=aside)
    cloud = sr.compute_cloud(heavy, n=3000)
    assert set(np.unique(cloud.status)) > {0}
    np.testing.assert_array_equal(~has_tip(cloud.status), np.isnan(cloud.tip).any("axis"))
    rod = sr.rod.as_tip_map(heavy)
    np.testing.assert_array_equal(cloud.status, rod.status(cloud.activation.values))
    assert "status" not in sr.compute_cloud(trunk, n=10)
