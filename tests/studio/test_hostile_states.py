"""Files that no studio saved are refused in one line, at once."""

import json
import os
from types import SimpleNamespace

import numpy as np
import pytest

from softreach.arm import designs, edits
from softreach.arm.parameters import changed
from softreach.cli.app import run
from softreach.cloud.clouds import compute_cloud, save_cloud
from softreach.export import export_cloud, export_mesh
from softreach.studio.captions import size_text
from softreach.studio.found import Found
from softreach.studio.reach import Quality, stages
from softreach.studio.scene.colors import sample_values
from softreach.studio.scene.scene import in_slice
from softreach.studio.start import start_on_cloud, start_on_design, start_on_state
from softreach.studio.state import Slice, StudioState
from softreach.studio.tabs.export import FILES, content_of, saved
from softreach.support.errors import InvalidDesign, InvalidInput, SoftreachError

STATE = StudioState(design=designs.minimal_trunk())


SAVED = json.loads(STATE.to_json())


def state_with(**changes):
    return json.dumps(SAVED | changes)


def look_with(**changes):
    return state_with(appearance=SAVED["appearance"] | changes)


def design_with(old, new):
    text = designs.minimal_trunk().to_toml()
    assert old in text
    return text.replace(old, new)


HOSTILE = {
    "many bundles.toml": design_with('name = "left"', 'name = "left"\nbundles = 1000000'),
    "50 MB.json": " " * 50_000_000,
    "mouse.json": look_with(mouse=["tip"]),
    "section.json": look_with(section=1),
    "sweep.json": look_with(sweep=None),
    "huge level.json": look_with(level=10**4000),
    "digits.json": '{"softreach_studio": 2, "activation": ' + "9" * 5000 + "}",
    "infinite activation.json": state_with(activation=[float("inf")] * 3),
    "huge target.json": state_with(target=[10**400, 0, 0]),
    "camera.json": state_with(camera={"position": [1, 2, 3]}),
    "needs.json": state_with(needs="[[reach]]"),
    "needs of a file.json": state_with(needs='[[reach]]\nfile = "/etc/passwd"'),
    "needs of a mesh.json": state_with(needs='[[avoid]]\nmesh = "/etc/passwd"'),
    "many places.json": state_with(needs=f"[[reach]]\nplaces_m = {[[0, 0, 1]] * 301}"),
    "list.json": "[]",
    "version.json": state_with(softreach_studio=99),
    "flat target.json": state_with(target=[1, 2]),
    "unknown field.json": state_with(searched=None),
    "too tapered.json": state_with(design=design_with("taper_deg = 2.0", "taper_deg = 50.0")),
    "bytes.json": "\x00\x01",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_refused_in_a_few_words(name):
    with pytest.raises(SoftreachError) as caught:
        saved(name, HOSTILE[name].encode())
    assert len(str(caught.value)) < 6000
    assert "Traceback" not in str(caught.value)


# What a tab is opened on and saved as

SMALL = Quality(coarse_level=8, fine_level=10, coarse_accuracy=0.1, fine_accuracy=0.05)


@pytest.fixture(scope="module")
def fine(trunk):
    return [*stages(trunk, 10, SMALL, lambda: None)][-1]


def written(fine, state, kind: str, name: str) -> bytes:
    tab = SimpleNamespace(state=state, found=Found(reach=fine))
    return content_of(tab, *FILES[kind][name])


@pytest.mark.parametrize("unit", ["", "in"])
def test_files_are_those_of_the_command_line_in_the_unit_of_the_page(fine, tmp_path, unit):
    pulled = StudioState(design=fine.arm, activation=(-1.0, -0.2, -0.5)).showing(unit=unit)
    pulled.design.save(tmp_path / "design.toml")
    export_cloud(fine.cloud, tmp_path / "cloud.ply", unit=unit or "m")
    export_mesh(fine.exact.surface(), tmp_path / "surface.glb", unit=unit or "m")
    for suffix in (".stl", ".glb"):
        out = [str(tmp_path / f"arm{suffix}"), "--activation=-1,-0.2,-0.5"]
        assert run(["export", str(tmp_path / "design.toml"), *out]) == 0
    for name in ("design.toml", "cloud.ply", "surface.glb", "arm.stl", "arm.glb"):
        label = next(k for k, (file, _) in FILES["data"].items() if file == name)
        assert written(fine, pulled, "data", label) == (tmp_path / name).read_bytes()


@pytest.mark.parametrize("color", ["rgb", "bundle 1", "manipulability", "multiplicity"])
def test_a_page_shows_the_points_and_colors_of_the_studio_and_the_surroundings(
    fine, color, monkeypatch
):
    from softreach import plot

    plotted, turning = {}, plot.plot_3d

    def watched(shown, **options):
        plotted.update(shown=shown, color=options["color"])
        return turning(shown, **options)

    monkeypatch.setattr(plot, "plot_3d", watched)
    cut = Slice(axis="y", center=0.1, thickness=0.3)
    arm = edits.with_solid(fine.arm, "sphere")
    reach, state = fine.beside(arm), StudioState(design=arm)
    state = state.showing(level=14, color=color, slice=cut, cloud=True)
    written(reach, state, "picture", "web page (.html)")
    kept = in_slice(fine.cloud.tip.values / fine.arm.length, cut)
    cloud, _, ball = plotted["shown"]
    np.testing.assert_array_equal(cloud.tip, fine.cloud.tip[kept])
    wanted = sample_values(fine, 14, color)
    wanted = wanted if isinstance(wanted, str | int) else wanted[kept]
    np.testing.assert_array_equal(plotted["color"], wanted)
    assert ball.volume == pytest.approx(arm.surroundings[0].region.volume, rel=0.02)


def test_a_saved_page_holds_everything_itself(fine):
    page = written(fine, StudioState(design=fine.arm), "picture", "web page (.html)").decode()
    assert size_text(fine.size, fine.arm) in page
    assert "taper φ [deg] 2" in page
    assert "src=" not in page
    assert "://" not in page


def test_a_design_file_changes_the_design_alone(trunk):
    state = StudioState(design=trunk, target=(0.0, 0.1, 0.5))
    other = changed(trunk, {"taper": 0.01})
    assert saved("x.TOML", other.to_toml().encode())(state) == state.replace(design=other)
    assert saved("x.json", state.to_json().encode())(StudioState(design=other)) == state
    with pytest.raises(InvalidInput, match="UTF-8"):
        saved("x.toml", b"\xff\xfe")
    tight = trunk.with_bounds((-30.0, 0.0))
    with pytest.raises(InvalidDesign, match=r"x\.toml: 1 problem\n.*must keep ζ > 0"):
        saved("x.toml", tight.to_toml().encode())


def test_a_design_begins_at_rest_and_a_saved_state_as_it_is_but_no_large_file(trunk, tmp_path):
    assert start_on_design(trunk).state.activation == (0.0, 0.0, 0.0)
    state = StudioState(design=trunk, activation=(-1.0, 0.0, -0.2)).showing(level=14)
    (tmp_path / "state.json").write_text(state.to_json(), encoding="utf-8")
    assert start_on_state(tmp_path / "state.json").state == state
    with pytest.raises(InvalidInput, match="state file"):
        start_on_state(tmp_path / "nothing.json")
    os.truncate(tmp_path / "state.json", 50_000_000)
    with pytest.raises(SoftreachError, match=r"state\.json: must be at most 8 MB"):
        start_on_state(tmp_path / "state.json")


def test_a_cloud_from_a_file_leads_to_its_design(trunk, tmp_path):
    save_cloud(compute_cloud(trunk, 500), tmp_path / "cloud.zarr")
    assert start_on_cloud(tmp_path / "cloud.zarr", SMALL).state.design == trunk
    with pytest.raises(InvalidInput, match="Zarr store"):
        start_on_cloud(tmp_path / "nothing.zarr")
