"""Units that a user chooses: what is shown, written and typed in mm is what it is in m."""

import math
import re
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach import export, plot
from softreach.arm.manipulator import scale_warnings
from softreach.cli.app import run
from softreach.rod.summary import design_warnings
from softreach.support.errors import InvalidDesign, InvalidInput, SoftreachWarning
from softreach.support.quantity import quantity, read_quantity, unit_names
from softreach.support.units import UNITS, as_unit, lengths_in, read_length


@pytest.fixture(scope="module")
def lce():
    return sr.designs.lce_arm()


@pytest.fixture(scope="module")
def shape(lce):
    return sr.configuration(lce, [-1.0, 0.0, -0.4])


@pytest.fixture(scope="module")
def cloud(lce):
    return sr.compute_cloud(lce, 2_000)


@pytest.mark.parametrize(
    ("name", "lengths", "areas", "volumes", "liters"),
    [
        ("m", 1.0, "m²", "m³", 1e-3),
        ("cm", 1e2, "cm²", "liters", 1.0),
        ("mm", 1e3, "mm²", "mL", 1e3),
        ("in", 1 / 0.0254, "in²", "in³", 61.02374),
    ],
)
def test_areas_and_volumes_have_units_of_their_own(name, lengths, areas, volumes, liters):
    unit = as_unit(name)
    assert float(unit.of(1.0)) == pytest.approx(lengths)
    assert float(unit.of(0.1**3, 3)) == pytest.approx(liters)
    assert (unit.symbol(2), unit.symbol(3)) == (areas, volumes)
    assert unit.label("V", 3) == f"V [{volumes}]"


def test_a_value_in_a_unit_ends_with_the_first_digit_of_its_error():
    assert as_unit("mm").text(6.322431e-4, 3, 2.4e-7) == "632.2 ± 0.2 mL"
    assert as_unit("L", 2.0).text(0.25) == "0.125 L"


def test_other_units_are_refused_and_l_without_an_arm():
    for name in ("M", "mL", None, ["mm"]):
        with pytest.raises(InvalidInput, match=r"unit = .*: must be one of m, cm, mm, in, L"):
            as_unit(name, 1.0)
    with pytest.raises(InvalidInput, match="one of m, cm, mm, in; the length L of the arm is not"):
        as_unit("L")
    with pytest.raises(InvalidInput, match="unit = 'L': must be one of m, cm, mm, in"):
        export.export_mesh((np.eye(3), [[0, 1, 2]]), "a.stl", unit="L")


# What is typed


@given(value=st.floats(-1e6, 1e6), place=st.sampled_from(["", " "]))
def test_a_length_with_its_unit_is_that_without(value, place):
    assert read_length(f"{value!r}{place}m") == read_length(repr(value)) == value
    for unit, size in (("cm", 1e-2), ("mm", 1e-3), ("in", 0.0254)):
        assert read_length(f"{value!r}{place}{unit}") == pytest.approx(value * size, rel=1e-15)
    assert read_length(f"{value!r}{place}L", 2.0) == 2.0 * value


def test_a_vector_has_all_units_or_none():
    assert lengths_in("80mm, 5cm, -0.24m", 3) == [0.08, 0.05, -0.24]
    assert lengths_in("1L,2L,3L", 3, 0.5) == [0.5, 1.0, 1.5]
    wrong = ("80mm,50mm,-240", "80,50,-240mm", "1ft,2ft,3ft", "1mm,2mm", "mm,mm,mm", "1L,2L,3L")
    assert [text for text in wrong if lengths_in(text, 3) is not None] == []


@pytest.mark.parametrize("header", ["x [mm],y [mm],z [mm]", '"x_mm","y_mm","z_mm"', "x,y,z"])
def test_a_file_says_its_unit_in_its_header(header, folder, printed):
    row = "30,20,60" if "mm" in header else "30mm,20mm,60mm"
    (folder / "places.csv").write_text(f"{header}\n{row}\n")
    (one,) = printed("solve", "lce_arm", "--targets", "places.csv")
    assert one["target_m"] == [0.03, 0.02, 0.06]


