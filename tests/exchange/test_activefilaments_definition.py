"""Definitions of ActiveFilaments.jl: what is read, what is written, and what is refused."""

import json
from functools import reduce
from operator import getitem
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import LinearTaper, Material, Pieces, PiecewiseTaper, Samples, Section, designs
from softreach.arm.parameters import changed
from softreach.cli.app import run
from softreach.exchange.activefilaments import (
    design_script,
    gamma_path,
    read_cloud,
    read_design,
    write_cloud,
)
from softreach.exchange.activefilaments.filament import filament_of
from softreach.support.errors import SoftreachWarning
from tests.exchange.julia import json_of
from tests.laws import arm_of as tube_of
from tests.laws import arms, in_box
from tests.test_golden import DIRECTORS, POSITION

README = """
using ActiveFilaments
E = 1.0e6 # Young's modulus
ν = 0.5
mech = MechanicalProperties(E, ν)
L = 1.0
R2 = L / 16.0
geom = Geometry(R2 * 0.6, R2)
arch = FiberArchitecture(pi / 10.0)
rings = [Ring(mech, geom, arch)]
filament = AFilament(rings; L = L, ρvol = 1000.0)
activation = [ActivationPiecewiseGamma(3, [-2.0, -1.3, 0.0], 30.0 / 180.0 * pi, 0.0)]
"""
ROWS, FILAMENT = 200, designs.filament()
BOUNDS = "γBounds = [([-2.4, -2.0, -2.7], [0.0, 0.0, 0.0])]\n"


def read(folder, text: str) -> sr.Manipulator:
    (folder / "filament.json").write_text(text, encoding="utf-8")
    return read_design(folder / "filament.json")


