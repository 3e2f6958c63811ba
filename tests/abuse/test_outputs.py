"""Outputs appear whole or not at all, and replace nothing unasked; both before any work."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from contextlib import contextmanager, suppress

import numpy as np
import pytest

import softreach as sr
from softreach.exchange.activefilaments import write_cloud, write_design
from softreach.export import export_arm, export_cloud, export_mesh
from softreach.plot import plot_3d, save_figure
from softreach.support.errors import NotWritten, SoftreachWarning
from softreach.support.files.atomic import place_to_read, replacing_folder, writing
from tests.abuse.refusals import files_in, raised_by, refusal_of

pytest.importorskip("pyarrow")
pytest.importorskip("meshio")
pytest.importorskip("trimesh")
plt = pytest.importorskip("matplotlib.pyplot")

TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


@pytest.fixture(scope="module")
def things(trunk):
    """What is written: a design, a small cloud of it, a bent arm, a figure."""
    figure = plt.figure(figsize=(1, 1))
    yield {
        "arm": trunk,
        "cloud": sr.compute_cloud(trunk, n=50),
        "shape": sr.configuration(trunk, [-1.0, 0.0, -0.4], stations=5),
        "figure": figure,
    }
    plt.close(figure)


def _cloud(things, path, **options):
    export_cloud(things["cloud"], path, **options)


def _mesh(things, path, **options):
    export_mesh(TETRAHEDRON, path, **options)


def _arm(things, path, **options):
    export_arm(things["arm"], things["shape"], path, **options)


def _figure(things, path, **options):
    save_figure(things["figure"], path, **options)


def _page(things, path, **options):
    save_figure(plot_3d(things["shape"]), path, **options)


TABLES = ("ply", "csv", "parquet", "npz", "mat", "vtu", "vtk")
WRITERS = {
    "cloud.zarr": lambda things, path, **options: sr.save_cloud(things["cloud"], path, **options),
    **{f"cloud.{suffix}": _cloud for suffix in TABLES},
    **{f"mesh.{suffix}": _mesh for suffix in ("ply", "stl", "obj", "glb", "vtu", "vtk")},
    "arm.stl": _arm,
    **{f"figure.{suffix}": _figure for suffix in ("png", "pdf", "svg", "jpg")},
    "figure.html": _page,
    "design.toml": lambda things, path, **options: things["arm"].save(path, **options),
    "design.jl": lambda things, path, **options: write_design(things["arm"], path, **options),
    "pair.csv": lambda things, path, **options: write_cloud(things["cloud"], path, **options),
}  # fmt: skip

every_writer = pytest.mark.parametrize("name", WRITERS)


@contextmanager
def no_file_larger_than(size: int):
    """What a full disk is to a writer: it gets so far, and no further."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@every_writer
def test_on_a_full_disk_an_output_is_an_error_of_one_line_and_what_was_there_stays(
    name, things, tmp_path
):
    WRITERS[name](things, tmp_path / "old" / name)
    (tmp_path / "new").mkdir()
    before = files_in(tmp_path)
    for folder in ("old", "new"):
        with no_file_larger_than(100):
            error = raised_by(
                lambda place=tmp_path / folder / name: WRITERS[name](things, place, overwrite=True)
            )
        assert " cannot be written: File too large" in str(error)
        assert "\n" not in str(error)
        assert isinstance(error, OSError)
    assert files_in(tmp_path) == before


@every_writer
def test_what_exists_stays_unless_one_says_so(name, things, tmp_path):
    (tmp_path / name).write_text("my notes")
    error = raised_by(lambda: WRITERS[name](things, tmp_path / name))
    assert "something is there; choose another name, or pass --overwrite" in str(error)
    assert files_in(tmp_path) == {name: b"my notes"}
    for _ in range(2):  # over the notes, and over an older one
        WRITERS[name](things, tmp_path / name, overwrite=True)
        assert (tmp_path / name).is_dir() or b"my notes" not in (tmp_path / name).read_bytes()


