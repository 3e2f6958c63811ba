"""Named materials: every number has a source, and the numbers are those of elastic solids."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tools.materials import page_with_table

import softreach as sr
from softreach.arm.material import material_names, material_record, named_material
from softreach.support.errors import InvalidInput

DOCS = Path(__file__).parents[2] / "docs"
NAMES = material_names()
PSI = 6894.757


@pytest.mark.parametrize("name", NAMES)
def test_every_number_has_a_source_among_the_references(name):
    record = material_record(name)
    numbers = {
        field
        for field in ("young_modulus", "poisson_ratio", "density")
        if getattr(record.material, field) is not None
    }
    keys = re.findall(r"^### (\w+)$", (DOCS / "references.md").read_text("utf-8"), re.MULTILINE)
    assert set(record.sources) == numbers >= {"young_modulus", "poisson_ratio"}
    cited = {*record.sources.values(), *re.findall(r"\[(\w+)\]", record.note)}
    assert cited <= set(keys)


@pytest.mark.parametrize("name", NAMES)
def test_a_material_of_the_library_carries_its_name(name):
    assert named_material(name).name == name


def test_materials_come_from_soft_to_stiff():
    moduli = [named_material(name).young_modulus for name in NAMES]
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
    stiff = [name for name in NAMES if (named_material(name).young_modulus or 0) > 1e8]
    assert len(stiff) >= 4
    assert all("100 %" not in material_record(name).modulus for name in stiff)


@pytest.mark.parametrize("spelling", ["Ecoflex 00-30", "ecoflex-00-30", "ecoflex_0030"])
def test_an_unknown_name_is_refused_with_names_that_come_close(spelling):
    with pytest.raises(InvalidInput, match="did you mean ecoflex_00_30") as error:
        named_material(spelling)
    assert error.value.value == spelling
    assert "\n" not in str(error.value)


def test_a_name_like_no_other_is_refused_with_where_the_names_are():
    with pytest.raises(InvalidInput, match=r"arm\.material\.material_names\(\)") as error:
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


def test_the_page_of_materials_is_written_from_the_library():
    page = (DOCS / "materials.md").read_text("utf-8")
    assert page_with_table(page) == page
