"""Stores damaged in any file, any way: noticed, named in one line, mended by the same command."""

import subprocess
import sys
import textwrap
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach import schema
from softreach.atlas import DamagedStore, atlas_cloud, build_atlas, open_atlas, verify_atlas
from softreach.cli.app import run
from softreach.support.errors import SoftreachError, SoftreachWarning
from softreach.support.files.stores import Chunk
from tests.abuse.refusals import files_in, raised_by, refusal_of
from tests.atlas.families import TINY, gapped_space

Files = dict[str, bytes]
TIP = "tip/c/0/0/0/0"


def flipped(content: bytes) -> bytes:
    bit = int(np.random.default_rng(len(content)).integers(8 * len(content)))
    damaged = bytearray(content)
    damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


WAYS: dict[str, Callable[[bytes], bytes | None]] = {
    "one bit flipped": flipped,
    "cut in half": lambda content: content[: len(content) // 2],
    "nested too deeply": lambda _: b"[" * 100_000,
    "missing": lambda _: None,
}
MENDED = "one bit flipped", "missing"
"""Ways after which the atlas is built again, for every fifth file; all are found the same way."""


@pytest.fixture(scope="module")
def cloud() -> xr.Dataset:
    plain = sr.compute_cloud(sr.designs.minimal_trunk(), n=64)
    return schema.with_status(plain, np.zeros(64, np.int8))


@pytest.fixture(scope="module")
def cloud_files(cloud, tmp_path_factory) -> Files:
    place = tmp_path_factory.mktemp("whole") / "cloud.zarr"
    sr.save_cloud(cloud, place)
    return only_files(place)


@pytest.fixture(scope="module")
def atlas_files(tmp_path_factory) -> Files:
    place = tmp_path_factory.mktemp("whole") / "atlas.zarr"
    built(place)
    return only_files(place)


def built(place: Path, **options) -> xr.Dataset:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)  # a gap, and what is damaged
        return build_atlas(gapped_space(), place, **TINY | options)


def only_files(place: Path) -> Files:
    return {name: content for name, content in files_in(place).items() if content is not None}


def written(files: Files, place: Path, name: str = "", content: bytes | None = None) -> Path:
    """A store in a new folder, with other content in one file, or without it."""
    for file, kept in (files | {name: content} if name else files).items():
        if kept is not None:
            (place / file).parent.mkdir(parents=True, exist_ok=True)
            (place / file).write_bytes(kept)
    return place


def assert_named(error: object, name: str, place: Path) -> None:
    """One line names the array and the chunk of a file, and says what to do."""
    array, _, rest = name.rpartition("/c/") if "/c/" in name else name.rpartition("/")
    assert (f"{rest} of array {array}" if "/c/" in name else array) in str(error)
    assert str(place) in str(error)
    assert "\n" not in str(error)


# Any file, and any bit of it


@pytest.mark.parametrize("way", WAYS)
def test_damage_of_any_file_is_named_and_mended_by_the_command_that_built_the_atlas(
    cloud_files, atlas_files, tmp_path, way
):
    for number, (name, content) in enumerate(cloud_files.items()):
        place = written(cloud_files, tmp_path / f"cloud{number}.zarr", name, WAYS[way](content))
        assert_named(raised_by(lambda at=place: sr.open_cloud(at)), name, place)
    for number, (name, content) in enumerate(atlas_files.items()):
        place = written(atlas_files, tmp_path / f"{number}.zarr", name, WAYS[way](content))
        array, chunk = name.split("/")[0], Chunk.of_key(name)
        try:
            found = verify_atlas(place)
        except SoftreachError as error:
            assert_named(error, name, place)
        else:
            assert chunk is not None
            assert chunk.place is not None
            if (array, way) == ("status", "missing"):
                assert (found.todo, found.damaged) == (1, 0)
            else:
                design = int(np.ravel_multi_index(chunk.place[:2], (2, 2)))
                assert found.damaged == 1
                assert_named(found.messages[design], name, place)
        if way in MENDED and number % 5 == MENDED.index(way):
            built(place)
            assert only_files(place) == atlas_files


