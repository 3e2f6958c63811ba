"""Outputs appear whole or not at all, and replace nothing unasked; both before any work."""

import os
import resource
import subprocess
import sys
from contextlib import contextmanager, suppress

import numpy as np
import pytest

import softreach as sr
from softreach.exchange.activefilaments import write_cloud
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
    """What is written: a design, a small cloud of it, a bent arm, a figure and so on."""
    figure = plt.figure(figsize=(1, 1))
    yield {
        "arm": trunk,
        "cloud": sr.compute_cloud(trunk, n=50),
        "shape": sr.configuration(trunk, [-1.0, 0.0, -0.4], stations=5),
        "needs": sr.Requirements(targets=[sr.requirements.Target(np.ones((9, 3)))]),
        "plan": sr.calibration.plan_poses(trunk, ["taper"], 4, candidates=16),
        "figure": figure,
    }
    plt.close(figure)


TABLES = ("ply", "csv", "parquet", "npz", "vtu")
CLOUD, MESH = (lambda things: (export_cloud, things["cloud"])), lambda _: (export_mesh, TETRAHEDRON)
WRITERS = {
    "cloud.zarr": lambda things: (sr.save_cloud, things["cloud"]),
    **{f"cloud.{suffix}": CLOUD for suffix in TABLES},
    **{f"mesh.{suffix}": MESH for suffix in ("ply", "stl", "obj", "glb", "vtu")},
    "arm.stl": lambda things: (export_arm, things["arm"], things["shape"]),
    **{
        f"figure.{suffix}": lambda things: (save_figure, things["figure"])
        for suffix in ("png", "pdf", "svg", "jpg")
    },
    "figure.html": lambda things: (save_figure, plot_3d(things["shape"])),
    "design.toml": lambda things: (sr.Manipulator.save, things["arm"]),
    "needs.toml": lambda things: (things["needs"].save,),
    "poses.csv": lambda things: (things["plan"].save,),
    "pair.csv": lambda things: (write_cloud, things["cloud"]),
}


def write(name, things, path, **options):
    function, *given = WRITERS[name](things)
    function(*given, path, **options)


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
def test_a_full_disk_is_an_error_of_one_line_and_what_was_there_stays(name, things, tmp_path):
    write(name, things, tmp_path / "old" / name)
    (tmp_path / "new").mkdir()
    before = files_in(tmp_path)
    for place in (tmp_path / "old" / name, tmp_path / "new" / name):
        with no_file_larger_than(100):
            error = raised_by(lambda at=place: write(name, things, at, overwrite=True))
        assert " cannot be written: File too large" in str(error)
        assert "\n" not in str(error)
        assert isinstance(error, OSError)
    assert files_in(tmp_path) == before


@every_writer
def test_what_exists_stays_unless_one_says_so(name, things, tmp_path):
    (tmp_path / name).write_text("my notes")
    error = raised_by(lambda: write(name, things, tmp_path / name))
    assert "something is there; choose another name, or pass --overwrite" in str(error)
    assert files_in(tmp_path) == {name: b"my notes"}
    for _ in range(2):  # over the notes, and over an older one
        write(name, things, tmp_path / name, overwrite=True)
        assert (tmp_path / name).is_dir() or b"my notes" not in (tmp_path / name).read_bytes()


@every_writer
def test_a_folder_with_other_things_is_never_replaced(name, things, tmp_path):
    (tmp_path / name).mkdir()
    (tmp_path / name / "thesis.tex").write_text("x")
    before = files_in(tmp_path)
    raised_by(lambda: write(name, things, tmp_path / name, overwrite=True))
    assert files_in(tmp_path) == before


@pytest.mark.parametrize("thing", ["tip/c/notes.txt", "mine/c/0/0", "zarr.json"])
def test_a_store_with_a_thing_or_a_root_of_ones_own_is_never_replaced(thing, things, tmp_path):
    sr.save_cloud(things["cloud"], tmp_path / "a.zarr")
    (tmp_path / "a.zarr" / thing).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "a.zarr" / thing).write_text('{"attributes": {"sam')
    before = files_in(tmp_path)
    error = raised_by(lambda: sr.save_cloud(things["cloud"], tmp_path / "a.zarr", overwrite=True))
    assert thing == "zarr.json" or "in it: move it away, or choose another name" in str(error)
    assert files_in(tmp_path) == before


