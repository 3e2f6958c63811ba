"""Numbers and options that no command can use: each is refused in one line, before any work."""

from __future__ import annotations

import inspect
import typing

import pytest

import softreach as sr
from softreach.cli.app import app
from softreach.cli.changes import Changes
from softreach.cli.options import Sampling
from softreach.cli.values import NUMBER, WHOLE
from softreach.support.quantity import read_number, read_whole_number
from tests.abuse.refusals import refusal_of

WHOLE_NUMBER = "must be a whole number such as 20000 or 2e4"
FINITE = "must be a finite number such as 0.5 or 1e-3"
TRUNK = "minimal_trunk"
POSITION = "three comma-separated numbers x,y,z in m"
RADIUS = "must be a radius > 0"
HUGE = "9" * 5_000
LONG = "n" * 5_000


def case(words: str, expected: str, name: str | None = None):
    """A command line, its words apart by spaces, and what is said of it."""
    return pytest.param(words.split(" "), expected, id=name or words)


WRONG = [
    # numbers of samples, seeds and the like
    *(
        case(f"cloud {TRUNK} {option}={value}", f"{option[2:]} = {shown}: {WHOLE_NUMBER}")
        for option in ("--n", "--seed")
        for value, shown in {
            "1.5": "1.5",
            "0x10": "0x10",
            "１２": "１２",
            "": "''",
            "nan": "nan",
            "inf": "inf",
            "1e400": "1e400",
            "1e-3": "1e-3",
            "10**23": "10**23",
            "1,000": "1,000",
            "1__0": "1__0",
            "_1": "_1",
            "1 2 ": "1",
            "True": "True",
        }.items()
        if " " not in value
    ),
    case(f"cloud {TRUNK} --n={HUGE}", "...", "n of 5000 digits"),
    case(f"cloud {TRUNK} --n=0", "n = 0: must be a whole number, 1 or more"),
    case(f"cloud {TRUNK} --n=-5", "n = -5: must be a whole number, 1 or more"),
    case(f"cloud {TRUNK} --seed=-1", "seed = -1: must be a whole number, from 0"),
    # what cannot fit is told by its size, before a byte of it is asked for
    case(f"cloud {TRUNK} --n=1e18", "takes 49 EB of"),
    case(f"cloud {TRUNK} --n={10**23}", "EB of"),
    case(f"cloud {TRUNK} --n=4e12", "takes 196 TB of"),
    case(f"volume {TRUNK} --n=1e15", "it takes 700 PB of memory"),
    case(f"show {TRUNK} --n=1e18", "it takes 48 EB of memory"),
    case("demo --n=1e18", "it takes 700 EB of memory"),
    case("atlas build a.zarr --vary taper_deg=0:3:4 --n 1e15", "of memory"),
    *(
        case(f"atlas build a.zarr --vary taper_deg=0:3:{a} --vary revolution_deg=0:9:{b}", said)
        for a, b, said in (
            ("300", "300 --n 1e9", "it takes 700 GB of memory"),
            ("100000", "100000", "designs = 10,000,000,000: must be 1,000,000 at most"),
            ("1001", "1000", "designs = 1,001,000: must be 1,000,000 at most"),
        )
    ),
    # other whole numbers
    case("solve redundant_trunk --target 0,0,1 --family 1.5", f"family = 1.5: {WHOLE_NUMBER}"),
    case("solve redundant_trunk --target 0,0,1 --family 0", "family = 0: must be a whole number"),
    case("solve redundant_trunk --target 0,0,1 --family 1e9", "must be a whole number, from 1 to"),
    case("atlas figures a.zarr --panels 0", "panels = 0: must be a whole number, 1 or more"),
    case("atlas build a.zarr --vary taper_deg=0,1 --shard １/2", "shard = １/2: must be i/k"),
    case("atlas build a.zarr --vary taper_deg=0,1 --shard 2/2", "shard = 2/2: must be i/k"),
    case("atlas build a.zarr --vary taper_deg=0,1 --shard /", "shard = /: must be i/k"),
    case("atlas build a.zarr --vary taper_deg=0:3:1e9", "a count up to 100000"),
    case("atlas build a.zarr --vary taper_deg=0:3:1.5", "a count up to 100000"),
    case("atlas build a.zarr --vary taper_deg=0:3:0", "a count up to 100000"),
    case("atlas build a.zarr --vary taper_deg=0:inf:3", "must be numbers"),
    case("atlas build a.zarr --vary taper_deg=nan,1", "must be numbers"),
    case("atlas build a.zarr --vary taper_deg=", "taper_deg = : must be numbers"),
    case("atlas build a.zarr --vary taper_deg=0,1 --alpha 0.05", "like 0.05L"),
    case("atlas build a.zarr --vary taper_deg=0,1 --alpha 1e400L", "like 0.05L"),
    case(
        f"studio {TRUNK} --port 80000",
        "port = 80000: must be 1 to 65535; leave it out for a free one",
    ),
    case(f"studio {TRUNK} --port -1", "port = -1: must be 1 to 65535; leave it out for a free one"),
    case(f"studio {TRUNK} --port 80.5", f"port = 80.5: {WHOLE_NUMBER}"),
    case(f"studio {TRUNK} --no-open --host=", "host = '': must be an address to listen on"),
    case(f"studio {TRUNK} --no-open --host=\t", "host = '\\t': must be an address to listen on"),
    case(f"studio {TRUNK} --vary taper_deg=0:3:4", "left out without --static and its folder"),
    case(f"studio {TRUNK} --unit mm", "unit = mm: must be left out without --static"),
    case(f"studio {TRUNK} --static a --vary taper_deg=0,1 --port 8080", "which serves nothing"),
    case(f"studio {TRUNK} --static a --vary taper_deg=0:3:2000", "designs = 2,000: must be a grid"),
    case(
        f"studio {TRUNK} --static a --vary taper_deg=0,1 --unit ell", "unit = 'ell': must be one of"
    ),
    case(f"studio {TRUNK} --static a", "parameters = none: must be at least one of"),
    case(f"studio {TRUNK} --static a --vary taper=0,1", "taper_deg"),
    case("studio a.zarr --static a --vary taper_deg=0,1", "a.zarr"),
    # finite numbers
    *(
        case(f"cloud {TRUNK} --tol={value}", f"tol = {value or repr('')}: {FINITE}")
        for value in ("nan", "inf", "-inf", "1e400", "", "0x1p-3", "１e-6", "1_0.5", "1e", "1e-6L")
    ),
    case(f"cloud {TRUNK} --tol=0", "tol = 0"),
    case(f"cloud {TRUNK} --tol=-1", "tol = -1"),
    case(f"reach {TRUNK} --accuracy nan", f"accuracy = nan: {FINITE}"),
    case(f"design {TRUNK} --taper-deg 1e400", f"taper_deg = 1e400: {FINITE}"),
    case(f"design {TRUNK} --revolution-deg nan", f"revolution_deg = nan: {FINITE}"),
    case(f"design {TRUNK} --set taper=２deg", "taper = ２deg: must be a finite number"),
    case("payload lce_arm --gravity up --share inf", f"share = inf: {FINITE}"),
    # places
    case(f"solve {TRUNK} --target 0,1", POSITION),
    case(f"solve {TRUNK} --target 0,0,1,5", POSITION),
    case(f"solve {TRUNK} --target 0,0,1e155", POSITION),
    case(f"solve {TRUNK} --target 0,0,1e400", POSITION),
    case(f"solve {TRUNK} --target 0,0,nan", POSITION),
    case(f"solve {TRUNK} --target=0,0,", POSITION),
    case(f"solve {TRUNK} --target=", "target = '': must be three"),
    case(f"solve {TRUNK} --target=0,0,１", POSITION),
    case(f"solve {TRUNK} --target={HUGE}", POSITION, "target of 5000 digits"),
    case(f"solve {TRUNK} --target={'1,' * 3000}1", POSITION, "target of 3001 numbers"),
    # activations and radii
    case(f"equilibria {TRUNK} --activation=1,2", "3 comma-separated numbers"),
    case(f"equilibria {TRUNK} --activation=0,0,nan", "3 comma-separated numbers"),
    case(f"equilibria {TRUNK} --activation=0,0,0x1", "3 comma-separated numbers"),
    case(f"equilibria {TRUNK} --activation={'0,' * 3000}0", "3 comma-separated", "activations"),
    *(
        case(f"{words} --activation={given}", "must be such that the arm has a shape, as from -1.6")
        for words in (f"equilibria {TRUNK}", f"show {TRUNK} -n 10", f"export {TRUNK} a.stl")
        for given in ("-7,-7,-7", "-100,-100,-100", "9,9,9", "-1e300,0,0", "1e308,1e308,1e308")
    ),
    case(f"equilibria {TRUNK} --view diagonal --out a.png", "view = diagonal: must be front, side"),
    # modules
    *(
        case(f"list designs --import={given}", f"import = {shown}: must be {allowed}")
        for allowed, names in {
            "a module that Python finds, or": ("", "own_nowhere", "own.nowhere", "..own", "own-x"),
            "the path of a .py file that exists": ("own_nowhere.py", "a/b", ".py", "/dev/own.py"),
        }.items()
        for given, shown in ((name, name or "''") for name in names)
    ),
    case(f"list designs --import={LONG}.py", "import = nnn", "import of a long path"),
    # names of any length
    *(
        case(words.format(LONG), "n" * 100 + "...", words)
        for words in (
            "{}",
            "design {}",
            "design --{}",
            "list {}",
            "list designs --import {}",
            "studio {}",
            "warmup {}",
            "volume {}.zarr",
            f"cloud {TRUNK} --n 10 --out {{}}.zarr",
            f"show {TRUNK} --color {{}} --n 10",
            f"design {TRUNK} --set {{}}=1",
            f"gradient {TRUNK} {{}}",
        )
    ),
    *(
        case(f"volume {TRUNK} --alpha={value}", RADIUS)
        for value in (
            "0",
            "0L",
            "-1L",
            "nan",
            "infL",
            "1e400",
            "",
            "L",
            "LL",
            "0.05l",
            "0x1L",
            "５L",
        )
    ),
]