# What is written


@pytest.mark.parametrize("suffix", [".ply", ".glb"])
def test_a_mesh_in_mm_is_a_thousand_times_one_in_m(suffix, lce, shape, cloud, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    hull = sr.convex_hull(cloud.tip)
    for write, given_in in ((export.export_arm, (lce, shape)), (export.export_mesh, (hull,))):
        bounds = {}
        for unit in ("m", "mm"):
            write(*given_in, path := tmp_path / f"{unit}{suffix}", unit=unit, overwrite=True)
            bounds[unit] = trimesh.load(path).bounds
        np.testing.assert_allclose(bounds["mm"], 1e3 * bounds["m"], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(("unit", "name"), [("m", "x"), ("mm", "x_mm"), ("L", "x_over_length")])
def test_a_table_says_its_unit_and_is_in_it(unit, name, cloud, tmp_path):
    pytest.importorskip("pyarrow")
    export.export_cloud(cloud, tmp_path / "cloud.csv", unit=unit)
    assert (tmp_path / "cloud.csv").read_text().startswith(f'"{name}",')
    written = np.loadtxt(tmp_path / "cloud.csv", delimiter=",", skiprows=1)[:, :3]
    size = as_unit(unit, float(cloud.tip.attrs["length"])).size
    np.testing.assert_allclose(written, cloud.tip / size, rtol=1e-12)
    export.export_cloud(cloud, tmp_path / "cloud.npz", unit=unit)
    with np.load(tmp_path / "cloud.npz") as arrays:
        assert str(arrays["tip_units"]) == unit


@pytest.mark.parametrize(("unit", "size"), [("m", 1.0), ("mm", 1e3)])
def test_the_command_line_writes_meters_unless_asked_and_says_so(unit, size, folder, shape, capsys):
    options = ["--unit", unit] if unit != "m" else []
    trimesh = pytest.importorskip("trimesh")
    assert run(["export", "lce_arm", "arm.stl", "--activation=-1,0,-0.4", *options]) == 0
    streams = capsys.readouterr()
    assert (streams.out, streams.err) == ("arm.stl\n", f"arm.stl: lengths in {unit}\n")
    top = trimesh.load("arm.stl").bounds[1, 2]
    assert top == pytest.approx(size * float(shape.position[:, 2].max()), rel=0.1)


# What is drawn


def test_a_picture_in_mm_is_a_thousand_times_one_in_m(lce, shape, cloud):
    hull, every = sr.convex_hull(cloud.tip), sr.equilibria(lce, [0, 0, 0])
    reached = sr.reachable_set(lce, accuracy=0.2).grid
    for draw, *data in (
        (plot.plot_arm, lce, shape),
        (plot.plot_cloud, cloud),
        (partial(plot.plot_slab, thickness=0.02), cloud),
        (lambda *data, unit: plot.plot_views(*data, unit=unit).axes[0], cloud, lce, shape),
        (plot.plot_hull, hull),
        (plot.plot_slice, reached),
        (lambda data, unit: plot.plot_slices(data, unit=unit).axes[1], reached),
        (plot.plot_cross_section, lce),
        (plot.plot_equilibria, every),
    ):
        mm, m = draw(*data, unit="mm"), draw(*data, unit="m")
        assert (mm.get_xlabel(), m.get_xlabel()) == ("x [mm]", "x [m]")
        limits = [np.array([ax.get_xlim(), ax.get_ylim()]) for ax in (mm, m)]
        np.testing.assert_allclose(limits[0], 1e3 * limits[1], rtol=1e-9)


def test_curvatures_are_per_unit_and_volumes_in_milliliters(lce, cloud):
    statistics = {"arm": sr.curvature.curvature_statistics(cloud)}
    tops = {unit: plot.plot_curvature(statistics, unit=unit) for unit in ("m", "mm", "L")}
    assert tops["mm"].get_ylabel() == "κ [1/mm]"
    top = {unit: ax.get_ylim()[1] for unit, ax in tops.items()}
    assert top["m"] == pytest.approx(1e3 * top["mm"])
    assert top["L"] == pytest.approx(lce.length * top["m"])


def test_pictures_in_different_units_do_not_share_axes(cloud, lce, shape):
    ax = plot.plot_cloud(cloud, unit="mm")
    plot.plot_arm(lce, shape, ax=ax, unit="mm")
    with pytest.raises(InvalidInput, match="ax = counted in mm: must be in cm"):
        plot.plot_arm(lce, shape, ax=ax, unit="cm")


# Commands and files of designs


def test_numbers_for_machines_do_not_depend_on_the_unit(lce, printed):
    asked = ["volume", "lce_arm", "--n", "3000", "--alpha", "0.4L", "--unit"]
    facts, *others = (printed(*asked, unit) for unit in UNITS)
    assert others == [facts] * (len(UNITS) - 1)
    assert facts["volume_m3"] == pytest.approx(lce.length**3 * facts["volume_L3"])


@pytest.mark.parametrize(
    ("length", "options", "shown"),
    [
        (0.999, [], "999 mm"),
        (1.0, [], "1 m"),
        (0.3, ["--unit", "cm"], "30 cm"),
        (2.0, ["--unit", "L"], "1 L"),
    ],
)
def test_a_length_is_shown_in_a_handy_unit_or_as_asked(length, options, shown, folder, capsys):
    sr.designs.minimal_trunk(length=length).save("arm.toml")
    assert run(["design", "arm.toml", *options]) == 0
    assert re.search(rf"^  length +{shown}$", capsys.readouterr().out, re.MULTILINE)


def test_the_unit_of_a_file_is_that_of_what_is_shown_and_written(folder, capsys):
    trimesh = pytest.importorskip("trimesh")
    assert run(["design", "lce_arm", "--unit", "cm", "--out", "arm.toml"]) == 0
    assert (folder / "arm.toml").read_text().endswith('\n[display]\nunit = "cm"\n')
    capsys.readouterr()
    assert run(["design", "arm.toml"]) == 0
    assert re.search(r"^  length +9 cm$", capsys.readouterr().out, re.MULTILINE)
    assert run(["export", "arm.toml", "arm.stl", "--activation", "0,0,0"]) == 0
    assert trimesh.load("arm.stl").bounds[1, 2] == pytest.approx(9.0)
    assert "lengths in cm" in capsys.readouterr().err


def test_the_unit_is_no_part_of_the_design(lce, tmp_path):
    shown = lce.replace(display_unit="mm")
    assert (shown, hash(shown), shown.to_toml()) == (lce, hash(lce), lce.to_toml())
    shown.save(tmp_path / "arm.toml")
    again = sr.Manipulator.load(tmp_path / "arm.toml")
    assert (again, again.display_unit) == (lce, "mm")
    assert again.replace(loads=None).display_unit == "mm"


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ('unit = "ft"', "display.unit = 'ft': must be one of m, cm, mm, in, L"),
        ('units = "mm"', "display.units = 'mm': unknown key"),
    ],
)
def test_other_units_and_keys_of_a_file_are_refused(table, fault, lce):
    with pytest.raises(InvalidDesign, match=re.escape(fault)):
        sr.Manipulator.from_toml(f"{lce.to_toml()}\n[display]\n{table}\n")