PLACES = {
    "x" * 300 + ".ply": "File name too long",
    "\0.ply": "must be a path",
    "circle/a.ply": "cannot be written",
    "file/a.ply": "Not a directory",
    "/dev/full/a.ply": "Not a directory",
    "/proc/a.ply": "cannot be written",
    "pipe.ply": "a folder, a device or a pipe is there",
    "device.ply": "a folder, a device or a pipe is there",
}


def test_a_place_where_nothing_can_be_written_is_said(things, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "device.ply").symlink_to("/dev/full")
    (tmp_path / "file").touch()
    os.mkfifo("pipe.ply")
    before = sorted(os.listdir())
    for place, expected in PLACES.items():
        error = raised_by(lambda at=place: write("cloud.ply", things, at, overwrite=True))
        assert expected in str(error)
        assert sorted(os.listdir()) == before


def test_a_link_to_a_file_stays_a_link(things, tmp_path):
    (tmp_path / "link.stl").symlink_to("real.stl")
    write("mesh.stl", things, tmp_path / "link.stl")
    assert (tmp_path / "link.stl").is_symlink()
    assert (tmp_path / "real.stl").stat().st_size == 84 + 4 * 50


def test_a_library_that_swallows_an_error_does_not_get_away_with_it(tmp_path):
    def careless(file):
        for _ in range(100):
            with suppress(OSError):
                file.write(b"\x89PNG" * 100_000)

    place = tmp_path / "a.png"
    with no_file_larger_than(1000), pytest.raises(NotWritten), writing(place) as file:
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
    ends = ("", ".softreach-new", ".softreach-old")
    place, new, old = (tmp_path / f"a.zarr{end}" for end in ends)
    for path in (new, old):
        path.mkdir()
        (path / "whole").write_text(path.name)
    with pytest.warns(SoftreachWarning, match=r"a.zarr.softreach-new, which is read"):
        assert place_to_read(place) == str(new)
    assert not place.exists()
    with (
        pytest.warns(SoftreachWarning, match=r"a.zarr.softreach-new, which was renamed to it"),
        replacing_folder(place, lambda _: "", overwrite=True),
    ):
        assert (place / "whole").read_text() == new.name
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


TRUNK = "minimal_trunk"
THERE = "something is there; choose another name, or pass --overwrite"

UNWRITABLE = {
    f"cloud {TRUNK} --out notes.csv": "must be a file name ending in .zarr",
    f"cloud {TRUNK} --out folder.zarr --overwrite": "never replaced",
    f"volume {TRUNK} --out a.txt": "must be a file name ending in .ply, .stl, .obj, .glb",
    f"volume {TRUNK} --out notes.ply": THERE,
    "payload lce_arm --gravity up --out notes.png": THERE,
    f"export {TRUNK} notes.jl": THERE,
    "export cloud.zarr path.csv --format activefilaments": THERE,
    "demo --out mine": THERE,
    "paper --out pictures": "a folder without other figures",
}


@pytest.fixture
def crowded(folder):
    notes = "notes.ply notes.png notes.jl path.csv folder.zarr/a mine/report.html mine/cloud.png"
    for name in (*notes.split(), "pictures/figures/a.png"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("my notes")
    return folder


@pytest.mark.parametrize("words", UNWRITABLE)
def test_what_cannot_be_written_is_refused_before_the_work(words, crowded, capsys, monkeypatch):
    def computed(*_, **__):
        raise AssertionError("it was computed first")

    heavy = "cloud.compute_cloud", "workspace.reachable_set", "workspace.payload.payload_curve"
    for place in heavy:
        monkeypatch.setattr(f"softreach.{place}", computed)
    assert UNWRITABLE[words] in refusal_of(words.split(), capsys, crowded)


def test_missing_extras_are_named_all_at_once_before_the_work(folder, monkeypatch, capsys):
    for library in ("trimesh", "matplotlib", "skimage"):
        monkeypatch.setitem(sys.modules, library, None)
    said = refusal_of(["reach", TRUNK, "--out", "a.stl", "--out", "a.png"], capsys, folder)
    assert "trimesh and matplotlib and scikit-image; install them with: " in said
    assert "pip install 'softreach[export,plot,surface]', or in a clone with: make setup" in said
