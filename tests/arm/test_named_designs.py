"""Named designs: each is what its source says, and holds to a law of its own."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from tools.designs import FOLDER, design_file
from tools.materials import page_with_table

import softreach as sr
from softreach.arm import designs
from softreach.arm.section import material_names, material_record, named_material
from softreach.rod.bending import sharpest_bending
from softreach.support.errors import InvalidInput
from tests.laws import in_box

NAMES = designs.__all__
MIRROR = np.diag([-1.0, 1.0, 1.0])


def named(name: str) -> sr.Manipulator:
    return getattr(designs, name)()


def tip(arm: sr.Manipulator, *activation: float) -> np.ndarray:
    return sr.tip_positions(arm, [activation], tol=1e-12)[0]


@pytest.mark.parametrize("name", NAMES)
def test_no_activation_shortens_a_named_design_to_nothing_or_folds_it_without_a_warning(name):
    arm = named(name)
    facts = sr.describe(arm)
    assert facts.extension[0] > 0.3
    warned = any("|κ| R2" in warning for warning in facts.warnings)
    assert warned == (sharpest_bending(arm).value >= 1)


@pytest.mark.parametrize("name", NAMES)
def test_a_named_design_says_where_it_comes_from(name):
    assert re.search(r"\[[A-Z]\w+\]", getattr(designs, name).__doc__)


@pytest.mark.parametrize("trunk", [designs.minimal_trunk, designs.redundant_trunk])
def test_the_material_of_a_trunk_changes_its_stiffness_and_none_of_its_shapes(trunk):
    plain, silicone = trunk(), trunk(material=named_material("dragon_skin_30"))
    gamma = in_box(plain, 3)
    np.testing.assert_allclose(
        sr.tip_positions(silicone, gamma), sr.tip_positions(plain, gamma), rtol=0, atol=1e-15
    )
    radius = plain.profile.outer_radius
    stiffer = silicone.section.stiffness(radius).axial / plain.section.stiffness(radius).axial
    assert stiffer == pytest.approx(silicone.section.rings[0].material.young_modulus)
    assert silicone.section.mass_per_length(radius) == pytest.approx(1080 * math.pi * radius**2)


def test_the_arm_of_the_laboratory_is_as_stiff_as_its_code_says():
    """A core and three rings in one place, each with 48/360 of the fibers' modulus."""
    arm = designs.lce_arm()
    outer, inner = 0.0045, 0.00375
    fiber, core = 3 * 1.4e6 * 48 / 360, 0.1278e6
    bending = math.pi / 4 * (fiber * (outer**4 - inner**4) + core * inner**4)
    twist = fiber * (outer**4 - inner**4) / 1.495 + core * inner**4 / 1.5
    stiffness = arm.section.stiffness(outer)
    assert stiffness.axial == pytest.approx(16.53165, rel=1e-6)
    assert stiffness.bending == pytest.approx(1.132275e-4, rel=1e-6) == bending
    assert stiffness.torsion == pytest.approx(7.569322e-5, rel=1e-6) == math.pi / 4 * twist
    assert arm.section.mass_per_length(outer) == pytest.approx(1000 * math.pi * outer**2)


def test_the_arm_of_the_laboratory_is_its_own_mirror_image():
    arm = designs.lce_arm()
    gamma = in_box(arm, 5)
    mirrored = sr.tip_positions(arm, gamma[:, [1, 0, 2]], tol=1e-10) @ MIRROR
    np.testing.assert_allclose(
        mirrored, sr.tip_positions(arm, gamma, tol=1e-10), rtol=0, atol=1e-11
    )


def test_the_right_and_left_muscles_of_the_trunk_are_mirror_images():
    arm = designs.elephant_trunk()
    swapped = [k ^ 1 for k in range(arm.bundles)]
    assert all(
        arm.bundle_names[k].replace("right", "left") == arm.bundle_names[k + 1]
        for k in range(0, arm.bundles, 2)
    )
    gamma = in_box(arm, 5)
    mirrored = sr.tip_positions(arm, gamma[:, swapped], tol=1e-10) @ MIRROR
    np.testing.assert_allclose(mirrored, sr.tip_positions(arm, gamma, tol=1e-10), rtol=0, atol=1e-9)