STORED = "must be left out for a stored cloud"
NOT_WRITTEN = "overwrite = True: must be left out where no file is written"

IGNORED = [
    case("volume a.zarr --n 5", f"n = 5: {STORED}"),
    case("volume a.zarr --seed 0", f"seed = 0: {STORED}"),
    case("show a.zarr --sampler uniform", f"sampler = uniform: {STORED}"),
    case("show a.zarr --taper-deg 1", f"taper_deg = 1.0: {STORED}"),
    case(f"cloud {TRUNK} --n 1000 --sampler grid --seed 1", "seed = 1: must be left out for the"),
    case("design --schema --out a.toml", "out = a.toml: must be left out with --schema"),
    case(f"design {TRUNK} --schema", f"design = {TRUNK}: must be left out with --schema"),
    case("design --schema --taper-deg 1", "taper_deg = 1.0: must be left out with --schema"),
    case(f"design {TRUNK} --overwrite", NOT_WRITTEN),
    case(f"volume {TRUNK} --overwrite", NOT_WRITTEN),
    case(f"reach {TRUNK} --overwrite", NOT_WRITTEN),
    case(f"equilibria {TRUNK} --overwrite", NOT_WRITTEN),
    case("payload lce_arm --gravity up --overwrite", NOT_WRITTEN),
    case(f"equilibria {TRUNK} --view top", "view = top: must be left out without a picture"),
    case(f"solve {TRUNK} --target 0,0,1 --family 2", "family = 2: must be left out for a design"),
    case(f"solve {TRUNK} --target 0,0,1 --prove-least", "prove_least = True: must be left out for"),
    case("export a.zarr a.csv --activation=0,0,0", "activation = 0,0,0: must be left out for a cl"),
    case(
        f"export {TRUNK} a.jl --activation=0,0,0", "activation = 0,0,0: must be left out for a fi"
    ),
    case("import a.jl a.toml --design b.toml", "design = b.toml: must be left out for a filament"),
    case("import a.jl a.toml --tol 1e-6", "tol = 1e-06: must be left out for a filament"),
    case(
        "atlas build a.zarr --space a.toml --design lce_arm", "design = lce_arm: must be left out"
    ),
    case("atlas build a.zarr --space a.toml --payload 1g", "payload = 1g: must be left out with"),
    case(
        "atlas build a.zarr --vary taper_deg=0,1 --metrics exact --alpha 0.1L",
        "alpha = 0.1L: must be left out without the metrics concave",
    ),
    case(
        "atlas build a.zarr --vary taper_deg=0,1 --scheduler tcp://localhost:1 --scheduler-file a",
        "scheduler_file = a: must be left out with --scheduler",
    ),
    case(f"design {TRUNK} -q -v", "quiet = True: must be left out with --verbose"),
]


