"""Laws of markers: they go with their section, and the arm does not notice them."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.arm import LengthTendon, Marker, Measured, Pieces, RestShape, RigidPiece, Samples
from softreach.arm.parameters import changed, parameters
from softreach.arm.skin import marker_points
from softreach.arm.tables import compliance, tables
from softreach.rod import marker_positions
from softreach.rod.kinematics import rest_configuration
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
    free = sr.rod.free_bundles(sr.rod.as_tip_map(held))
    np.testing.assert_allclose(marker_positions(free, GAMMA[:1, 1:])[0], expected, atol=1e-8)
    assert marker_positions(PLAIN, GAMMA).shape == (3, 0, 3)


def test_pictures_have_markers_where_they_are():
    straight = marker_positions(ARM, np.zeros(3))[0]
    np.testing.assert_allclose(
        marker_points(ARM.markers, rest_configuration(ARM)), straight, atol=1e-12
    )
    shape = sr.configuration(ARM, GAMMA[0], 401)
    np.testing.assert_allclose(marker_points(ARM.markers, shape), shape.marker_position, atol=1e-6)


def test_files_and_parameters_hold_markers():
    assert sr.Manipulator.from_toml(ARM.to_toml()) == ARM
    moved = changed(ARM, {"markers.tool.offset[2]": 0.07, "stations.disk": 0.4})
    tool = MARKERS[0].replace(offset=(0.01, -0.02, 0.07))
    assert moved == ARM.replace(stations={"disk": 0.4}, markers=(tool, *MARKERS[1:]))
    assert parameters(moved)["markers.collar.station"].value(moved) == 0.4
    assert changed(ARM, {"markers.collar.station_over_length": 0.6}).markers[1].station is None


def test_faults_of_markers_in_files_are_told_in_their_terms():
    text = ARM.to_toml().replace('station = "disk"', "station_m = 3.0", 1)
    text = text.replace('name = "base"', 'title = "base"')
    with pytest.raises(InvalidDesign) as caught:
        sr.Manipulator.from_toml(text)
    assert "markers[3].name: required key is missing" in str(caught.value)
    assert "markers[1].station_m = 3: must be on the arm, at most 1 m" in str(caught.value)


# Laws of rigid pieces: what is beyond goes on as a stiff body, and nothing else changes


MASSLESS = sr.Material(young_modulus=1e6, density=0.0)
LENGTH, SHORT = 0.3, 0.18
FREE = np.array([[-0.3, 1.0], [-0.1, 0.0], [0.0, 2.0]])


def arm(length: float = LENGTH, **others) -> sr.Manipulator:
    measured = others.pop("measured", None)
    matter = others.pop("material", MASSLESS)
    actuators = (
        sr.FiberArchitecture(name="helix", helical_angle=0.3, extent=0.8),
        sr.Tendon(name="tendon", distance=0.008, offset=2.0, activation_bounds=(0.0, 2.0)),
    )
    ring = sr.Ring(inner_ratio=0.5, material=matter)
    return sr.Manipulator(
        profile=sr.LinearTaper(length=length, outer_radius=0.01),
        section=sr.Section(rings=(ring,), measured=measured),
        **{"actuators": actuators} | others,
    )


def test_a_rigid_end_is_a_tool_at_the_tip_of_a_shorter_arm():
    tool = Marker(name="tool", offset=(0.0, 0.0, LENGTH - SHORT))
    expected = marker_positions(arm(SHORT, markers=(tool,)), FREE)[:, 0]
    rigid = arm(rigid_pieces=(RigidPiece(start=SHORT),))
    np.testing.assert_allclose(sr.tip_positions(rigid, FREE), expected, atol=1e-7)


def test_a_tendon_that_is_pulled_in_shortens_by_nothing_in_a_rigid_piece():
    pulled = {
        "actuators": (
            LengthTendon(name="q", distance=0.008, activation_bounds=(0.0, 0.004)),
            LengthTendon(name="p", distance=0.006, offset=2.0, activation_bounds=(0.0, 0.002)),
        ),
        "rest": RestShape(curvature_x=2.0),
    }
    lengths = [[0.003, 0.0], [0.002, 0.001]]
    short = arm(SHORT, markers=(Marker(name="tool", offset=(0.0, 0.0, LENGTH - SHORT)),), **pulled)
    straight = Samples(
        stations_over_length=(0.0, SHORT / LENGTH, SHORT / LENGTH + 1e-9, 1.0),
        values=(2.0, 2.0, 0.0, 0.0),
        interpolation="linear",
    )
    pulled["rest"] = RestShape(curvature_x=straight)
    rigid = arm(rigid_pieces=(RigidPiece(start=SHORT),), **pulled)
    expected = marker_positions(short, lengths)[:, 0]
    np.testing.assert_allclose(sr.tip_positions(rigid, lengths), expected, atol=1e-7)


def test_a_rigid_piece_keeps_its_shape_at_rest():
    bent = arm(rest=RestShape(curvature_x=3.0, twist=1.0), rigid_pieces=(RigidPiece(),))
    (free, driven) = sr.tip_positions(bent, [[0.0, 0.0], [-0.5, 2.0]])
    plain = arm(rest=RestShape(curvature_x=3.0, twist=1.0))
    np.testing.assert_array_equal(driven, free)
    np.testing.assert_allclose(free, sr.tip_positions(plain, [0.0, 0.0])[0], atol=1e-7)


def test_a_load_on_a_rigid_end_acts_by_its_lever_arm():
    """A weight at the tip of the piece is that of a payload whose center is beyond the tip."""
    lever = (0.0, 0.0, LENGTH - SHORT)
    tool = Marker(name="tool", offset=lever)
    loads = sr.Loads(gravity=(3.0, 0.0, -9.0), payload=0.01)
    short = arm(SHORT, markers=(tool,), loads=loads.replace(payload_arm=lever))
    rigid = arm(rigid_pieces=(RigidPiece(start=SHORT),), loads=loads)
    expected = marker_positions(short, FREE, tol=1e-9)[:, 0]
    np.testing.assert_allclose(sr.tip_positions(rigid, FREE, tol=1e-9), expected, atol=1e-8)


@pytest.mark.parametrize("loads", [None, sr.Loads(tip_force=(0.05, 0.02, -0.05))])
def test_a_rigid_piece_is_the_limit_of_a_stiff_one(loads):
    places = (0.0, 0.4, 0.6, 1.0)
    rigid = arm(loads=loads, rigid_pieces=(RigidPiece(start_over_length=0.4, end_over_length=0.6),))
    limit = sr.tip_positions(rigid, FREE, tol=1e-9)
    errors = []
    for factor in (1e3, 1e4):
        plain = map(float, arm().stiffness_at(0.0))
        along = (Pieces(stations_over_length=places, values=(k, factor * k, k)) for k in plain)
        fields = ("axial_stiffness", "bending_stiffness", "torsion_stiffness")
        stiff = arm(loads=loads, measured=Measured(**dict(zip(fields, along, strict=True))))
        errors.append(np.abs(sr.tip_positions(stiff, FREE, tol=1e-9) - limit).max())
    assert errors[1] < 1e-4 * LENGTH
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.05)


def test_in_a_rigid_piece_nothing_is_deformed_and_beside_it_nothing_changes():
    z = np.linspace(0.0, LENGTH, 301)
    pieces = (RigidPiece(start=0.06, end=0.09), RigidPiece(start="wrist", end=0.24))
    made = arm(rigid_pieces=pieces, stations={"wrist": 0.21})
    assert made.breakpoints == (0.06, 0.09, 0.21, 0.24)
    inside = ((z >= 0.06) & (z < 0.09)) | ((z >= 0.21) & (z < 0.24))
    for found, plain in (
        (tables(made, z).extension, tables(arm(), z).extension),
        (tables(made, z).curvature, tables(arm(), z).curvature),
        (compliance(made, z)[1], compliance(arm(), z)[1]),
    ):
        np.testing.assert_array_equal(found[~inside], plain[~inside])
        assert not found[inside].any()
    shape = sr.configuration(made, FREE[0], [0.07, 0.08])
    assert not shape.curvature.values.any()
    np.testing.assert_array_equal(shape.extension, 1.0)


def test_a_rigid_piece_at_the_base_lifts_the_arm():
    rigid = arm(rigid_pieces=(RigidPiece(end=LENGTH - SHORT),))
    expected = sr.tip_positions(arm(SHORT), FREE) + [0.0, 0.0, LENGTH - SHORT]
    fiber, end = arm(SHORT).actuators[0], np.array([LENGTH - SHORT])
    turned = fiber.rotation(rigid.profile, rigid.section.ring(fiber.ring), end)
    # the fiber winds on through the piece
    offset = fiber.offset - float(turned[0])
    fiber = rigid.actuators[0].replace(offset=offset)
    made = rigid.replace(actuators=(fiber, rigid.actuators[1]))
    np.testing.assert_allclose(sr.tip_positions(made, FREE), expected, atol=1e-7)


def test_an_arm_that_is_all_rigid_stays_straight_under_any_load():
    loads = sr.Loads(gravity=(9.81, 0.0, 0.0), payload=0.01)
    made = arm(rigid_pieces=(RigidPiece(),), loads=loads)
    np.testing.assert_allclose(sr.tip_positions(made, FREE), [[0.0, 0.0, LENGTH]] * 3, atol=1e-15)
    assert sr.describe(made).extension == (1.0, 1.0)


def test_files_and_parameters_hold_rigid_pieces():
    pieces = (RigidPiece(start="wrist", end_over_length=0.9), RigidPiece(end=0.01))
    made = arm(rigid_pieces=pieces, stations={"wrist": 0.21})
    assert sr.Manipulator.from_toml(made.to_toml()) == made
    moved = changed(made, {"stations.wrist": 0.2, "rigid_pieces[1].end": 0.02})
    assert moved.breakpoints == (0.02, 0.2, 0.27)
    assert parameters(moved)["rigid_pieces[0].start"].value(moved) == 0.2


SAME = (Marker(name="a"), Marker(name="a"))
BEYOND = (Marker(name="a", station=1.1),)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ARM.replace(markers=SAME), r"markers\[1\].name = 'a': must differ"),
        (lambda: ARM.replace(markers=BEYOND), "markers.a.station = 1.1: must be on the arm"),
        (lambda: ARM.replace(markers=3), "must be Markers"),
        (lambda: Marker(name=""), "name = '': must be given"),
        (lambda: Marker(name="a", offset=(1.0, 2.0)), "must be three finite numbers"),
        (lambda: Marker(name="a", station=0.1, station_over_length=0.5), "exactly one of station"),
        (
            lambda: arm(rigid_pieces=(RigidPiece(start=0.2, end=0.1),)),
            r"rigid_pieces\[0\].end = 0.1: must be above",
        ),
        (lambda: arm(rigid_pieces=SAME[:1]), "must be RigidPieces"),
    ],
)
def test_markers_and_pieces_that_are_nowhere_are_refused(make, message):
    with pytest.raises(InvalidDesign, match=message):
        make()
