"""Parts to print and patterns to cut: closed, of the volumes and on the lines that formulas say."""

import re
from pathlib import Path

import numpy as np
import pytest

import softreach as sr
from softreach.arm.body import RestShape, mass
from softreach.arm.lines import line_lengths
from softreach.cli.app import run

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("manifold3d")

LENGTH, BASE, TIP, ACROSS = 0.2, 0.02, 0.01, 0.003  # m
CONE = np.pi / 3.0 * LENGTH * (BASE**2 + BASE * TIP + TIP**2)
SOFT, HARD = (sr.Material(young_modulus=1e5 * k, density=1e3 + k, name=f"m{k}") for k in (1, 2))
CABLES = sr.Tendon(name="t", bundles=2, distance_ratio=0.6, revolution=2, activation_bounds=(0, 1))
FIBER = sr.FiberArchitecture(name="fiber", helical_angle=0.4, offset=1.0, extent=0.8)
CHAMBERS = sr.designs.three_chamber_arm()


def tapered(actuator, tip=TIP, bore=0.2):
    """A cone of two materials that meet where its tendons are."""
    inside = sr.Ring(inner_ratio=bore, outer_ratio=0.6, material=SOFT)
    rings = inside, sr.Ring(inner_ratio=0.6, material=HARD)
    section = sr.Section(rings=rings, bore_ratio=bore)
    profile = sr.LinearTaper(length=LENGTH, outer_radius=BASE, tip_radius=tip)
    return sr.Manipulator(profile=profile, section=section, actuators=(actuator,))


def solids(arm, **options):
    """Parts as meshes that are closed and face out."""
    parts = sr.models.solids(arm, **options)
    meshes = {k: trimesh.Trimesh(x.vertices, x.faces, process=False) for k, x in parts.items()}
    assert all(mesh.is_watertight and mesh.is_winding_consistent for mesh in meshes.values())
    return meshes


def test_parts_fill_the_cone_without_overlap_and_channels_are_round_about_helices():
    parts = solids(arm := tapered(CABLES), channel_diameter=ACROSS)
    assert [*parts] == ["m1", "m2", "bore", "t 1", "t 2"]
    volumes = np.array([part.volume for part in parts.values()])
    expected = np.pi / 4.0 * ACROSS**2 * line_lengths(arm, [[0.0] * 2])[0]
    np.testing.assert_allclose(volumes[2:], [0.2**2 * CONE, *expected], rtol=1e-4)
    union = trimesh.boolean.union([*parts.values()], engine="manifold")
    np.testing.assert_allclose([volumes.sum(), union.volume], CONE, rtol=1e-6)
    center = parts["t 2"].section([0, 0, 1], [0, 0, LENGTH / 2]).centroid
    place = 0.3 * (BASE + TIP) * np.exp(1j * (np.pi + 1.0))
    np.testing.assert_allclose(center, [place.real, place.imag, LENGTH / 2], atol=2e-3 * TIP)


def test_what_ends_inside_is_closed_what_lies_outside_is_left_out_and_masses_agree():
    short = CABLES.replace(start_over_length=0.25, end_over_length=0.75, revolution=0.0)
    parts = solids(tapered(short, bore=0.0))
    np.testing.assert_allclose(parts["t 1"].bounds[:, 2], [0.05, 0.15], atol=1e-4)
    assert sum(part.volume for part in parts.values()) == pytest.approx(CONE, rel=1e-9)
    parts = solids(arm := tapered(CABLES.replace(distance_ratio=2.0), bore=0.0))
    weighed = sum(parts[each.name].volume * each.density for each in (SOFT, HARD))
    assert weighed == pytest.approx(mass(arm), rel=1e-9)
    assert [*solids(sr.designs.lce_arm()), *parts] == ["core", "fibers", "m1", "m2"]