@every_writer
def test_a_folder_with_other_things_is_never_replaced(name, things, tmp_path):
    (tmp_path / name).mkdir()
    (tmp_path / name / "thesis.tex").write_text("x")
    before = files_in(tmp_path)
    raised_by(lambda: WRITERS[name](things, tmp_path / name, overwrite=True))
    assert files_in(tmp_path) == before


@pytest.mark.parametrize("thing", ["thesis.tex", "tip/notes.txt", "tip/c/notes.txt", "mine/c/0/0"])
def test_a_store_with_a_thing_of_ones_own_is_never_replaced(thing, things, tmp_path):
    sr.save_cloud(things["cloud"], tmp_path / "a.zarr")
    (tmp_path / "a.zarr" / thing).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "a.zarr" / thing).write_text("x")
    before = files_in(tmp_path)
    error = raised_by(lambda: sr.save_cloud(things["cloud"], tmp_path / "a.zarr", overwrite=True))
    assert "is not as softreach wrote it: move it away, or choose another name" in str(error)
    assert files_in(tmp_path) == before


@pytest.mark.parametrize("root", ["{}", '{"attributes": {"sam', '{"node_type": "group"}'])
def test_a_folder_with_a_root_of_another_program_is_never_replaced(root, things, tmp_path):
    (tmp_path / "a.zarr").mkdir()
    (tmp_path / "a.zarr" / "zarr.json").write_text(root)
    before = files_in(tmp_path)
    raised_by(lambda: sr.save_cloud(things["cloud"], tmp_path / "a.zarr", overwrite=True))
    assert files_in(tmp_path) == before


PLACES = [
    pytest.param("x" * 300 + ".ply", "File name too long", id="a name too long"),
    pytest.param("\0.ply", "must be a path", id="a zero byte"),
    pytest.param("circle/a.ply", "cannot be written", id="links in a circle"),
    pytest.param("file/a.ply", "Not a directory", id="below a file"),
    pytest.param("/dev/full/a.ply", "Not a directory", id="below a device"),
    pytest.param("/proc/a.ply", "cannot be written", id="a folder of the system"),
    pytest.param("pipe.ply", "a folder, a device or a pipe is there", id="a pipe"),
    pytest.param("device.ply", "a folder, a device or a pipe is there", id="a device"),
]