def test_the_muscles_of_the_trunk_do_what_elephants_do_with_them():
    """Dorsal muscles lift the tip, obliques of one hand twist, radial ones stretch."""
    arm = designs.elephant_trunk()

    def contracted(*groups: str) -> list[float]:
        return [-0.3 * any(group in name for group in groups) for name in arm.bundle_names]

    lifted = tip(arm, *contracted("dorsal longitudinal"))
    assert lifted[1] < -0.5
    assert abs(lifted[0]) < 1e-12
    assert tip(arm, *contracted("radial"))[2] > arm.length
    left_handed = ("outer oblique right", "inner oblique left")
    right_handed = ("outer oblique left", "inner oblique right")
    twists = [
        sr.configuration(arm, contracted(*hand)).curvature.values[..., 2]
        for hand in (left_handed, right_handed)
    ]
    assert (twists[0] > 0).all()
    np.testing.assert_allclose(twists[1], -twists[0])


def test_a_tendon_bends_the_robot_to_a_circle():
    """κ = τ ρt/EI per length at rest, a quarter turn over 0.2 m at 8 N, shortened by τ/EA."""
    arm = designs.three_tendon_robot()
    stiffness = 54e9 * math.pi / 4 * 0.0007**4
    curvature = 8 * 0.01 / stiffness
    radius = (1 - 8 / (54e9 * math.pi * 0.0007**2)) / curvature
    angle = curvature * 0.2
    assert angle == pytest.approx(math.pi / 2, rel=1e-3)
    circle = [0, radius * (1 - math.cos(angle)), radius * math.sin(angle)]
    np.testing.assert_allclose(tip(arm, 8, 0, 0), circle, rtol=0, atol=1e-12)


def test_a_robot_of_another_number_of_segments_is_refused():
    with pytest.raises(sr.InvalidInput, match="segments"):
        designs.three_tendon_robot(segments=3)


def test_a_helical_tendon_bends_by_the_offset_and_the_slope_of_its_route():
    """κ ζ = τ ρt t3/EI with the slope ρt Ω/L = 0.1893 that the numbers of the source give."""
    arm = designs.helical_tendon_robot()
    slope = 0.01506 * 2 * math.pi / 0.5
    assert slope == pytest.approx(0.1893, abs=1e-4)
    expected = 15 * 0.01506 / math.hypot(1, slope) / (200e9 * math.pi / 4 * 0.001**4)
    shape = sr.configuration(arm, [15, 0, 0, 0])
    bending = np.linalg.norm(shape.curvature.values[:, :2], axis=1) * shape.extension.values
    np.testing.assert_allclose(bending, expected, rtol=1e-12)