def test_a_bent_arm_lies_in_a_torus_and_volumes_are_those_of_pappus():
    body, *chambers = solids(CHAMBERS.replace(rest=RestShape(curvature_y=8.0))).values()
    x, y, z = (body.vertices - [1.0 / 8.0, 0.0, 0.0]).T
    assert np.hypot(np.hypot(x, z) - 0.125, y).max() == pytest.approx(0.0125, rel=2e-3)
    radii = 1.0 - 8.0 * 0.0075 * np.cos(np.radians([90, 210, 330]))
    expected = np.pi * 0.15 * np.array([0.0125**2 - 3 * 0.004**2, *(0.004**2 * radii)])
    np.testing.assert_allclose([x.volume for x in (body, *chambers)], expected, rtol=1e-3)


def test_the_command_writes_a_file_a_part_in_mm(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tapered(CABLES).save("arm.toml")
    assert run(["export", "arm.toml", "parts", "--channel-mm", "3"]) == 0
    meshes = [trimesh.load(path) for path in Path("parts").glob("*.stl")]
    assert all(mesh.is_watertight for mesh in meshes)
    assert sum(mesh.volume for mesh in meshes) == pytest.approx(1e9 * CONE, rel=1e-6)
    assert run(["export", "arm.toml", "arm.stl", "--channel-mm", "3"]) == 2
    assert run(["export", "lce_arm", "ring.dxf"]) == run(["export", "lce_arm", "ring.svg"]) == 0


@pytest.mark.parametrize("tip", [TIP, 0.03, BASE * (1.0 - 1e-6)])
def test_a_pattern_rolled_up_again_is_the_fiber(tip):
    """By polar coordinates about the apex, and tan α ∫ dZ/(R cos φ) of theory (14)."""
    arm, tangent = tapered(FIBER.replace(ring=1), tip), (BASE - tip) / LENGTH
    sine, start = np.sin(np.arctan(0.8 * tangent)), 0.8 * BASE
    svg, dxf = sr.models.pattern(arm), sr.models.pattern(arm, format="dxf")
    pieces = dxf.split("POLYLINE")[1:]  # middle, edges, marks
    pairs = [re.findall(r"VERTEX\n.*\n.*\n10\n(.*)\n20\n(.*)", rows) for rows in pieces]
    middle, *edges = (1e-3 * np.array(line, float) for line in pairs)
    for points, half in zip((middle, *edges), (0.0, 0.4, np.pi), strict=False):
        x, y = points[:, 0] - start / sine, points[:, 1]
        theta, radius = np.arctan(y / x) / sine, np.hypot(x, y) * abs(sine)
        z = (start - radius) / (0.8 * tangent)
        turned = np.tan(0.4) / np.sin(np.arctan(tangent)) * np.log(start / radius)
        aside = radius * np.abs(np.abs(theta - turned) - half)
        assert np.minimum(aside, np.abs([z, z - LENGTH]).min(axis=0)).max() < 1e-9 * LENGTH
    length = np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()
    assert length == pytest.approx(line_lengths(arm, [[0.0]])[0, 0], rel=1e-5)
    assert middle[-1, 1] < middle[0, 1]  # right-handed, seen from outside
    assert {*re.findall(r"\d+\.\d{9}", dxf)} <= {*re.findall(r"\d+\.\d{9}", svg)}
    assert re.search(r'width="([\d.]+)mm" height="([\d.]+)mm" viewBox="\S+ \S+ \1 \2"', svg)


WIDE = CHAMBERS.actuators[0].replace(radius=0.006)
TURNS = FIBER.replace(helical_angle=None, revolution=500.0)
REFUSED = {
    "into itself": lambda: solids(CHAMBERS.replace(rest=RestShape(curvature_x=80.0))),
    "breaks through the surface": lambda: solids(CHAMBERS.replace(actuators=(WIDE,))),
    "channel_diameter = 0: must be": lambda: solids(CHAMBERS, channel_diameter=0),
    "only rings with fibers": lambda: sr.models.pattern(CHAMBERS),
    "winds over itself": lambda: sr.models.pattern(tapered(TURNS)),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_cannot_be_made_is_refused_in_a_sentence(sentence):
    with pytest.raises((sr.NotPossible, sr.InvalidInput), match=sentence) as refused:
        REFUSED[sentence]()
    assert "\n" not in str(refused.value)