# Sizes that are likely mistakes


def straight(length, radius):
    fiber = sr.FiberArchitecture(helical_angle=0.0, extent=1.0)
    return sr.Manipulator.tapered(
        length=length, outer_radius=radius, inner_radius=0.75 * radius, actuators=[fiber]
    )


def test_sizes_that_arms_have_are_not_warned_of():
    for name in sr.designs.__all__:
        assert scale_warnings(getattr(sr.designs, name)()) == ()
    assert not any("slender" in line for line in design_warnings(straight(0.3, 0.06)))


@pytest.mark.filterwarnings("always::softreach.support.errors.SoftreachWarning")
@pytest.mark.parametrize(
    ("length", "radius", "cause"),
    [
        (300.0, 12.0, r"the arm is 300 m long; if that is meant in mm: .* 300 mm are 0\.3"),
        (0.3, 12.0, r"0\.025 times as long .* if that is meant in mm: .* 12 mm are 0\.012"),
        (0.3, 0.061, r"4\.92 times as long as its outer radius .* is it a diameter\?"),
    ],
)
def test_a_file_with_a_likely_mistake_is_told_its_cause_once(length, radius, cause, folder, capsys):
    arm = straight(length, radius)
    arm.save("arm.toml")
    with pytest.warns(SoftreachWarning, match=rf"arm\.toml: .*{cause}") as told:
        assert sr.Manipulator.load("arm.toml") == arm
    assert len(told) == 1
    for command in (["design", "arm.toml"], ["solve", "arm.toml", "--target", "0,0,0"]):
        assert run(command) == 0
        assert len(re.findall(cause, capsys.readouterr().err)) == 1