@pytest.mark.parametrize(("arguments", "expected"), IGNORED)
def test_an_option_that_would_be_ignored_is_refused_in_one_line(
    arguments, expected, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert expected in refusal_of(arguments, capsys, tmp_path)


@pytest.mark.parametrize(("arguments", "expected"), WRONG)
def test_a_number_that_cannot_be_used_is_refused_in_one_line(
    arguments, expected, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert expected in refusal_of(arguments, capsys, tmp_path)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("7", 7),
        ("+7", 7),
        ("-7", -7),
        ("007", 7),
        ("1e6", 1_000_000),
        ("4E5", 400_000),
        ("2.5e3", 2_500),
        ("1.0", 1),
        ("400_000", 400_000),
        (" 12 ", 12),
    ],
)
def test_a_whole_number_may_be_written_in_every_way_that_rounds_nothing(text, number):
    assert read_whole_number(text) == number


@pytest.mark.parametrize("text", ["1e-6", ".5", "5.", "-0", "1E3", "+2.5"])
def test_a_decimal_number_is_what_python_reads(text):
    assert read_number(text) == float(text)


def test_names_of_any_length_are_told_in_short(tmp_path, capsys):
    text = sr.designs.minimal_trunk().to_toml().replace('"left"', f'"{LONG}"')
    (tmp_path / "arm.toml").write_text(text)
    for asked in ("equilibria --activation=1,2", "design --set foo=1", "show --color foo --n 10"):
        command, *options = asked.split()
        told = refusal_of([command, str(tmp_path / "arm.toml"), *options], capsys, tmp_path)
        assert "n" * 301 not in told