def test_the_definition_of_the_readme_is_the_filament(tmp_path):
    arm, named = read(tmp_path, json_of(README + BOUNDS)), FILAMENT
    shape = sr.configuration(arm, [-2.0, -1.3, 0.0], stations=[0.1], tol=1e-12)
    np.testing.assert_allclose(shape.position[0], POSITION, rtol=0, atol=1e-12)
    np.testing.assert_allclose(shape.directors[0], DIRECTORS, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(arm.bounds, named.bounds)
    assert arm.profile == named.profile
    assert arm.section.mass_per_length(1.0) == named.section.mass_per_length(1.0)


def test_without_bounds_they_are_the_default_widened_to_hold_the_activation(tmp_path):
    expected = [[-2.0, 0.0], [-5 / 3, 0.0], [-5 / 3, 0.0]]
    np.testing.assert_array_equal(read(tmp_path, json_of(README)).bounds, expected)


def there_and_back(arm: sr.Manipulator, folder) -> sr.Manipulator:
    return read(folder, json_of(design_script(arm)))


def same_tips(arm: sr.Manipulator, other: sr.Manipulator) -> None:
    """Each under the activations that are the other's."""
    gamma = in_box(arm, 4)
    there = filament_of(arm).to_columns(gamma)
    np.testing.assert_allclose(
        sr.tip_positions(other, filament_of(other).from_columns(there), tol=1e-9),
        sr.tip_positions(arm, gamma, tol=1e-9),
        rtol=0,
        atol=4e-9 * arm.length,
    )


@given(arm=arms())
def test_a_written_definition_reads_back_to_the_same_tips(arm, tmp_path_factory):
    assume(arm.profile.taper == 0 or abs(arm.profile.taper) >= 1e-4)
    same_tips(arm, there_and_back(arm, tmp_path_factory.mktemp("julia")))


def layered() -> sr.Manipulator:
    """Rings of different materials, the outer first; two families share one, one has none."""
    soft = Material(young_modulus=1e5, poisson_ratio=0.45, density=900.0)
    stiff = Material(young_modulus=2e6, poisson_ratio=0.3, density=1200.0)
    rings = (
        sr.Ring(inner_ratio=0.8, material=stiff, name="skin"),
        sr.Ring(inner_ratio=0.6, outer_ratio=0.8, material=soft, name="passive"),
        sr.Ring(inner_ratio=0.3, outer_ratio=0.6, material=stiff, name="deep"),
    )
    fibers = (
        sr.FiberArchitecture(name="a", ring="skin", revolution=1.0, extent=0.5, bundles=2),
        sr.FiberArchitecture(name="b", ring="deep", helical_angle=-0.4, extent=0.7),
        sr.FiberArchitecture(name="c", ring=0, helical_angle=0.1, extent=0.3, offset=1.0),
    )
    return sr.Manipulator(
        profile=LinearTaper(length=0.5, outer_radius=0.03, taper=0.02),
        section=Section(rings=rings, core=soft),
        actuators=fibers,
    )


def test_layers_survive_with_their_stiffness_and_the_mass(tmp_path):
    arm = layered()
    again = there_and_back(arm, tmp_path)
    same_tips(arm, again)
    for one, other in zip(arm.section.stiffness(0.03), again.section.stiffness(0.03), strict=True):
        assert other == pytest.approx(one)
    assert again.section.mass_per_length(0.03) == pytest.approx(arm.section.mass_per_length(0.03))


def test_families_that_share_a_ring_share_its_modulus_and_multiply_their_activations():
    filament = filament_of(designs.redundant_trunk(material=Material(young_modulus=1e6)))
    assert [ring.young_modulus for ring in filament.rings] == [2.5e5] * 4
    columns = filament.to_columns(np.array([[-1.0, -0.5, 0.0, -0.25]]))
    assert columns.tolist() == [[-4.0, -2.0, 0.0, -1.0]]


def test_a_helical_angle_in_pieces_survives(tmp_path):
    angle = Pieces(stations_over_length=(0, 0.3, 1), values=(0.4, -0.2))
    arm = changed(tube_of(sr.FiberArchitecture(helical_angle=angle, extent=0.5)), {"length": 0.8})
    again = there_and_back(arm, tmp_path)
    same_tips(arm, again)
    assert again.fibers[0].helical_angle == angle


FIBER = sr.FiberArchitecture(name="fiber", helical_angle=0.1, extent=0.5)
LINEAR = Samples(stations_over_length=(0, 1), values=(0.1, 0.2))
STIFF = sr.Ring(inner_ratio=0.5, material=Material(young_modulus=1e6))
AIR = sr.Chamber(distance=0.01, radius=0.002, activation_bounds=(0, 1), name="air")
ROUND = PiecewiseTaper(length=1, stations_over_length=(0, 1), radii=(0.1, 0.1))
INSIDE = STIFF.replace(inner_ratio=0.7, outer_ratio=0.8)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"actuators": (FIBER, AIR)}, "air = Chamber"),
        ({"profile": ROUND}, "a LinearTaper"),
        ({"profile": LinearTaper(length=1, outer_radius=0.1, taper=5e-5)}, "taper"),
        ({"actuators": (FIBER.replace(end_over_length=0.5),)}, "all of the arm"),
        ({"actuators": (FIBER.replace(helical_angle=LINEAR),)}, "Pieces"),
        ({"section": Section(rings=(STIFF,), bore_ratio=0.2)}, "bore_ratio"),
        ({"section": Section(rings=(STIFF, INSIDE))}, "innermost"),
    ],
)
def test_what_no_filament_has_is_refused_in_one_line(changes, reason):
    arm = sr.Manipulator(
        profile=LinearTaper(length=1.0, outer_radius=0.1),
        section=Section(rings=(STIFF,)),
        actuators=(FIBER,),
    ).replace(**changes)
    with pytest.raises(sr.InvalidInput, match=reason) as error:
        design_script(arm)
    assert "\n" not in str(error.value)
    assert "ActiveFilaments.jl" in str(error.value)