@pytest.mark.parametrize(("place", "expected"), PLACES)
def test_a_place_where_nothing_can_be_written_is_said(
    place, expected, things, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "device.ply").symlink_to("/dev/full")
    (tmp_path / "file").touch()
    os.mkfifo("pipe.ply")
    before = sorted(os.listdir())
    error = raised_by(lambda: _cloud(things, place, overwrite=True))
    assert expected in str(error)
    assert sorted(os.listdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_said(things, tmp_path):
    tmp_path.chmod(0o500)
    assert "Permission denied" in str(raised_by(lambda: _mesh(things, tmp_path / "a.stl")))


def test_a_link_to_a_file_stays_a_link(things, tmp_path):
    (tmp_path / "link.stl").symlink_to("real.stl")
    _mesh(things, tmp_path / "link.stl")
    assert (tmp_path / "link.stl").is_symlink()
    assert (tmp_path / "real.stl").stat().st_size == 84 + 4 * 50


def test_a_library_that_swallows_an_error_does_not_get_away_with_it(tmp_path):
    def careless(file):
        for _ in range(100):
            with suppress(OSError):
                file.write(b"\x89PNG" * 100_000)

    with (
        no_file_larger_than(1000),
        pytest.raises(NotWritten),
        writing(tmp_path / "a.png") as file,
    ):
        careless(file)
    assert not any(tmp_path.iterdir())


KILLED = """
import os, signal, sys, warnings
from pathlib import Path
from softreach.support.files import atomic

warnings.simplefilter("ignore")
place, operation = Path("it"), 0

def write(name, overwrite):
    if name == "folder":
        with atomic.replacing_folder(place, lambda _: "", overwrite=overwrite) as folder:
            fill(folder)
    else:
        with atomic.writing(place, overwrite=overwrite) as file:
            file.write(content.encode())

def fill(folder):
    for name in "ab":
        (folder / name).mkdir()
        (folder / name / "c").write_text(content)

def found(name):
    where = Path(atomic.place_to_read(place))
    if name == "file":
        return where.read_text()
    (text,) = {(where / name / "c").read_text() for name in "ab"}
    return text

def kill_before(operation):
    def hook(event, _):
        nonlocal operation
        if event in ("open", "os.mkdir", "os.remove", "os.rename", "os.rmdir"):
            operation -= 1
            if operation == 0:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.addaudithook(hook)

name, content, seen, killed = sys.argv[1], "old", {"old": 0, "new": 0}, True
write(name, False)
while killed:
    operation += 1
    content = "old"
    write(name, True)
    if not (child := os.fork()):
        content = "new"
        kill_before(operation)
        write(name, True)
        os._exit(0)
    killed = os.waitpid(child, 0)[1] == signal.SIGKILL
    seen[found(name)] += 1
print(*seen.values(), len(list(Path().glob("it*"))))
"""


@pytest.mark.parametrize("name", ["file", "folder"])
def test_a_kill_before_any_operation_leaves_the_old_or_the_new_whole(name, tmp_path):
    """Nothing else is ever found there, and the next replacement succeeds each time."""
    command = [sys.executable, "-c", KILLED, name]
    process = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert process.stderr == ""
    old, new, left = map(int, process.stdout.split())
    assert old >= (10 if name == "folder" else 2)
    assert new >= 2
    assert left == 1


def test_a_folder_whose_replacement_was_killed_is_found_and_comes_back(tmp_path):
    place, new, old = (
        tmp_path / f"a.zarr{end}" for end in ("", ".softreach-new", ".softreach-old")
    )
    for path in (new, old):
        path.mkdir()
        (path / "whole").write_text(path.name)
    with pytest.warns(SoftreachWarning, match=r"a.zarr.softreach-new is read"):
        assert place_to_read(place) == str(new)
    assert not place.exists()
    with (
        pytest.warns(SoftreachWarning, match=r"a.zarr.softreach-new was renamed to it"),
        replacing_folder(place, lambda _: "", overwrite=True),
    ):
        assert (place / "whole").read_text() == new.name
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


TRUNK = "minimal_trunk"
SURFACES = "must be a file name ending in .ply, .stl, .obj, .glb"
PICTURE = "must be a file name ending in .png, .pdf, .svg"
THERE = "something is there; choose another name, or pass --overwrite"


def case(words: str, expected: str):
    """A command line whose output cannot be written, and what is said of it."""
    return pytest.param(words.split(), expected, id=words)


UNWRITABLE = [
    case(f"cloud {TRUNK} --out notes.csv", "must be a file name ending in .zarr"),
    case(f"cloud {TRUNK} --out taken/a.zarr", "Not a directory"),
    case(f"cloud {TRUNK} --out folder.zarr --overwrite", "never replaced"),
    case(f"volume {TRUNK} --out a.txt", SURFACES),
    case(f"volume {TRUNK} --out notes.ply", THERE),
    case(f"reach {TRUNK} --out a.png --out a.txt", ".vtk, .png, .pdf, .svg"),
    case(f"reach {TRUNK} --out a.png --out notes.ply", THERE),
    case(f"show {TRUNK} --out a.txt", PICTURE),
    case(f"show {TRUNK} --out notes.png", THERE),
    case(f"equilibria {TRUNK} --out notes.png", THERE),
    case("payload lce_arm --gravity up --out notes.png", THERE),
    case(f"track {TRUNK} path.csv --out a.txt", "must be a file name ending in .csv"),
    case(f"track {TRUNK} path.csv --out path.csv", THERE),
    case(f"design {TRUNK} --out a.json", "must be a file name ending in .toml"),
    case(f"design {TRUNK} --out notes.toml", THERE),
    case(f"export {TRUNK} notes.jl", THERE),
    case(f"export {TRUNK} a.xls", SURFACES),
    case("export cloud.zarr path.csv", THERE),
    case("export cloud.zarr path.csv --format activefilaments", THERE),
    case("demo --out taken", "Not a directory"),
    case("demo --out mine", THERE),
    case("paper --out taken", "Not a directory"),
    case("paper --out mine", THERE),
    case("paper --out pictures", "a folder without other figures"),
    case("atlas figures atlas.zarr --out taken", "Not a directory"),
]


@pytest.fixture
def crowded(tmp_path, monkeypatch):
    """A folder with files that are nobody's output."""
    monkeypatch.chdir(tmp_path)
    for name in ("taken", "notes.ply", "notes.png", "notes.toml", "notes.jl"):
        (tmp_path / name).write_text("my notes")
    (tmp_path / "path.csv").write_text("x,y,z\n0.2,0.1,0.6\n0.2,0.1,0.61\n")
    for name in ("folder.zarr/a", "mine/report.html", "mine/cloud.png", "pictures/figures/a.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("mine")
    return tmp_path


@pytest.mark.parametrize(("arguments", "expected"), UNWRITABLE)
def test_an_output_that_cannot_be_written_is_refused_before_the_work(
    arguments, expected, crowded, capsys, monkeypatch
):
    def computed(*_, **__):
        raise AssertionError("it was computed first")

    heavy = "cloud.compute_cloud", "workspace.reachable_set", "workspace.payload.payload_curve"
    for place in heavy:
        monkeypatch.setattr(f"softreach.{place}", computed)
    assert expected in refusal_of(arguments, capsys, crowded)


@pytest.mark.parametrize(
    ("words", "library", "extra"),
    [
        (f"show {TRUNK}", "matplotlib", "plot"),
        (f"reach {TRUNK} --out a.png", "matplotlib", "plot"),
        (f"equilibria {TRUNK} --out a.png", "matplotlib", "plot"),
        ("payload lce_arm --gravity up --out a.png", "matplotlib", "plot"),
        ("demo", "matplotlib", "plot"),
        ("paper", "matplotlib", "plot"),
        ("atlas figures a.zarr", "matplotlib", "plot"),
        (f"reach {TRUNK} --out a.stl", "trimesh", "export"),
        (f"volume {TRUNK} --out a.glb", "trimesh", "export"),
        (f"volume {TRUNK} --out a.vtu", "meshio", "export"),
        (f"export {TRUNK} a.obj", "trimesh", "export"),
        ("export cloud.zarr a.csv", "pyarrow", "export"),
        ("export cloud.zarr a.parquet", "pyarrow", "export"),
        ("export cloud.zarr a.vtk", "meshio", "export"),
    ],
)
def test_a_missing_extra_is_named_before_the_work(
    words, library, extra, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    said = refusal_of(words.split(), capsys, tmp_path)
    assert f"this needs {library}; install it with: pip install 'softreach[{extra}]'" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            f"reach {TRUNK} --out a.stl --out a.png",
            "trimesh and matplotlib and scikit-image; install them with: "
            "pip install 'softreach[export,plot,surface]', or in a clone with: make setup",
        ),
        ("paper", "matplotlib and scikit-image and jinja2; install them with: pip install"),
    ],
)
def test_missing_extras_are_named_all_at_once(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for library in ("trimesh", "matplotlib", "skimage", "jinja2"):
        monkeypatch.setitem(sys.modules, library, None)
    assert said in refusal_of(words.split(), capsys, tmp_path)
