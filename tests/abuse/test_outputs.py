"""Outputs: whole or not at all, in no place but their own, and looked at before any work."""

from __future__ import annotations

import os
import resource
import sys
from contextlib import contextmanager, suppress

import numpy as np
import pytest

import softreach as sr
from softreach.exchange.activefilaments import write_cloud, write_design
from softreach.export import export_arm, export_cloud, export_mesh
from softreach.plot import plot_3d, save_figure
from softreach.support.errors import NotWritten
from softreach.support.files.atomic import writing
from softreach.support.files.documents import sealed
from softreach.support.files.kinds import PICTURES
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
def test_a_disk_that_is_full_is_an_error_and_leaves_nothing(name, things, tmp_path):
    with no_file_larger_than(100):
        error = raised_by(lambda: WRITERS[name](things, tmp_path / "new" / name))
    assert "cannot be written: File too large; choose another disk" in str(error)
    assert isinstance(error, OSError)
    assert not any(tmp_path.iterdir())


@every_writer
def test_an_older_output_survives_a_disk_that_is_full(name, things, tmp_path):
    WRITERS[name](things, tmp_path / name)
    before = files_in(tmp_path)
    with no_file_larger_than(100), pytest.raises(NotWritten):
        WRITERS[name](things, tmp_path / name)
    assert files_in(tmp_path) == before


@every_writer
def test_an_output_replaces_its_own_kind(name, things, tmp_path):
    WRITERS[name](things, tmp_path / name)
    names = files_in(tmp_path).keys()
    WRITERS[name](things, tmp_path / name)
    assert files_in(tmp_path).keys() == names


@every_writer
def test_a_file_of_another_kind_stays_unless_one_says_so(name, things, tmp_path):
    (tmp_path / name).write_text("my notes\nof a year\n")
    error = raised_by(lambda: WRITERS[name](things, tmp_path / name))
    assert "something else is there; choose another name, or pass --overwrite" in str(error)
    assert files_in(tmp_path) == {name: b"my notes\nof a year\n"}
    WRITERS[name](things, tmp_path / name, overwrite=True)
    assert (tmp_path / name).is_dir() or b"my notes" not in (tmp_path / name).read_bytes()


ALIKE = {
    "design.toml": b"[robot]\nlength_m = 1.0  # of my own arm\n",
    "design.jl": b"using ActiveFilaments\nfilament = AFilament(rings)\n# two weeks of my work\n",
    "cloud.npz": b"PK\x03\x04 the thesis, zipped",
}


@pytest.mark.parametrize("name", ALIKE)
def test_a_file_that_only_looks_like_an_output_stays(name, things, tmp_path):
    (tmp_path / name).write_bytes(ALIKE[name])
    assert "something else is there" in str(
        raised_by(lambda: WRITERS[name](things, tmp_path / name))
    )
    assert files_in(tmp_path) == {name: ALIKE[name]}


def test_arrays_of_ones_own_stay(things, tmp_path):
    np.savez(tmp_path / "cloud.npz", measured=np.arange(3.0), tip=np.zeros(3))
    before = files_in(tmp_path)
    assert "something else" in str(raised_by(lambda: _cloud(things, tmp_path / "cloud.npz")))
    assert files_in(tmp_path) == before


@every_writer
def test_a_folder_with_other_things_is_never_replaced(name, things, tmp_path):
    (tmp_path / name).mkdir()
    (tmp_path / name / "thesis.tex").write_text("x")
    before = files_in(tmp_path)
    error = raised_by(lambda: WRITERS[name](things, tmp_path / name, overwrite=True))
    assert "a folder with other things is there, which is never replaced" in str(error)
    assert files_in(tmp_path) == before


@every_writer
def test_a_parent_that_is_a_file_is_named(name, things, tmp_path):
    (tmp_path / "file").write_text("x")
    error = raised_by(lambda: WRITERS[name](things, tmp_path / "file" / name))
    assert "a part of its path is a file" in str(error)
    assert files_in(tmp_path) == {"file": b"x"}


def _first(suffix: str):
    return next(name for name in WRITERS if name.endswith(suffix))


PLACES = [
    pytest.param("x" * 300 + ".ply", "choose another name", id="a name too long"),
    pytest.param("\0.ply", "must be a path", id="a zero byte"),
    pytest.param("circle/a.ply", "choose another name", id="links in a circle"),
    pytest.param("/dev/full/a.ply", "a part of its path is a file", id="below a device"),
    pytest.param("/proc/a.ply", "cannot be written", id="a folder of the system"),
    pytest.param("pipe.ply", "not a device or a pipe", id="a pipe"),
    pytest.param("device.ply", "not a device or a pipe", id="a device"),
]