def test_what_weighs_as_a_mountain_is_told_its_mass(lce):
    text = lce.to_toml().replace("length_m = 0.09", "length_m = 90.0")
    text = text.replace("outer_radius_m = 0.0045", "outer_radius_m = 4.5")
    said = design_warnings(sr.Manipulator.from_toml(text))[0]
    assert re.search(r"90 m long and weighs \d\.\d\de\+0\d kg", said)


# Numbers as they are printed: no digit that the error makes worthless


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.691642, 2.3e-5, "0.69164 ± 0.00002 m³"),
        (31.158, 0.0123, "31.16 ± 0.01 m³"),
        (1234.5, 20.0, "1234 ± 20 m³"),
        (5.5332e-6, 1e-10, "(5.5332 ± 0.0001)e-6 m³"),
        (0.0, 2e-4, "(0 ± 2)e-4 m³"),
        (0.5, 0.0, "0.5 m³"),
        (0.5, math.nan, "0.5 m³"),
        (math.nan, 0.1, "nan m³"),
    ],
)
def test_a_value_ends_with_the_first_digit_of_its_error(value, error, text):
    assert quantity(value, "m³", error) == text


@given(value=st.floats(1e-12, 1e12), share=st.floats(1e-9, 1.0))
def test_what_is_printed_is_off_by_less_than_the_error(value, share):
    text = quantity(value, error=share * value)
    mantissa, error, power = re.fullmatch(r"\(?([\d.]+) ± ([\d.]+)(?:\)e(-\d+))?", text).groups()
    scale = 10.0 ** int(power or 0)
    assert abs(float(mantissa) * scale - value) <= 0.51 * share * value
    assert float(error) * scale == pytest.approx(share * value, rel=0.5)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("200g", "kg", 0.2),
        ("+2e-1kg", "kg", 0.2),
        ("-3 mN", "N", -0.003),
        (".5mm", "m", 0.0005),
        ("1.4 MPa", "Pa", 1.4e6),
        ("2bar", "Pa", 2e5),
        ("1.07g/cm3", "kg/m³", 1070.0),
        ("-9.81m/s²", "m/s²", -9.81),
        ("2 N m", "N m", 2.0),
        ("2Nmm", "N m", 0.002),
        ("90°", "rad", math.pi / 2),
        ("0.5rad", "rad", 0.5),
        ("0.5", "1", 0.5),
        ("3K", "K", 3.0),
    ],
)
def test_a_number_with_a_unit_is_read_to_the_last_bit(text, unit, value):
    assert read_quantity(text, unit) == value


WRONG = ["", "g", "5", "5 stone", "nan{}", "inf{}", "1e999{}", "5{} {}", "1,5{}", "1_0{}", "0x1{}"]


@pytest.mark.parametrize("unit", ["kg", "m", "N", "N m", "N/m", "Pa", "kg/m³", "m/s²", "rad"])
def test_what_is_no_finite_number_with_a_unit_of_its_kind_is_refused(unit):
    for text in WRONG:
        with pytest.raises(ValueError, match=r"^"):
            read_quantity(text.format(*[unit_names(unit)[0]] * 2), unit)
