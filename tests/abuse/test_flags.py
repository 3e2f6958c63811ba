"""Numbers and options that no command can use: each is refused in one line, before any work."""

import typing

import pytest

from softreach.cli.app import app
from softreach.cli.options import Angle, Changes, Number, Sampling, Whole
from softreach.support.quantity import read_whole_number
from tests.abuse.refusals import refusal_of

TRUNK = "minimal_trunk"
VARY = "atlas build a.zarr --vary taper_deg=0,1"
POSITION = "three comma-separated numbers x,y,z in m"
SHAPE = "must be such that the arm has a shape, as between -1.6"
STORED = "has no effect on a stored cloud: give the design instead"
NOT_WRITTEN = "error: --overwrite has no effect without --out"

REFUSED = {
    # one bad value for each reader
    f"cloud {TRUNK} --n=1.5": "n = 1.5: must be a whole number such as 20000 or 2e4",
    f"cloud {TRUNK} --seed=-1": "seed = -1: must be a whole number, from 0",
    f"design {TRUNK} --set taper=２deg": "taper = ２deg: must be a finite number",
    f"volume {TRUNK} --alpha=-1L": "must be a radius > 0",
    f"solve {TRUNK} --target 0,0,nan": POSITION,
    "atlas build a.zarr --vary taper_deg=nan,1": "must be numbers",
    f"{VARY} --shard 2/2": "shard = 2/2: must be (i, k), or i/k on the command line",
    # one for each command that has numbers or words of its own
    f"volume {TRUNK} --n=1e15": "GB of memory, of which",
    "solve redundant_trunk --target 0,0,1 --family 0": "family = 0: must be a whole number",
    f"equilibria {TRUNK} --activation=-7,-7,-7": SHAPE,
    f"studio {TRUNK} --port 80000": "port = 80000: must be 1 to 65535; leave it out",
    f"track {TRUNK} path.csv --start=1": "start = 1: must be 3 comma-separated numbers",
    "payload lce_arm --gravity up --share 2": "share = 2.0: must be",
    "import no.json a.toml": "error: definition = no.json: must be a file that exists",
    "import a.csv a.zarr": "a cloud needs the design that it was computed for: --design NAME.toml",
    "export a.zarr a.csv --format julia": "format = julia: must be activefilaments, or left out",
    "export three_chamber_arm a.jl": "must be a FiberArchitecture in ActiveFilaments.jl",
    f"studio {TRUNK} --static a": "give a slider of the page with --vary",
    "desgin": 'Did you mean "design"',
    "design": "error: design needs",
    "design elephant": "elephant: must be a .toml file, or one of elephant_trunk, filament",
    "design arm.json": "softreach import arm.json arm.toml",
    f"design {TRUNK} --set left.tension=3": "commands; their bounds are left.lower and left.upper",
    f"cloud {TRUNK} --sampler sobol --n 1000": "512 or 1024",
    "atlas status nowhere.zarr": "must be an atlas written by build_atlas; it does not exist",
    f"show {TRUNK} --n 9 --color pink": "left, right, longitudinal",
    f"solve {TRUNK}": "give either --target or --targets",
    "solve lce_arm --target 0,0,5inch": "or each with its unit (m, cm, mm, um, µm, in, L)",
    "design lce_arm --unit ft": "unit = 'ft': must be one of m, cm, mm, in, L",
    f"{VARY} --alpha=5cm": "must be a radius > 0 over the length of each design",
    # changes of a design
    "design lce_arm --payload 200": "payload = 200: must be a mass >= 0 with its unit (kg, g, mg)",
    "design lce_arm --gravity 0,0,-9.81N": "three finite numbers x,y,z in m/s²",
    "design lce_arm --base=z": "must be one of up, down, x, -x, y, -y",
    "design lce_arm --tip-force 1,2": "tip_force = 1,2: must be three finite numbers x,y,z in N",
    "design lce_arm --set taper": "set = taper: must be PATH=VALUE",
    "design lce_arm --set taper=3": "(deg, °, rad), or a number under taper_deg",
    "design lce_arm --set taper_deg=3deg": "without a unit, which the name holds",
    "design lce_arm --set bore_ratio=0.1m": "= 0.1m: must be a finite number without a unit",
    "design lce_arm --set taper=1deg --set taper_deg=2": "set = taper_deg: must be given once",
    # options that would be ignored
    "volume a.zarr --n 5": f"--n {STORED}",
    f"cloud {TRUNK} --n 1000 --sampler grid --seed 1": "--seed has no effect on the sampler grid",
    f"design {TRUNK} --overwrite": NOT_WRITTEN,
    f"solve {TRUNK} --target 0,0,1 --family 2": "--family has no effect with up to three",
    "export a.zarr a.csv --activation=0,0,0": "--activation has no effect on a cloud",
    f"studio {TRUNK} --vary taper_deg=0:3:4": "--vary has no effect without --static",
    f"calibrate {TRUNK} a.csv": "error: calibrate needs --free",
    f"solve {TRUNK} --target 0,0,1 --within -1mm": "if it begins with a dash: --within=VALUE",
    f"design {TRUNK} b": "error: design takes no b",
    f"{VARY} --metrics exact --alpha 0.1L": "--alpha has no effect without the metrics",
    f"design {TRUNK} -q -v": "choose --quiet or --verbose",
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_a_command_cannot_use_is_refused_in_one_line(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert REFUSED[words] in refusal_of(words.split(), capsys, tmp_path)


def test_a_whole_number_may_be_written_in_every_way_that_rounds_nothing_and_in_no_other():
    for text in ("+7", "2.5e3", "400_000", " 12 ", str(2**63 - 1)):
        assert read_whole_number(text) == (float(text) if "." in text else int(text))
    for text in ("1.5", "0x10", "１２", "", "nan", "1e400", "1e-3", "1__0", "True"):
        with pytest.raises(ValueError, match=r"^"):
            read_whole_number(text)


FILES = {
    "must be text in UTF-8": b"\x00\xff\xfe" * 50,
    "row 1 of targets.csv = 2 cells: must be 3": b"0,0,1\n0,0",
    "row 0 of targets.csv = 4 cells: must be 3": b"x,y,z\n0,0,1,5",
    "must be three": b"x,y,z\n0,0,nan",
    "columns = x [inch]": b"x [inch],y [inch],z [inch]\n1,2,3\n",
    "at least one row": b"x,y,z\n",
}


@pytest.mark.parametrize("expected", FILES)
def test_a_file_of_targets_that_is_no_table_of_places_is_refused(expected, tmp_path, capsys):
    (path := tmp_path / "targets.csv").write_bytes(FILES[expected])
    assert expected in refusal_of(["solve", TRUNK, "--targets", str(path)], capsys, tmp_path)


def _commands():
    commands = [app[name] for name in app if not name.startswith("-")]
    commands += [one[part] for one in commands for part in one if not part.startswith("-")]
    return [one.default_command for one in commands if one.default_command]


def _readers(hint, meanings=()):
    """Each plain number in a hint, and what is said of it."""
    if hint in (int, float):
        yield hint, meanings
    annotated = typing.get_origin(hint) is typing.Annotated
    parts = typing.get_args(hint)
    for part in parts[:1] if annotated else parts:
        yield from _readers(part, parts[1:] if annotated else ())


def test_every_number_on_the_command_line_has_the_one_reader():
    readers = {int: {typing.get_args(Whole)[1]}}
    readers[float] = {typing.get_args(kind)[1] for kind in (Number, Angle)}
    for function in (*_commands(), Changes, Sampling):
        for name, hint in typing.get_type_hints(function, include_extras=True).items():
            for kind, meanings in _readers(hint):
                assert name == "return" or readers[kind].intersection(meanings), (function, name)
