"""Parts of one's own on the command line: imported when asked for, then like softreach's."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import softreach as sr
from softreach.arm import designs
from softreach.cli.app import run
from softreach.support import plugins

WIRE = """
from dataclasses import dataclass

from softreach.arm import Resultants
from softreach.arm.number import number
from softreach.atlas import Metric, Need
from tests.cable import Cable


@dataclass(frozen=True, kw_only=True)
class {name}(Cable):
    '''A cable that pulls so many times as strongly.'''

    gain: float = 1.0
    lean: float = number("β", "rad", "angle of something", default=0.1)

    def resultants(self, profile, section, z):
        return Resultants(*(self.gain * unit for unit in super().resultants(profile, section, z)))


def lowest(tips):
    return tips[:, 2].min()


{metric} = Metric(
    name="{metric}", unit="m", meaning="lowest tip", needs=(Need.TIPS,), compute=lowest
)
"""


@pytest.fixture(scope="module")
def wire(tmp_path_factory):
    """A module with an actuator and a metric, and a design with that actuator."""
    folder = tmp_path_factory.mktemp("own")
    module, design = folder / "own_wire.py", folder / "wire.toml"
    module.write_text(WIRE.format(name="OwnWire", metric="lowest_tip"), encoding="utf-8")
    design.write_text(designed("OwnWire"), encoding="utf-8")
    yield str(module), str(design)
    sys.modules.pop("own_wire", None)


def designed(kind: str) -> str:
    """A design file of two fibers and an actuator of this kind."""
    trunk = designs.minimal_trunk()
    text = trunk.replace(actuators=trunk.actuators[:2]).to_toml()
    wire = f'kind = "{kind}"\nname = "wire"\nplace = [0.03, 0.04]\nactivation_bounds = [0, 1e-4]'
    return f"{text}\n[[actuators]]\n{wire}\n"


def printed_json(capsys, *words):
    assert run([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


class TestImport:
    def test_every_field_is_a_parameter_that_can_be_set(self, wire, capsys, tmp_path):
        module, design = wire
        own = {"wire.gain=2", "wire.lean_deg=30", "wire.place[1]=0.02", "wire.upper_n=2e-4"}
        words = [word for one in own for word in ("--set", one)]
        records = printed_json(capsys, "list", "parameters", design, *words, "--import", module)
        values = {one["parameter"]: one["value"] for one in records}
        for one in own:
            name, _, value = one.partition("=")
            assert values[name] == pytest.approx(float(value), rel=1e-12)

    def test_a_changed_design_keeps_it_in_its_file(self, wire, capsys, tmp_path):
        module, design = wire
        out = str(tmp_path / "other.toml")
        words = ["--set", "wire.gain=2.5", "--out", out, "--import", module]
        assert run(["design", design, *words]) == 0
        assert sr.Manipulator.load(out).actuators[2].gain == 2.5

    def test_what_it_pulls_counts(self, wire, capsys):
        """Twice the gain is twice the tension."""
        module, design = wire
        command = ["design", design, "--import", module]
        strong = printed_json(capsys, *command, "--set", "wire.gain=2")
        tense = printed_json(capsys, *command, "--set", "wire.upper_n=2e-4")
        for key in ("extension", "curvature_times_L"):
            assert strong[key] == pytest.approx(tense[key], rel=1e-12)

    def test_an_atlas_varies_its_fields(self, wire, capsys, tmp_path):
        module, design = wire
        store = str(tmp_path / "a.zarr")
        vary = ["--vary", "wire.gain=1,2", "--vary", "wire.place[0]=0,0.03"]
        command = [*vary, "--design", design, "--metrics", "extent,lowest_tip", "-n", "200"]
        assert run(["atlas", "build", store, *command, "--import", module]) == 0
        atlas = sr.open_atlas(store).load()
        assert atlas.lowest_tip.dims == ("wire.gain", "wire.place[0]")
        assert (atlas.lowest_tip == atlas.z_min).all()
        assert run(["atlas", "best", store, "lowest_tip", "--import", module]) == 0

    def test_it_is_listed(self, wire, capsys):
        module, _ = wire
        metrics = printed_json(capsys, "list", "metrics", "--import", module)
        assert metrics[-1] == {
            "metric": "lowest_tip",
            "group": "lowest_tip",
            "unit": "m",
            "meaning": "lowest tip",
        }
        kinds = printed_json(capsys, "list", "actuators", "--import", module)
        assert {"fiber", "tendon", "OwnWire"} <= {one["kind"] for one in kinds}

    def test_it_is_imported_once_and_known_for_one_command(self, wire, capsys):
        module, _ = wire
        assert run(["list", "metrics", "--import", module, "--import", module]) == 0
        assert capsys.readouterr().out.count("lowest_tip  m") == 1
        assert run(["list", "metrics"]) == 0
        assert "lowest_tip" not in capsys.readouterr().out

    def test_a_module_that_python_finds_is_called_by_its_name(self, tmp_path, monkeypatch, capsys):
        (tmp_path / "own_found.py").write_text(WIRE.format(name="FoundWire", metric="found_tip"))
        monkeypatch.syspath_prepend(tmp_path)
        assert run(["list", "metrics", "--import", "own_found"]) == 0
        assert "found_tip" in capsys.readouterr().out
        del sys.modules["own_found"]


FAULTY = {
    "x = (": r"SyntaxError: '(' was never closed (own_faulty.py, line 1)",
    "\nimport own_nowhere": "ModuleNotFoundError: No module named 'own_nowhere' (own_faulty.py, l",
    "raise SystemExit": "must be a module that can be imported; SystemExit (own_faulty.py, line 1)",
    "import softreach as sr\nsr.Base(points='x', position=(0, 0, 'a'), turn='b')": "(own_faulty.py",
}


@pytest.mark.parametrize(("text", "said"), FAULTY.items(), ids=range(len(FAULTY)))
def test_a_module_that_fails_is_refused_with_its_line(text, said, tmp_path, capsys):
    module = tmp_path / "own_faulty.py"
    module.write_text(text)
    assert run(["list", "designs", "--import", str(module)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: import = {module}: must be a module that can be imported; ")
    assert said in error
    assert error.count("\n") == 1
    assert "own_faulty" not in sys.modules


def test_a_file_with_the_name_of_another_module_is_refused(tmp_path, capsys):
    for name in ("random", "colorsys", "own-wire"):
        (tmp_path / f"{name}.py").write_text("raise AssertionError")
        assert run(["list", "designs", "--import", str(tmp_path / f"{name}.py")]) == 2
        assert "must be a file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ("tendon", "OwnFirst", "class tendon of the module own_1 = tendon: must be another name, "),
        ("Chamber", "OwnFirst", "as softreach has a kind Chamber"),
        ("OwnFirst", "OwnFirst", "must be another name, as the module own_1 has a kind OwnFirst"),
    ],
)
def test_a_kind_that_is_taken_is_refused(first, second, said, tmp_path):
    words = []
    for k, name in enumerate((first, second), 1):
        (tmp_path / f"own_{k}.py").write_text(WIRE.format(name=name, metric=f"metric_{k}"))
        words += ["--import", str(tmp_path / f"own_{k}.py")]
    command = [sys.executable, "-m", "softreach", "list", "actuators", *words]  # classes stay
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 2
    assert said in ended.stderr
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("name", ["extent", "volume"])
def test_a_metric_of_a_name_that_is_taken_is_refused(name, tmp_path, capsys):
    module = tmp_path / f"own_{name}.py"
    module.write_text(WIRE.format(name=f"Wire_{name}", metric=name))
    assert run(["list", "metrics", "--import", str(module)]) == 2
    assert f"name of a metric = {name}: must be a name that no other" in capsys.readouterr().err
    del sys.modules[module.stem]


class TestNothingElseRunsCode:
    def test_an_unknown_kind_imports_nothing_and_says_what_does(
        self, tmp_path, monkeypatch, capsys
    ):
        (tmp_path / "OwnUnheard.py").write_text("raise AssertionError")
        (tmp_path / "arm.toml").write_text(designed("OwnUnheard"))
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.chdir(tmp_path)
        assert run(["design", "arm.toml"]) == 2
        said = capsys.readouterr().err
        assert "actuators[2].kind = 'OwnUnheard': must be one of fiber" in said
        assert said.rstrip().endswith("on the command line by --import")
        assert "OwnUnheard" not in sys.modules

    def test_an_unknown_metric_says_what_imports_one(self, tmp_path, capsys):
        store = str(tmp_path / "a.zarr")
        vary = ["--vary", "taper_deg=0,1"]
        assert run(["atlas", "build", store, *vary, "--metrics", "own_unheard"]) == 2
        said = capsys.readouterr().err
        assert "metrics = 'own_unheard': must be some of extent" in said
        assert "--import" in said


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A maker of installed packages that declare entry points, as a folder has them."""

    def installed(name, text, entries):
        (tmp_path / f"{name}.py").write_text(text)
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = [f"[{group}]\n{key} = {value}\n" for group, key, value in entries]
        (info / "entry_points.txt").write_text("".join(lines))
        monkeypatch.syspath_prepend(tmp_path)
        made.append(name)

    made: list[str] = []
    yield installed
    for name in made:
        sys.modules.pop(name, None)