def test_an_atlas_that_the_disk_cannot_hold_is_not_begun(tmp_path, monkeypatch, capsys):
    """Nor is any of its designs made, which would take minutes here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("softreach.support.memory.free_disk", lambda path: 1e9)
    many = ["--vary", "taper_deg=0:3:300", "--vary", "revolution_deg=0:108:300"]
    said = refusal_of(["atlas", "build", "a.zarr", *many, "--n", "1e5"], capsys, tmp_path)
    assert "n = 100000 samples of 90000 designs" in said
    assert "it takes 57.6 GB of disk space, of which 1 GB are free" in said


FILES = [
    pytest.param(b"\x00\xff\xfe" * 50, "must be text in UTF-8", id="binary"),
    pytest.param(b"0,0,1\n0,0", "point 2 = 0,0: must be three", id="two columns"),
    pytest.param(b"x,y,z\n0,0,1,5", "point 1 = 0,0,1,5: must be three", id="four columns"),
    pytest.param(b"x,y,z\n0,0,nan", "must be three", id="NaN"),
    pytest.param(b"x,y,z\n0,0,1e200", "must be three", id="far away"),
    pytest.param("0,0,1".encode("utf-16"), "must be text in UTF-8", id="UTF-16"),
    pytest.param(b"", "a row x,y,z for each position", id="nothing"),
    pytest.param(b"x,y,z\n", "a row x,y,z for each position", id="a header alone"),
    pytest.param(b"0,0," + b"1" * 100_000, "must be three", id="a very long line"),
]


@pytest.mark.parametrize(("content", "expected"), FILES)
def test_a_file_of_targets_that_is_no_table_of_places_is_refused(
    content, expected, tmp_path, capsys
):
    path = tmp_path / "targets.csv"
    path.write_bytes(content)
    arguments = ["solve", TRUNK, "--targets", str(path)]
    assert expected in refusal_of(arguments, capsys, tmp_path)


def _commands():
    for name in app:
        if not name.startswith("-"):
            one = app[name]
            below = [one[part] for part in one if not part.startswith("-")]
            yield from (sub.default_command for sub in [one, *below] if sub.default_command)


def _options():
    for function in (*_commands(), Changes, Sampling):
        hints = typing.get_type_hints(function, include_extras=True)
        hints.pop("return", None)
        for name, hint in hints.items():
            yield pytest.param(hint, id=f"{getattr(function, '__name__', function)} {name}")


@pytest.mark.parametrize("hint", list(_options()))
def test_every_number_on_the_command_line_has_the_one_reader(hint):
    kind, *meanings = typing.get_args(hint) or (hint,)
    plain = {kind, *typing.get_args(kind)}
    if int in plain and bool not in plain:
        assert WHOLE in meanings
    if float in plain:
        assert NUMBER in meanings
    assert not inspect.isclass(hint) or hint not in (int, float)