def test_no_other_command_writes_to_an_atlas_whose_root_is_lost(atlas_files, tmp_path):
    for way, damage in WAYS.items():
        content = damage(atlas_files["zarr.json"])
        place = written(atlas_files, tmp_path / way, "zarr.json", content)
        before = files_in(place)
        assert str(place) in str(raised_by(lambda at=place: built(at, seed=1)))
        assert files_in(place) == before


def test_what_lies_beside_arrays_is_not_read(cloud, cloud_files, atlas_files, tmp_path):
    beside = {f"zarr.{32 * 'a'}.partial": b"", "mine/zarr.json": b"{}", "thesis.tex": b"precious"}
    place = written(cloud_files | beside, tmp_path / "cloud.zarr")
    assert sr.open_cloud(place).identical(cloud)
    place = written(atlas_files | beside, tmp_path / "atlas.zarr")
    assert open_atlas(place).identical(open_atlas(written(atlas_files, tmp_path / "own.zarr")))
    built(place)
    assert only_files(place) == atlas_files | beside


def test_chunks_that_are_all_nan_exist(cloud, tmp_path):
    """So that one that is missing is damage, and no answer."""
    none = cloud.copy()
    none["tip"] = none.tip * np.nan
    sr.save_cloud(none, tmp_path / "cloud.zarr")
    assert sr.open_cloud(tmp_path / "cloud.zarr").identical(none)
    assert (tmp_path / "cloud.zarr/tip/c/0/0").is_file()


