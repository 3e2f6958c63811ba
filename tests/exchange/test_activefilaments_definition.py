"""Definitions of ActiveFilaments.jl: what is read, what is written, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    Chamber,
    LinearTaper,
    Material,
    ObliqueMuscle,
    Pieces,
    PiecewiseTaper,
    Samples,
    Section,
    Tendon,
    designs,
)
from softreach.exchange.activefilaments import design_script, read_design, write_design
from softreach.exchange.activefilaments.filament import arm_of, filament_of
from softreach.exchange.activefilaments.julia import Julia
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
USE = """
sol = solveIntrinsic(filament, activation)
γBounds = [([-2.4, -2.0, -2.7], [0.0, 0.0, 0.0])]
nTrajectories = 2000000
path = string("cloud", "/one_ring_three_fibers")
(sol, activationsGamma) = generateIntrinsicReachVol(
    filament, activation, γBounds, nTrajectories, path;
    save_gamma_structs = false)
using JLD2
@save string(path, "filament.jld2") filament
"""
RING = "Ring(MechanicalProperties(1.0e6, 0.5), Geometry(0.1, 0.2), FiberArchitecture(0.0))"
SECTORS = "activation = [ActivationPiecewiseGamma(1, [-1.0], 1.0, 0.0)]\n"
PLAIN = f"filament = AFilament([{RING}]; L = 1.0)\n{SECTORS}"


@pytest.fixture
def read(tmp_path):
    """The design in a text."""

    def from_text(text: str | bytes) -> sr.Manipulator:
        path = tmp_path / "filament.jl"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return read_design(path)

    return from_text


def test_the_definition_of_the_readme_is_the_filament(read):
    arm, named = read(README + USE), designs.filament()
    shape = sr.configuration(arm, [-2.0, -1.3, 0.0], stations=[0.1], tol=1e-12)
    np.testing.assert_allclose(shape.position[0], POSITION, rtol=0, atol=1e-12)
    np.testing.assert_allclose(shape.directors[0], DIRECTORS, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(arm.bounds, named.bounds)
    assert arm.profile == named.profile
    assert arm.section.mass_per_length(1.0) == named.section.mass_per_length(1.0)


def test_without_bounds_they_are_the_default_widened_to_hold_the_activation(read):
    expected = [[-2.0, 0.0], [-5 / 3, 0.0], [-5 / 3, 0.0]]
    np.testing.assert_array_equal(read(README).bounds, expected)


def there_and_back(arm: sr.Manipulator, folder) -> sr.Manipulator:
    write_design(arm, folder / "filament.jl")
    return read_design(folder / "filament.jl")


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


@pytest.mark.parametrize("name", ["minimal_trunk", "redundant_trunk", "lce_arm", "filament"])
def test_a_named_design_of_fibers_survives_as_a_filament(name, tmp_path):
    arm = getattr(designs, name)()
    again = there_and_back(arm, tmp_path)
    same_tips(arm, again)
    assert design_script(again).split("rings = [")[1].count("Ring(") == len(again.section.rings)


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
    assert filament.to_columns(np.array([[-1.0, -0.5, 0.0, -0.25]])).tolist() == [
        [-4.0, -2.0, 0.0, -1.0]
    ]


def test_columns_there_and_back_are_the_same_activations():
    arm = layered()
    filament, gamma = filament_of(arm), in_box(arm, 5)
    assert filament.columns == arm.bundles + 1  # one for the ring without fibers
    np.testing.assert_allclose(filament.from_columns(filament.to_columns(gamma)), gamma)


def test_a_helical_angle_in_pieces_survives(tmp_path):
    angle = Pieces(stations_over_length=(0, 0.3, 1), values=(0.4, -0.2))
    arm = tube_of(sr.FiberArchitecture(helical_angle=angle, extent=0.5))
    again = there_and_back(arm, tmp_path)
    same_tips(arm, again)
    assert again.fibers[0].helical_angle == angle


def test_a_filament_and_its_arm_say_the_same():
    filament = filament_of(layered())
    assert filament_of(arm_of(filament)).rings[0].inner_radius == filament.rings[0].inner_radius
    assert [one.outer_radius for one in filament_of(arm_of(filament)).rings] == pytest.approx(
        [ring.outer_radius for ring in filament.rings]
    )


FIBER = sr.FiberArchitecture(name="fiber", helical_angle=0.1, extent=0.5)
LINEAR = Samples(stations_over_length=(0, 1), values=(0.1, 0.2))
STIFF = sr.Ring(inner_ratio=0.5, material=Material(young_modulus=1e6))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"actuators": (FIBER, Tendon(distance=0.01, activation_bounds=(0, 1)))}, "Tendon"),
        (
            {
                "actuators": (
                    Chamber(distance=0.01, radius=0.002, activation_bounds=(0, 1), name="air"),
                )
            },
            "air = Chamber",
        ),
        ({"actuators": (ObliqueMuscle(helical_angle=0.3, extent=1),)}, "ObliqueMuscle"),
        (
            {"profile": PiecewiseTaper(length=1, stations_over_length=(0, 1), radii=(0.1, 0.1))},
            "a LinearTaper",
        ),
        ({"profile": LinearTaper(length=1, outer_radius=0.1, taper=5e-5)}, "taper"),
        ({"actuators": (FIBER.replace(end_over_length=0.5),)}, "all of the arm"),
        ({"actuators": (FIBER.replace(helical_angle=LINEAR),)}, "Pieces"),
        ({"section": Section(rings=(STIFF,), bore_ratio=0.2)}, "bore_ratio"),
        (
            {
                "section": Section(
                    rings=(STIFF, STIFF.replace(inner_ratio=0.7, outer_ratio=0.8)),
                )
            },
            "innermost",
        ),
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


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2π / 3", 2 * math.pi / 3),
        ("1 / 2pi", 1 / (2 * math.pi)),
        ("30.0 / 180.0 * pi", math.pi / 6),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^3^2", 512.0),
        ("2(1 + 2)", 6.0),
        ("1_000.5e-1", 100.05),
        (".5 - 1.", -0.5),
        ("1 - 2 - 3", -4.0),
        ("8 / 2 / 2", 2.0),
        ("deg2rad(30.0)", math.radians(30)),
        ("atan(1.0) * x", math.pi),
        ("[1, -x, (2, 3), ]", [1.0, -4.0, (2.0, 3.0)]),
        ("(1,)", (1.0,)),
        ("Float64[1, 2]", [1.0, 2.0]),
    ],
)
def test_arithmetic_is_that_of_julia(text, value):
    assert Julia("text").read(f"x = 4.0\ny = {text}")["y"] == value


@pytest.mark.parametrize(
    ("text", "line", "told"),
    [
        ("R = radius(3)\n" + PLAIN.replace("0.2", "R"), 1, "radius"),
        ("rings = [1]\nrings .*= 2\n" + PLAIN.replace(f"[{RING}]", "rings"), 2, "rings"),
        ("r = []\npush!(r, 1)\n" + PLAIN.replace(f"[{RING}]", "r"), 2, "push!"),
        ("R = 0.2\n3 > 2 && (R = 0.4)\n" + PLAIN.replace("0.2", "R"), 2, "plain assignment"),
        ("R = 0.2\nR, r = 0.3, 0.1\n" + PLAIN.replace("0.2", "R"), 2, "plain assignment"),
        ("r = [1.0]\nx = pop!(r)\n" + PLAIN.replace(f"[{RING}]", "r"), 2, "plain assignment"),
        ("r = [1.0]\nr[1] = 2.0\n" + PLAIN.replace(f"[{RING}]", "r"), 2, "plain assignment"),
        ("\n\nfor i in 1:3\n  x = i\nend\n" + PLAIN, 3, "for"),
        (PLAIN.replace("0.2", "0.2 +"), 1, "'\\)'"),
        (PLAIN.replace("0.2", "2^2000"), 1, "finite"),
        (PLAIN.replace("0.2", "1 / 0"), 1, "finite"),
        (PLAIN.replace("0.2", "(-8)^0.5"), 1, "finite"),
        (PLAIN.replace("0.2", "1e999"), 1, "finite"),
        (PLAIN.replace("1.0e6, ", ""), 1, "nothing: must be given for ν"),
        (PLAIN.replace("L = 1.0", "length = 1.0"), 1, "length: must be one of rings, L"),
        (PLAIN.replace("L = 1.0", "L = 2.0, L = 3.0"), 1, "L twice: must be given each .* once"),
        (PLAIN.replace("0.1, 0.2", "0.1, R1 = 0.2"), 1, "R1 twice"),
        (PLAIN.replace("0.1, 0.2", "0.3, 0.2"), 1, "R1 = 0.3, R2 = 0.2: must be 0 <= R1 < R2"),
        (README.replace("L = 1.0", "L = 0.0"), 8, "R1 = 0, R2 = 0: must be 0 <= R1 < R2"),
        (PLAIN.replace("0.1, 0.2", "1e300, 1.0"), 1, "0 <= R1 < R2"),
        (PLAIN.replace("[-1.0]", "[-1.0, 0.0]"), 2, "N = 1"),
        (PLAIN.replace(SECTORS, ""), 1, "ActivationPiecewiseGamma"),
        (PLAIN.replace("0.1, 0.2", '"a", 0.2'), 1, "a"),
        ("x = (1, 2]\n" + PLAIN, 1, "']'"),
        (PLAIN + "x = [1, 2\n", 3, "closes"),
        (PLAIN + 'x = "text\n', 3, "quotation mark"),
        (PLAIN + "#= no end\n", 3, "end of the comment"),
        (PLAIN + "γBounds = [([-1.0, 0.0], [0.0, 0.0])]", 1, "1 numbers each"),
        ("x = " + "(" * 60 + "1" + ")" * 60 + "\n" + PLAIN.replace("0.2", "x"), 1, "levels"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_line(read, text, line, told):
    with pytest.raises(sr.InvalidInput, match=told) as error:
        read(text)
    assert f"filament.jl, line {line}" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (b"\xff\xfe\x00\x01", "text in UTF-8"),
        ("", "no filament"),
        ("x = 1\n" * 200_000, "at most 0.1 MB"),
        (PLAIN + PLAIN.replace("filament =", "other ="), "lines 1 and 3"),
        (PLAIN.replace("1.0e6, 0.5", "1.0e6, 0.7"), "poisson_ratio"),
    ],
)
def test_a_file_without_a_filament_is_refused_in_one_line(read, text, told):
    with pytest.raises(sr.InvalidInput, match=told) as error:
        read(text)
    assert "\n" not in str(error.value)


def test_nothing_in_a_definition_is_run(read, tmp_path):
    """What is no number is passed over where the filament does not need it."""
    trap = tmp_path / "trap"
    hostile = f'run(`touch {trap}`)\nx = open("{trap}", "w")\n__import__("os").system("x")\n'
    assert read(hostile + PLAIN) == read(PLAIN)
    assert not trap.exists()


@given(text=st.text(st.sampled_from('()[]{}=,;:+-*/^."#`@ \n1eπR!Ring') | st.characters()))
def test_any_text_is_read_or_refused_in_one_line(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("julia") / "any.jl"
    path.write_text(text, encoding="utf-8", errors="replace")
    with pytest.raises(sr.InvalidInput) as error:
        read_design(path)
    assert "\n" not in str(error.value)


def test_statements_that_change_no_name_are_passed_over(read):
    """Comparisons, pairs, keyword arguments and conditions."""
    more = "sol = solve(filament; L = 3.0)\nL <= R\nL => R\nx = L != R\nplot(R, L = 2)\n"
    definition = "L = 1.0; R = 0.2\n" + PLAIN.replace("0.2", "R").replace("1.0)", "L)")
    assert read(definition.replace("filament =", more + "filament =") + more) == read(PLAIN)


def test_a_mark_at_the_beginning_of_the_file_does_no_harm(read):
    assert read(b"\xef\xbb\xbfR = 0.2\r\n" + PLAIN.replace("0.2", "R").encode()) == read(PLAIN)


def test_names_may_be_given_twice_and_statements_share_a_line(read):
    arm = read(
        "R = 9; R = 0.2 # the last counts\nconst r = R / 2\n" + PLAIN.replace("0.1, 0.2", "r, R")
    )
    assert arm == read(PLAIN)