class TestEntryPoints:
    def test_they_are_loaded_when_they_are_met_and_not_before(self, package, tmp_path, capsys):
        text = WIRE.format(name="DeclaredWire", metric="declared_tip")
        package(
            "own_declared",
            text,
            [
                (plugins.ACTUATORS, "DeclaredWire", "own_declared:DeclaredWire"),
                (plugins.METRICS, "declared_tip", "own_declared:declared_tip"),
            ],
        )
        (tmp_path / "arm.toml").write_text(designed("DeclaredWire"))
        for words in (["--help"], ["list", "designs"], ["design", "minimal_trunk"]):
            assert run(words) == 0
            assert "own_declared" not in sys.modules
        assert run(["design", str(tmp_path / "arm.toml")]) == 0
        assert "own_declared" in sys.modules
        capsys.readouterr()
        assert printed_json(capsys, "list", "metrics")[-1]["metric"] == "declared_tip"
        space = sr.DesignSpace.grid(designs.minimal_trunk(), taper=[0.0])
        atlas = sr.build_atlas(space, tmp_path / "a.zarr", 50, metrics=["declared_tip"])
        assert atlas.declared_tip.attrs["units"] == "m"

    def test_what_a_package_does_not_have_is_refused_in_one_line(self, package, tmp_path, capsys):
        package(
            "own_broken",
            "import own_nowhere",
            [
                (plugins.ACTUATORS, "BrokenWire", "own_broken:BrokenWire"),
                (plugins.METRICS, "broken_tip", "own_broken:broken_tip"),
            ],
        )
        (tmp_path / "arm.toml").write_text(designed("BrokenWire"))
        assert run(["design", str(tmp_path / "arm.toml")]) == 2
        said = capsys.readouterr().err
        assert said.startswith("error: entry point BrokenWire of own_broken = own_broken:BrokenWir")
        assert said.count("\n") == 1

    @pytest.mark.filterwarnings("always::softreach.support.errors.SoftreachWarning")
    def test_a_broken_package_does_not_keep_the_others_from_a_list(self, package, capsys):
        entry = (plugins.METRICS, "lost_tip", "own_lost:lost_tip")
        package("own_lost", "import own_nowhere", [entry])
        assert run(["list", "metrics"]) == 0
        printed = capsys.readouterr()
        assert "warning: entry point lost_tip of own_lost" in printed.err
        assert "exact_volume" in printed.out