def test_many_damaged_chunks_are_one_error_and_nothing_is_printed_at_the_end(tmp_path):
    """Zarr reads chunks at once, and all errors but the first would be printed at the exit."""
    script = """
        from pathlib import Path
        import softreach as sr
        from softreach.cloud import clouds

        clouds._CHUNK = 50
        sr.save_cloud(sr.compute_cloud(sr.designs.minimal_trunk(), 2000), "a.zarr")
        for path in Path("a.zarr/tip/c").glob("*/0"):
            path.write_bytes(path.read_bytes()[:-3] + b"abc")
        try:
            sr.open_cloud("a.zarr")
        except sr.errors.InvalidInput as error:
            print(error)
    """
    command = [sys.executable, "-c", textwrap.dedent(script)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "of array tip in a.zarr = of a wrong checksum" in done.stdout
    assert done.stderr == ""


# What is done about it


def test_damaged_designs_are_left_out_with_a_warning(atlas_files, tmp_path):
    name = "metrics/c/0/0/0"
    place = written(atlas_files, tmp_path / "a.zarr", name, flipped(atlas_files[name]))
    with pytest.warns(SoftreachWarning, match=r"1 design is damaged, first number 0: chunk 0/0/0"):
        atlas = open_atlas(place)
    assert np.isfinite(atlas.reach_height.values).tolist() == [[False, True], [False, True]]
    assert atlas.status.values.tolist() == [[5, 1], [3, 1]]


def test_damaged_tips_are_noticed_when_they_are_read(atlas_files, tmp_path):
    place = written(atlas_files, tmp_path / "a.zarr", TIP, flipped(atlas_files[TIP]))
    atlas = open_atlas(place)
    at = {name: float(atlas[name][0]) for name in ("taper", "outer_radius")}
    for ask in (lambda: atlas_cloud(atlas, **at), lambda: atlas.tip.isel(taper=0).load()):
        error = raised_by(ask)
        assert isinstance(error, DamagedStore)
        assert (error.location, error.array, error.chunk) == (str(place), "tip", (0, 0, 0, 0))
    assert atlas_cloud(atlas, taper=at["taper"], outer_radius=0.1).sizes["sample"] == 10


def test_the_same_command_says_which_design_it_computes_again(atlas_files, tmp_path):
    place = written(atlas_files, tmp_path / "a.zarr", TIP, flipped(atlas_files[TIP]))
    for shard, left in (((1, 2), 1), ((0, 2), 0)):  # each mends its own designs
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", SoftreachWarning)
            build_atlas(gapped_space(), place, shard=shard, **TINY)
        told = any("1 design is damaged, first number 0" in str(one.message) for one in caught)
        assert told == (shard == (0, 2))
        assert verify_atlas(place).damaged == left


def test_commands_name_what_is_damaged(cloud_files, atlas_files, folder, capsys):
    written(cloud_files, Path("cloud.zarr"), "tip/c/0/0", flipped(cloud_files["tip/c/0/0"]))
    assert "chunk 0/0 of array tip" in refusal_of(["volume", "cloud.zarr"], capsys, folder)
    written(atlas_files, Path("a.zarr"), TIP, flipped(atlas_files[TIP]))
    assert run(["atlas", "status", "a.zarr", "--verify"]) == 2
    printed = capsys.readouterr()
    assert "chunk 0/0/0/0 of array tip" in printed.out
    assert printed.err.count("\n") == 1
    assert "the command that built the atlas" in printed.err


def test_a_store_that_is_replaced_while_it_is_read_is_not_mixed(cloud, tmp_path, monkeypatch):
    place = tmp_path / "cloud.zarr"
    sr.save_cloud(cloud, place)
    right = xr.open_zarr

    def replaced(*given, **options):
        opened = right(*given, **options)
        monkeypatch.undo()
        other = sr.compute_cloud(sr.designs.minimal_trunk(), n=64, seed=1)
        sr.save_cloud(schema.with_status(other, np.zeros(64, np.int8)), place, overwrite=True)
        return opened

    monkeypatch.setattr(xr, "open_zarr", replaced)
    error = raised_by(lambda: sr.open_cloud(place))
    assert str(error) == f"{place} was replaced while it was read: open it again"
    assert sr.open_cloud(place).attrs["seed"] == 1


# What softreach did not write


def test_stores_of_others_and_other_kinds_are_refused(cloud, cloud_files, atlas_files, tmp_path):
    bare = cloud.drop_vars(["axis", "bundle"])
    bare.to_zarr(tmp_path / "own.zarr", zarr_format=3, consolidated=False)
    bare.to_zarr(tmp_path / "old.zarr", zarr_format=2, consolidated=False)
    (tmp_path / "empty.zarr").mkdir()
    (tmp_path / "file.zarr").write_bytes(b"PK")
    for place in sorted(tmp_path.iterdir()):
        for ask in (sr.open_cloud, open_atlas, verify_atlas):
            assert str(place) in str(raised_by(lambda place=place, ask=ask: ask(place)))
    atlas = written(atlas_files, tmp_path / "atlas.zarr")
    other = written(cloud_files, tmp_path / "cloud.zarr")
    assert "this is an atlas" in str(raised_by(lambda: sr.open_cloud(atlas)))
    assert "an atlas written by build_atlas" in str(raised_by(lambda: open_atlas(other)))


def test_an_atlas_gives_way_to_a_cloud_only_if_one_says_so(cloud, atlas_files, tmp_path):
    place = written(atlas_files, tmp_path / "a.zarr")
    (place / f"tip/c/0.{32 * 'a'}.partial").touch()  # what a killed writer of Zarr leaves
    raised_by(lambda: sr.save_cloud(cloud, place))
    assert atlas_files.items() <= only_files(place).items()
    sr.save_cloud(cloud, place, overwrite=True)
    assert sr.open_cloud(place).identical(cloud)


CHANGES: dict[str, Callable[[xr.Dataset], object]] = {
    "no coordinate axis": lambda cloud: cloud.drop_vars("axis"),
    "another status": lambda cloud: schema.with_status(cloud, np.full(64, 9, np.int8)),
    "no dataset": lambda cloud: cloud.to_dict(),
    "another length": lambda cloud: cloud.assign(tip=cloud.tip.assign_attrs(length=2.0)),
    "another design": lambda cloud: cloud.assign_attrs(design=sr.designs.lce_arm().to_toml()),
    "a tolerance of NaN": lambda cloud: cloud.assign_attrs(tol=float("nan")),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_no_cloud_that_cannot_be_opened_is_saved(cloud, tmp_path, change):
    raised_by(lambda: sr.save_cloud(change(cloud), tmp_path / "cloud.zarr"))
    assert list(tmp_path.iterdir()) == []
