"""The pose of a base: a value, checked when it is made, and a table of design files."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm.base import POINTS
from softreach.arm.parameters import changed
from softreach.support.errors import InvalidDesign
from tests.laws import bases, rotvec

POSE = sr.Base(position=(0.3, -0.2, 1.5), points=(0.3, 1.1, -0.4), turn=0.7)


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
    def test_a_rotation_may_be_a_matrix_a_quaternion_a_vector_or_scipys(self, angles):
        if abs(np.linalg.norm(angles) - 1.0) < 1e-3:
            return  # which would look like a direction
        rotation = rotvec(angles)
        x, y, z, w = rotation.as_quat()
        for points in (rotation, rotation.as_matrix(), (w, x, y, z), angles):
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
            ({"points": np.ones((3, 3))}, "not of length 1 and at right angles"),
            ({"points": np.full((3, 3), np.nan)}, "must be one of up"),
            ({"points": (1, 0, 0, 1)}, "a quaternion .* of length 1, not 1.414"),
            ({"points": (0, 0, 0, 0)}, "a quaternion .* of length 1, not 0"),
            ({"points": (0, 0, -1)}, "look like a direction"),
            ({"points": (1, 2)}, "must be one of up"),
            ({"points": None}, "must be one of up"),
            ({"points": [[1, 0, 0], [0, 1]]}, "must be one of up"),
            ({"position": (0, 0)}, "position = .*three finite numbers"),
            ({"position": (0, 0, np.inf)}, "position = .*three finite numbers"),
            ({"turn": np.nan}, "turn = nan"),
            ({"turn": "90deg"}, "turn = '90deg'"),
        ],
    )
    def test_what_is_none_is_refused_in_one_line(self, fields, message):
        with pytest.raises(InvalidDesign, match=message) as caught:
            sr.Base(**fields)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("base", ["down", None, np.eye(3)])
    def test_an_arm_takes_no_other_base(self, trunk, base):
        with pytest.raises(InvalidDesign, match=r"base.*: must be a Base, such as"):
            trunk.replace(base=base)


class TestFiles:
    """`[base]` in design files."""

    @given(base=bases())
    def test_a_pose_reads_back_to_the_last_bit(self, base):
        arm = sr.designs.minimal_trunk().replace(base=base)
        assert sr.Manipulator.from_toml(arm.to_toml()) == arm

    def test_an_upright_base_at_the_origin_has_no_table(self, trunk):
        assert "base" not in trunk.to_toml()
        assert trunk.base == sr.Base()
        assert trunk.base.is_identity

    def test_words_and_degrees_are_as_people_write_them(self, trunk):
        text = trunk.to_toml() + '[base]\nposition_m = [0, 0, 1]\npoints = "down"\nturn_deg = 90\n'
        base = sr.Manipulator.from_toml(text).base
        assert base == sr.Base(position=(0, 0, 1), points="down", turn=np.pi / 2)

    @pytest.mark.parametrize(
        ("lines", "message"),
        [
            ('points = "sideways"', "base.points = 'sideways': must be one of up, down"),
            ("points = [0, 0, -1]", "base.points = .*look like a direction"),
            ("points = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "base.points = .*left-handed"),
            ("position = [0, 0, 1]", r"base.position = .*did you mean .position_m."),
            ("position_m = 1", "base.position_m = 1: must be three finite numbers"),
            ('turn_deg = "x"', "base.turn_deg = 'x': must be a valid number"),
        ],
    )
    def test_faults_are_told_in_the_terms_of_the_file(self, trunk, lines, message):
        with pytest.raises(InvalidDesign, match=message):
            sr.Manipulator.from_toml(f"{trunk.to_toml()}[base]\n{lines}\n")

    def test_its_numbers_are_parameters_of_a_posed_arm(self, trunk):
        moved = changed(trunk.replace(base=POSE), {"base.turn": 0.1, "base.position[2]": 2.0})
        assert moved.base == POSE.replace(turn=0.1, position=(0.3, -0.2, 2.0))