@pytest.mark.parametrize(("place", "expected"), PLACES)
def test_a_place_where_nothing_can_be_written_is_said(
    place, expected, things, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "device.ply").symlink_to("/dev/full")
    os.mkfifo("pipe.ply")
    before = sorted(os.listdir())
    assert expected in str(raised_by(lambda: _cloud(things, place)))
    assert sorted(os.listdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_said(things, tmp_path):
    tmp_path.chmod(0o500)
    assert "that you may write to" in str(raised_by(lambda: _mesh(things, tmp_path / "a.stl")))


def test_a_link_to_a_file_stays_a_link(things, tmp_path):
    (tmp_path / "link.stl").symlink_to("real.stl")
    _mesh(things, tmp_path / "link.stl")
    assert (tmp_path / "link.stl").is_symlink()
    assert (tmp_path / "real.stl").stat().st_size == 84 + 4 * 50


def test_the_folder_that_one_works_in_is_not_taken_away(things, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    error = raised_by(lambda: sr.save_cloud(things["cloud"], "."))
    assert "never replaced" in str(error)
    assert tmp_path.is_dir()


@pytest.mark.parametrize("kind", ["an empty file", "an empty folder", "an older name"])
def test_what_is_empty_may_be_replaced(kind, things, tmp_path):
    path = tmp_path / "cloud.zarr"
    if kind == "an empty file":
        path.touch()
    elif kind == "an empty folder":
        path.mkdir()
    sr.save_cloud(things["cloud"], path)
    assert sr.open_cloud(path).sizes["sample"] == 50


def test_a_library_that_swallows_an_error_does_not_get_away_with_it(tmp_path):
    def careless(file):
        for _ in range(100):
            with suppress(OSError):
                file.write(b"\x89PNG" * 100_000)

    with (
        no_file_larger_than(1000),
        pytest.raises(NotWritten),
        writing(tmp_path / "a.png", PICTURES[".png"]) as file,
    ):
        careless(file)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("stranger", ["notes.txt", "tip/notes.txt"])
def test_a_cloud_with_a_file_of_ones_own_in_it_counts_as_a_folder(stranger, things, tmp_path):
    sr.save_cloud(things["cloud"], tmp_path / "a.zarr")
    (tmp_path / "a.zarr" / stranger).write_text("x")
    raised_by(lambda: sr.save_cloud(things["cloud"], tmp_path / "a.zarr"))
    assert (tmp_path / "a.zarr" / stranger).read_text() == "x"


TRUNK = "minimal_trunk"
SURFACES = "must be a file name ending in .ply, .stl, .obj, .glb"
PICTURE = "must be a file name ending in .png, .pdf, .svg"
ELSE = "something else is there"


def case(words: str, expected: str):
    """A command line whose output cannot be written, and what is said of it."""
    return pytest.param(words.split(), expected, id=words)


UNWRITABLE = [
    case(f"cloud {TRUNK} --out notes.csv", "must be a file name ending in .zarr"),
    case(f"cloud {TRUNK} --out taken/a.zarr", "a part of its path is a file"),
    case(f"cloud {TRUNK} --out atlas.zarr", ELSE),
    case(f"cloud {TRUNK} --out broken.zarr", "zarr.json is not as softreach wrote it"),
    case(f"cloud {TRUNK} --out folder.zarr --overwrite", "never replaced"),
    case(f"volume {TRUNK} --out a.txt", SURFACES),
    case(f"volume {TRUNK} --out taken/a.ply", "a part of its path is a file"),
    case(f"volume {TRUNK} --out notes.ply", ELSE),
    case(f"volume {TRUNK} --out folder.ply", "never replaced"),
    case(f"reach {TRUNK} --out a.txt", SURFACES),
    case(f"reach {TRUNK} --out a.png --out a.txt", ".vtk, .png, .pdf, .svg"),
    case(f"reach {TRUNK} --out notes.ply", ELSE),
    case(f"reach {TRUNK} --out notes.png", ELSE),
    case(f"show {TRUNK} --out a.txt", PICTURE),
    case(f"show {TRUNK} --out notes.png", ELSE),
    case(f"show {TRUNK} --out taken/a.png", "a part of its path is a file"),
    case(f"equilibria {TRUNK} --out a.txt", PICTURE),
    case(f"equilibria {TRUNK} --out notes.png", ELSE),
    case("payload lce_arm --gravity up --out a.txt", PICTURE),
    case("payload lce_arm --gravity up --out notes.png", ELSE),
    case(f"track {TRUNK} path.csv --out a.txt", "must be a file name ending in .csv"),
    case(f"track {TRUNK} path.csv --out path.csv", ELSE),
    case(f"design {TRUNK} --out a.json", "must be a file name ending in .toml"),
    case(f"design {TRUNK} --out notes.toml", ELSE),
    case(f"export {TRUNK} notes.ply", ELSE),
    case(f"export {TRUNK} notes.jl", ELSE),
    case(f"export {TRUNK} a.xls", SURFACES),
    case("export cloud.zarr path.csv", ELSE),
    case("export cloud.zarr path.csv --format activefilaments", ELSE),
    case("demo --out taken", "a part of its path is a file"),
    case("demo --out mine", ELSE),
    case("paper --out taken", "a part of its path is a file"),
    case("paper --out mine", ELSE),
    case("atlas figures atlas.zarr --out taken", "a part of its path is a file"),
]


@pytest.fixture
def crowded(tmp_path, monkeypatch):
    """A folder with files that are nobody's output."""
    monkeypatch.chdir(tmp_path)
    for name in ("taken", "notes.ply", "notes.png", "notes.toml", "notes.jl"):
        (tmp_path / name).write_text("my notes")
    (tmp_path / "path.csv").write_text("x,y,z\n0.2,0.1,0.6\n0.2,0.1,0.61\n")
    for name in ("folder.zarr", "folder.ply", "mine"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "report.html").write_text("mine")
        (tmp_path / name / "cloud.png").write_text("mine")
    for name, content in {
        "atlas.zarr": sealed(b'{"attributes": {"command": "{}"}, "node_type": "group"}'),
        "broken.zarr": b'{"attributes": {"sam',
    }.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "zarr.json").write_bytes(content)
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