def test_a_chamber_bends_the_pneumatic_arm_to_a_circle_away_from_it():
    arm = designs.three_chamber_arm()
    area, modulus = math.pi * 0.004**2, 82.7e3
    pressure = 50e3
    curvature = pressure * area * 0.0075 / (modulus * math.pi / 4 * 0.0125**4)
    radius = (1 + pressure * area / (modulus * math.pi * 0.0125**2)) / curvature
    angle = curvature * 0.15
    circle = [0, -radius * (1 - math.cos(angle)), radius * math.sin(angle)]
    np.testing.assert_allclose(tip(arm, pressure, 0, 0), circle, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_the_file_of_a_named_design_is_written_by_the_tool(name):
    written = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    assert written == design_file(name)
    assert sr.Manipulator.from_toml(written) == named(name)


def test_every_file_is_that_of_a_named_design():
    assert sorted(path.stem for path in FOLDER.glob("*.toml")) == sorted(NAMES)


# Named materials: every number has a source, and the numbers are those of elastic solids


DOCS = Path(__file__).parents[2] / "docs"
MATERIALS = material_names()
PSI = 6894.757


@pytest.mark.parametrize("name", MATERIALS)
def test_every_number_has_a_source_among_the_references(name):
    record = material_record(name)
    numbers = {
        field
        for field in ("young_modulus", "poisson_ratio", "density")
        if getattr(record.material, field) is not None
    }
    keys = re.findall(r"^### (\w+)$", (DOCS / "references.md").read_text("utf-8"), re.MULTILINE)
    assert set(record.sources) == numbers >= {"young_modulus", "poisson_ratio"}
    assert record.material.name == name
    cited = {*record.sources.values(), *re.findall(r"\[(\w+)\]", record.note)}
    assert cited <= set(keys)


def test_materials_come_from_soft_to_stiff():
    moduli = [named_material(name).young_modulus for name in MATERIALS]
    assert moduli == sorted(moduli)


@pytest.mark.parametrize(
    ("name", "psi"), [("ecoflex_00_30", 10), ("dragon_skin_30", 86), ("smooth_sil_950", 272)]
)
def test_a_modulus_of_a_data_sheet_is_converted_from_psi(name, psi):
    assert named_material(name).young_modulus == pytest.approx(psi * PSI, rel=1e-3)
    assert material_record(name).note.startswith(f"{psi} psi")


@pytest.mark.parametrize(
    ("name", "shear_modulus"),
    [("spring_steel", 81.5e9), ("stainless_steel_302", 73e9), ("natural_rubber", 0.5e6)],
)
def test_poisson_ratio_gives_the_shear_modulus_of_the_source(name, shear_modulus):
    material = named_material(name)
    shear = material.young_modulus / (2 * (1 + material.poisson_ratio))
    assert shear == pytest.approx(shear_modulus, rel=1e-3)


def test_what_cannot_be_pulled_to_twice_its_length_has_no_modulus_at_100_percent():
    stiff = [name for name in MATERIALS if (named_material(name).young_modulus or 0) > 1e8]
    assert len(stiff) >= 4
    assert all("100 %" not in material_record(name).modulus for name in stiff)


@pytest.mark.parametrize("spelling", ["Ecoflex 00-30", "ecoflex-00-30", "ecoflex_0030"])
def test_an_unknown_name_is_refused_with_names_that_come_close(spelling):
    with pytest.raises(InvalidInput, match="did you mean ecoflex_00_30") as error:
        named_material(spelling)
    assert error.value.value == spelling
    assert "\n" not in str(error.value)


def test_a_name_like_no_other_is_refused_with_where_the_names_are():
    with pytest.raises(InvalidInput, match=r"softreach\.arm\.material_names\(\)") as error:
        named_material("xyz")
    assert "did you mean" not in str(error.value)
    assert len(str(error.value)) < 160


def test_a_name_stands_for_its_material_wherever_one_is_wanted():
    silicone = named_material("dragon_skin_30")
    ring = sr.Ring(inner_ratio=0.5, material="dragon_skin_30")
    assert ring == sr.Ring(inner_ratio=0.5, material=silicone)
    assert ring.replace(material="pla").material == named_material("pla")
    assert sr.Section(rings=(ring,), core="dragon_skin_30").core == silicone
    assert sr.designs.minimal_trunk(material="pla") == sr.designs.minimal_trunk(
        material=named_material("pla")
    )
    with pytest.raises(sr.InvalidDesign, match="did you mean dragon_skin_30"):
        sr.Ring(inner_ratio=0.5, material="dragon_skin_3")


def test_the_library_cannot_be_changed():
    with pytest.raises(TypeError):
        material_record("pla").sources["density"] = "hearsay"  # type: ignore[index]


def test_the_table_of_materials_is_written_from_the_library():
    page = (DOCS / "design-files.md").read_text("utf-8")
    assert page_with_table(page) == page
