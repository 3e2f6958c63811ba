"""Laws of markers: they go with their section, and the arm does not notice them."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Marker
from softreach.arm.parameters import changed, parameters
from softreach.rod import marker_positions
from softreach.rod.arm_shape import marker_points, rest_configuration
from softreach.support.errors import InvalidDesign

MATTER = sr.Material(young_modulus=1e6, density=1000.0)
PLAIN = sr.designs.minimal_trunk(material=MATTER).replace(
    base=sr.Base(position=(0.1, 0.2, 0.3), points="x")
)
MARKERS = (
    Marker(name="tool", offset=(0.01, -0.02, 0.05)),
    Marker(name="collar", station="disk", offset=(0.03, 0.0, 0.0)),
    Marker(name="middle", station=0.5),
    Marker(name="base", station_over_length=0.0, offset=(0.1, 0.2, 0.3)),
    Marker(name="again", station="disk", offset=(0.0, 0.01, 0.0)),
)
ARM = PLAIN.replace(stations={"disk": 0.3}, markers=MARKERS)
GAMMA = np.array([[-0.5, -0.2, -1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, -0.3]])


def heavy(arm: sr.Manipulator) -> sr.Manipulator:
    return arm.replace(loads=sr.Loads(gravity=(0.0, 0.0, -0.3)))


@pytest.mark.parametrize("arm", [ARM, heavy(ARM)])
@pytest.mark.parametrize("frame", ["world", "base"])
def test_a_marker_is_at_the_center_of_its_section_plus_its_offset_in_the_directors(arm, frame):
    z = [0.0, 0.3, 0.5, arm.length]
    shape = sr.configuration(arm, GAMMA, z, frame=frame)
    place = {"tool": 3, "collar": 1, "middle": 2, "base": 0, "again": 1}
    for marker in MARKERS:
        section = shape.isel(station=place[marker.name])
        expected = section.position + sum(
            part * section.directors.isel(director=k) for k, part in enumerate(marker.offset)
        )
        np.testing.assert_allclose(
            shape.marker_position.sel(marker=marker.name), expected, atol=1e-8
        )
    found = marker_positions(arm, GAMMA, frame=frame)
    np.testing.assert_array_equal(found, shape.marker_position.values)


@pytest.mark.parametrize("posed", [lambda arm: arm, heavy])
def test_markers_change_no_bit_of_the_arm(posed):
    marked, plain = posed(ARM), posed(PLAIN)
    np.testing.assert_array_equal(sr.tip_positions(marked, GAMMA), sr.tip_positions(plain, GAMMA))
    shapes = [sr.configuration(arm, GAMMA, 11) for arm in (marked, plain)]
    assert shapes[0].drop_vars(["marker_position", "marker"]).equals(shapes[1])
    assert marked.breakpoints == plain.breakpoints


def test_one_activation_and_bundles_that_are_held_have_markers_too():
    (expected,) = marker_positions(ARM, GAMMA[0])
    np.testing.assert_array_equal(sr.configuration(ARM, GAMMA[0]).marker_position, expected)
    held = ARM.with_bounds([[GAMMA[0, 0]] * 2, [-1.0, 0.0], [-1.0, 0.0]])
    free = sr.rod.free_bundles(sr.rod.tip_map(held))
    np.testing.assert_allclose(marker_positions(free, GAMMA[:1, 1:])[0], expected, atol=1e-8)
    assert marker_positions(PLAIN, GAMMA).shape == (3, 0, 3)


def test_pictures_have_markers_where_they_are():
    straight = marker_positions(ARM, np.zeros(3))[0]
    np.testing.assert_allclose(marker_points(ARM, rest_configuration(ARM)), straight, atol=1e-12)
    shape = sr.configuration(ARM, GAMMA[0], 401)
    np.testing.assert_allclose(marker_points(ARM, shape), shape.marker_position, atol=1e-6)


def test_files_and_parameters_hold_markers():
    assert sr.Manipulator.from_toml(ARM.to_toml()) == ARM
    moved = changed(ARM, {"markers.tool.offset[2]": 0.07, "stations.disk": 0.4})
    tool = MARKERS[0].replace(offset=(0.01, -0.02, 0.07))
    assert moved == ARM.replace(stations={"disk": 0.4}, markers=(tool, *MARKERS[1:]))
    assert parameters(moved)["markers.collar.station"].value(moved) == 0.4
    assert changed(ARM, {"markers.collar.station_over_length": 0.6}).markers[1].station is None


@pytest.mark.parametrize(
    ("markers", "message"),
    [
        ((Marker(name="a"), Marker(name="a")), r"markers\[1\].name = 'a': must differ"),
        ((Marker(name="a", station="disc"),), "markers.a.station = 'disc': must be Z in m or a"),
        ((Marker(name="a", station=1.1),), "markers.a.station = 1.1: must be on the arm"),
        ((Marker(name="a.b"),), "must be one line without dots"),
        (("a",), "must be Markers"),
        (3, "must be Markers"),
    ],
)
def test_markers_that_are_nowhere_are_refused(markers, message):
    with pytest.raises(InvalidDesign, match=message):
        ARM.replace(markers=markers)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"name": ""}, "name = '': must be given"),
        ({"name": "a", "offset": (1.0, 2.0)}, "must be three finite numbers"),
        ({"name": "a", "station": 0.1, "station_over_length": 0.5}, "give exactly one of station"),
    ],
)
def test_a_marker_has_a_name_and_one_place(values, message):
    with pytest.raises(InvalidDesign, match=message):
        Marker(**values)


def test_faults_of_markers_in_files_are_told_in_their_terms():
    text = ARM.to_toml().replace('station = "disk"', "station_m = 3.0", 1)
    text = text.replace('name = "base"', 'title = "base"')
    with pytest.raises(InvalidDesign) as caught:
        sr.Manipulator.from_toml(text)
    assert "markers[3].name: required key is missing" in str(caught.value)
    assert "markers[1].station = 3: must be on the arm, at most 1 m" in str(caught.value)
