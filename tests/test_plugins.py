"""Parts of one's own on the command line: imported when asked for, then like softreach's."""

import sys

import pytest

import softreach as sr
from softreach.arm import designs
from softreach.cli.app import run
from tests.abuse.refusals import refusal_of

WIRE = """
from dataclasses import dataclass

from softreach.arm import Resultants
from softreach.arm.number import number
from softreach.atlas import Metric, Need
from tests.cable import Cable


@dataclass(frozen=True, kw_only=True)
class {kind}(Cable):
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


def designed(kind: str) -> str:
    trunk = designs.minimal_trunk()
    text = trunk.replace(actuators=trunk.actuators[:2]).to_toml()
    wire = f'kind = "{kind}"\nname = "wire"\nplace = [0.03, 0.04]\nactivation_bounds = [0, 1e-4]'
    return f"{text}\n[[actuators]]\n{wire}\n"


@pytest.fixture(scope="module")
def wire(tmp_path_factory):
    """A module with an actuator and a metric, and a design with that actuator."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "own_wire.py").write_text(WIRE.format(kind="OwnWire", metric="lowest_tip"))
    (folder / "wire.toml").write_text(designed("OwnWire"))
    yield ["--import", str(folder / "own_wire.py")], str(folder / "wire.toml")
    sys.modules.pop("own_wire", None)


def test_every_field_is_a_parameter_that_can_be_set(wire, printed):
    module, design = wire
    own = {"wire.gain": 2, "wire.lean_deg": 30, "wire.place[1]": 0.02, "wire.upper_n": 2e-4}
    words = [word for name, value in own.items() for word in ("--set", f"{name}={value}")]
    records = printed("list", "parameters", design, *words, *module)
    values = {one["parameter"]: one["value"] for one in records}
    assert {name: values[name] for name in own} == pytest.approx(own, rel=1e-12)


def test_an_atlas_varies_its_fields_and_computes_its_metric(wire, tmp_path):
    module, design = wire
    store = str(tmp_path / "a.zarr")
    vary = ["--vary", "wire.gain=1,2", "--vary", "wire.place[0]=0,0.03", "-n", "200"]
    asked = [*vary, "--design", design, "--metrics", "extent,lowest_tip", *module]
    assert run(["atlas", "build", store, *asked]) == 0
    atlas = sr.open_atlas(store)
    assert atlas.lowest_tip.dims == ("wire.gain", "wire.place[0]")
    assert (atlas.lowest_tip == atlas.z_min).all()
    assert run(["atlas", "best", store, "lowest_tip", *module]) == 0


def test_it_is_listed_once_and_known_for_one_command(wire, printed):
    module, _ = wire
    metrics = [one["metric"] for one in printed("list", "metrics", *module, *module)]
    assert (metrics[-1], metrics.count("lowest_tip")) == ("lowest_tip", 1)
    kinds = {one["kind"] for one in printed("list", "actuators", *module)}
    assert {"fiber", "tendon", "OwnWire"} <= kinds
    assert metrics[:-1] == [one["metric"] for one in printed("list", "metrics")]


FAULTY = {
    "x = (": "SyntaxError: '(' was never closed (own_faulty.py, line 1)",
    "\nimport own_nowhere": "No module named 'own_nowhere' (own_faulty.py, line 2)",
    "raise SystemExit": "SystemExit (own_faulty.py, line 1)",
}


@pytest.mark.parametrize("text", FAULTY)
def test_a_module_that_fails_is_refused_with_its_line(text, tmp_path, capsys):
    (module := tmp_path / "own_faulty.py").write_text(text)
    words = ["list", "designs", "--import", str(module)]
    assert FAULTY[text] in refusal_of(words, capsys, tmp_path)
    assert "own_faulty" not in sys.modules


@pytest.mark.parametrize("name", ["", "..own", "own_nowhere.py", "colorsys.py"])
def test_what_is_no_module_or_has_the_name_of_another_is_refused(name, folder, capsys):
    (folder / "colorsys.py").write_text("raise AssertionError")
    assert "import = " in refusal_of(["list", "designs", "--import", name], capsys, folder)


def test_an_unknown_kind_or_metric_imports_nothing_and_says_what_does(folder, monkeypatch, capsys):
    (folder / "OwnUnheard.py").write_text("raise AssertionError")
    (folder / "arm.toml").write_text(designed("OwnUnheard"))
    monkeypatch.syspath_prepend(folder)
    vary = ["--vary", "taper_deg=0,1", "--metrics", "OwnUnheard"]
    for words in (["design", "arm.toml"], ["atlas", "build", "a.zarr", *vary]):
        assert run(words) == 2
        assert "by --import" in capsys.readouterr().err
    assert "OwnUnheard" not in sys.modules