DEFINITION = json.loads(json_of(README + BOUNDS))
NO_PIECES = {"expressions": [0.1, 0.2], "piecewiseRanges": [[0, 0.4], [0.5, 1]]}


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [
        ("rings", [], r"definition\.rings = \[\]: must be a list"),
        ("rings 0 geometry R1", "a", r"rings\[0\]\.geometry\.R1 = 'a': must be a finite number"),
        ("rings 0 geometry R1", 0.3, "must be 0 <= R1 < R2"),
        ("rings 0 fiberArchitecture α2", NO_PIECES, "follow one another from 0 to L"),
        ("innerTube geometry R2", 0.01, "from 0 to the innermost ring, 0.0375"),
        ("γBounds 0 1", [0.0, 0.0], r"γBounds\[0\]\[1\] = .*: must be a list of 3"),
    ],
)
def test_a_fault_is_told_with_its_place(place, value, told, tmp_path):
    definition = json.loads(json.dumps(DEFINITION))
    *ways, last = [int(key) if key.isdigit() else key for key in place.split()]
    reduce(getitem, ways, definition)[last] = value
    with pytest.raises(sr.InvalidInput, match=told) as error:
        read(tmp_path, json.dumps(definition))
    assert "\n" not in str(error.value)


def test_rings_stand_from_inside_out(tmp_path):
    definition = json.loads(json_of(design_script(layered())))
    for name in ("rings", "activation", "γBounds"):
        definition[name].reverse()
    with pytest.raises(sr.InvalidInput, match="the innermost first and the outermost last"):
        read(tmp_path, json.dumps(definition))


@given(text=st.text(st.sampled_from('[]{}:,"1e. \nLγ')) | st.just("[" * 100_000))
def test_any_text_is_read_or_refused_in_one_line(text, tmp_path_factory):
    with pytest.raises(sr.InvalidInput) as error:
        read(tmp_path_factory.mktemp("julia"), text)
    assert "\n" not in str(error.value)


# Clouds of ActiveFilaments.jl: two CSV files without headers, and the tips that belong to them


@pytest.fixture
def tips(tmp_path):
    """NAME.csv of a cloud of the filament; NAME_gamma.csv lies beside it."""
    path = tmp_path / "cloud.csv"
    write_cloud(sr.compute_cloud(FILAMENT, n=ROWS, tol=1e-9), path)
    return path


def numbers(path) -> np.ndarray:
    return np.array([line.split(",") for line in path.read_text().splitlines()], float)


@pytest.mark.parametrize(("name", "scale"), [("filament", 1), ("minimal_trunk", 3), ("lce_arm", 1)])
def test_the_files_hold_tips_and_the_sectors_of_the_written_filament(name, scale, tmp_path):
    cloud = sr.compute_cloud(getattr(designs, name)(), n=ROWS)
    path = tmp_path / "cloud.csv"
    write_cloud(cloud, path)
    np.testing.assert_array_equal(numbers(path), cloud.tip)
    np.testing.assert_array_equal(numbers(gamma_path(path)), scale * cloud.activation)
    assert gamma_path(path).name == "cloud_gamma.csv"


@pytest.mark.parametrize("name", ["filament", "redundant_trunk", "lce_arm"])
def test_a_cloud_survives_both_files(name, tmp_path):
    arm = getattr(designs, name)()
    cloud = sr.compute_cloud(arm, n=ROWS)
    write_cloud(cloud, tmp_path / "cloud.csv")
    again = read_cloud(arm, tmp_path / "cloud.csv")
    np.testing.assert_array_equal(again.tip, cloud.tip)
    np.testing.assert_allclose(again.activation, cloud.activation, rtol=1e-15)
    assert again.attrs["largest_tip_difference"] < 2e-6 * arm.length
    assert "seed" not in again.attrs
    sr.save_cloud(again, tmp_path / "cloud.zarr")
    assert sr.cloud.design_of(sr.open_cloud(tmp_path / "cloud.zarr")) == arm


def test_the_largest_difference_of_tips_is_told(tips):
    moved = numbers(tips)
    moved[7] += [0, 3e-3, 4e-3]
    np.savetxt(tips, moved, delimiter=",")
    with pytest.warns(SoftreachWarning, match="differ by up to 0.005 L"):
        cloud = read_cloud(FILAMENT, tips)
    assert cloud.attrs["largest_tip_difference"] == pytest.approx(5e-3, rel=1e-3)


def test_activations_outside_of_the_bounds_are_told(tips):
    with pytest.warns(SoftreachWarning, match="leave the bounds"):
        read_cloud(FILAMENT.with_bounds((-1.5, 0.0)), tips)


def test_numbers_of_julia_are_read(tmp_path):
    tips = tmp_path / "one.csv"
    tips.write_text("-0.0,1.0e-5,1.0\n")
    gamma_path(tips).write_text("-0.0,0.0,-1.0e-17")
    with pytest.warns(SoftreachWarning):
        assert read_cloud(FILAMENT, tips).tip.values.tolist() == [[0.0, 1e-5, 1.0]]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"1,2,3\n1,2,three\n", "column z = .*'three'"), (b"\xff\xfe\n", "text in UTF-8"),
        (b"1,2,3\n1,nan,3\n", "y in row 1"), (b"9" * 100_000 + b"x", "1 column: must be 3"),
    ],
    ids=range(4),
)  # fmt: skip
def test_what_is_no_table_of_numbers_is_refused_in_one_short_line(content, told, tips):
    tips.write_bytes(content)
    with pytest.raises(sr.InvalidInput, match=told) as error:
        read_cloud(FILAMENT, tips)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400 + len(str(tips))


@pytest.mark.parametrize(
    ("rows", "told"),
    [("0,0\n" * ROWS, "2 columns: must be 3: the sectors"), ("0,0,0\n", f"1 row: must be {ROWS}")],
)
def test_activations_of_another_shape_or_missing_are_refused(rows, told, tips):
    gamma_path(tips).write_text(rows)
    with pytest.raises(sr.InvalidInput, match=told):
        read_cloud(FILAMENT, tips)
    gamma_path(tips).unlink()
    with pytest.raises(sr.InvalidInput, match=r"cloud_gamma\.csv: must be a file that exists"):
        read_cloud(FILAMENT, tips)


def test_a_cloud_of_an_arm_that_is_no_filament_is_refused(tmp_path):
    cloud = sr.compute_cloud(designs.three_chamber_arm(), n=10)
    with pytest.raises(sr.InvalidInput, match=r"ActiveFilaments\.jl"):
        write_cloud(cloud, tmp_path / "cloud.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def folder(folder):
    """An empty folder with a definition and a cloud of the filament."""
    FILAMENT.save("filament.toml")
    Path("filament.jl").write_text(design_script(FILAMENT))
    Path("filament.json").write_text(json_of(design_script(FILAMENT)))
    sr.save_cloud(sr.compute_cloud(FILAMENT, n=ROWS), "cloud.zarr")
    return folder


def test_the_command_line_goes_there_and_back(folder, capsys):
    assert run(["import", "filament.json", "again.toml"]) == 0
    assert run(["export", "again.toml", "again.jl"]) == 0
    again, script = (Path(name).read_text() for name in ("again.jl", "filament.jl"))
    assert again == script.replace("# sector", "# ring 1")
    assert run(["export", "cloud.zarr", "tips.csv", "--format", "activefilaments"]) == 0
    assert run(["import", "tips.csv", "back.zarr", "--design", "filament.toml"]) == 0
    assert "largest difference of tips" in capsys.readouterr().out
    back, cloud = (sr.open_cloud(name) for name in ("back.zarr", "cloud.zarr"))
    np.testing.assert_array_equal(back.activation, cloud.activation)
