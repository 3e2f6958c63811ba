"""Clouds and atlases damaged in every way: noticed, told in one line, and mended where possible."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import textwrap
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach import schema
from softreach.atlas import DamagedStore, atlas_cloud, build_atlas, open_atlas, verify_atlas
from softreach.cli.app import run
from softreach.support.errors import SoftreachError, SoftreachWarning
from softreach.support.files.documents import ARRAYS, DIGEST, sealed
from tests.abuse.refusals import files_in, raised_by, refusal_of
from tests.atlas.families import TINY, gapped_space

Files = dict[str, bytes]
Damage = Callable[[bytes], bytes | None]

# ---------------------------------------------------------------- ways to damage a file


def flipped(content: bytes, bit: int | None = None) -> bytes:
    bit = 4 * len(content) if bit is None else bit
    damaged = bytearray(content)
    damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


def random_bytes(content: bytes) -> bytes:
    return np.random.default_rng(len(content)).bytes(len(content))


ANY_FILE: dict[str, Damage] = {
    "truncated": lambda content: content[: len(content) // 2],
    "cut by a byte": lambda content: content[:-1],
    "empty": lambda _: b"",
    "random": random_bytes,
    "one bit flipped": flipped,
    "of zeros": lambda content: bytes(len(content)),
}
DELETED: dict[str, Damage] = {"deleted": lambda _: None}
FOREIGN = {
    "zarr_format": 3,
    "node_type": "array",
    "shape": [4],
    "data_type": "float64",
    "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [4]}},
    "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
    "fill_value": 0.0,
    "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
    "attributes": {},
}


def forged(damage: Damage) -> Damage:
    """A change of what describes an array that the root lists too, as if it were right."""
    FORGED.add(damage)
    return damage


FORGED: set[Damage] = set()


def with_values(**values: Any) -> Damage:
    """What describes an array with other values."""
    return forged(lambda content: json.dumps(json.loads(content) | values).encode())


def listed(root: bytes, array: str, content: bytes) -> bytes:
    """A root that lists another description of an array."""
    document = json.loads(root)
    packed = json.dumps(json.loads(content), sort_keys=True, separators=(",", ":"))
    document["attributes"][ARRAYS][array] = hashlib.sha256(packed.encode()).hexdigest()
    return sealed(json.dumps(document).encode())


BYTES = {"name": "bytes", "configuration": {"endian": "little"}}
DOCUMENT: dict[str, Damage] = {
    "broken JSON": lambda content: content[:-2] + b"]]",
    "a thousand brackets": lambda _: b"[" * 100_000,
    "a list": lambda _: b"[1, 2]",
    "foreign": lambda _: json.dumps(FOREIGN).encode(),
    "in UTF-16": lambda content: content.decode().encode("utf-16"),
}
ARRAY: dict[str, Damage] = {
    "complex": with_values(data_type="complex128", fill_value=[0.0, 0.0]),
    "dates": with_values(
        data_type={"name": "numpy.datetime64", "configuration": {"unit": "s", "scale_factor": 1}}
    ),
    "objects": with_values(codecs=[{"name": "numcodecs.pickle"}, {"name": "crc32c"}]),
    "of another type": with_values(data_type="float32", fill_value=0.0, codecs=[BYTES]),
    "without checksums": with_values(codecs=[BYTES]),
    "another group": with_values(node_type="group"),
}


def changed_attribute(name: str, value: Any) -> Damage:
    """An attribute with another value, or without one if that is None; its digest is right."""

    def damaged(content: bytes) -> bytes:
        document = json.loads(content)
        before = document["attributes"].pop(name)
        if value is not None:
            document["attributes"][name] = before | value if name == ARRAYS else value
        text = json.dumps(document).encode()
        return sealed(text) if DIGEST in document["attributes"] else text

    return forged(damaged)


# ---------------------------------------------------------------- stores to damage


@pytest.fixture(scope="module")
def cloud() -> xr.Dataset:
    plain = sr.compute_cloud(sr.designs.minimal_trunk(), n=64)
    return schema.with_status(plain, np.zeros(64, np.int8))


@pytest.fixture(scope="module")
def cloud_files(cloud, tmp_path_factory) -> Files:
    place = tmp_path_factory.mktemp("whole") / "cloud.zarr"
    sr.save_cloud(cloud, place)
    return only_files(place)


def built(place: Path) -> xr.Dataset:
    with pytest.warns(SoftreachWarning):  # a gap
        return build_atlas(gapped_space(), place, **TINY)


def built_silently(place: Path) -> xr.Dataset:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)
        return build_atlas(gapped_space(), place, **TINY)


@pytest.fixture(scope="module")
def atlas_files(tmp_path_factory) -> Files:
    place = tmp_path_factory.mktemp("whole") / "atlas.zarr"
    built(place)
    return only_files(place)


def only_files(place: Path) -> Files:
    return {name: content for name, content in files_in(place).items() if content is not None}


def written(files: Files, place: Path, name: str = "", damage: Damage | None = None) -> Path:
    """The store at a place, with one file damaged."""
    for file, content in files.items():
        kept = damage(content) if damage and file == name else content
        if kept is not None:
            (place / file).parent.mkdir(parents=True, exist_ok=True)
            (place / file).write_bytes(kept)
    if damage in FORGED and name != "zarr.json":
        root, content = place / "zarr.json", (place / name).read_bytes()
        root.write_bytes(listed(root.read_bytes(), name.partition("/")[0], content))
    return place


def told_by(call: Callable[[], object]) -> str:
    """The one line of an error."""
    line = str(raised_by(call))
    assert "\n" not in line
    return line


# ---------------------------------------------------------------- clouds

CLOUD_CHUNKS = {
    "tip/c/0/0": ANY_FILE | DELETED,
    "activation/c/0/0": ANY_FILE | DELETED,
    "axis/c/0": ANY_FILE | DELETED,
    "bundle/c/0": ANY_FILE | DELETED,
    "status/c/0": ANY_FILE | DELETED,
}
CLOUD_ARRAYS = ("tip", "activation", "axis", "bundle", "status")
CLOUD_DOCUMENTS = {
    "zarr.json": ANY_FILE | DELETED | DOCUMENT,
    **{f"{name}/zarr.json": ANY_FILE | DELETED | DOCUMENT | ARRAY for name in CLOUD_ARRAYS},
}


@pytest.mark.parametrize("file", CLOUD_CHUNKS)
def test_a_damaged_chunk_of_a_cloud_is_named(cloud_files, tmp_path, file):
    for way, damage in CLOUD_CHUNKS[file].items():
        place = written(cloud_files, tmp_path / way, file, damage)
        error = raised_by(lambda place=place: sr.open_cloud(place))
        array, _, chunk = file.partition("/c/")
        assert isinstance(error, DamagedStore)
        assert f"chunk {chunk} of array {array} in {place} = " in str(error)
        assert "must be as softreach wrote it; compute the cloud again" in str(error)
        assert "\n" not in str(error)


@pytest.mark.parametrize("file", CLOUD_DOCUMENTS)
def test_what_describes_a_cloud_is_checked(cloud_files, tmp_path, file):
    for way, damage in CLOUD_DOCUMENTS[file].items():
        place = written(cloud_files, tmp_path / way, file, damage)
        error = raised_by(lambda place=place: sr.open_cloud(place))
        assert str(place) in str(error)
        assert file.rpartition("/")[0] in str(error)
        assert "\n" not in str(error)


def test_a_description_from_another_store_is_noticed(cloud, cloud_files, tmp_path):
    """It is whole, but not of this store."""
    sr.save_cloud(cloud.assign(tip=cloud.tip.assign_attrs(note="other")), tmp_path / "other.zarr")
    foreign = (tmp_path / "other.zarr/tip/zarr.json").read_bytes()
    place = written(cloud_files, tmp_path / "cloud.zarr", "tip/zarr.json", lambda _: foreign)
    error = raised_by(lambda: sr.open_cloud(place))
    assert isinstance(error, DamagedStore)
    assert f"array tip in {place} = changed since it was written" in str(error)


OTHER_DESIGN = sr.designs.lce_arm().to_toml()
CLOUD_ATTRIBUTES = {
    "no design": ("zarr.json", "design", None, r"attrs\['design'\] = None: must be the text"),
    "no design file": ("zarr.json", "design", "[[[", "design"),
    "a design that is a number": ("zarr.json", "design", 7, r"attrs\['design'\] = 7: must be"),
    "other bundles": ("zarr.json", "design", OTHER_DESIGN, "as its design says"),
    "no schema": ("zarr.json", "schema_version", None, "schema_version"),
    "another schema": ("zarr.json", "schema_version", 1, r"schema_version'\] = 1: must be 2"),
    "a schema in words": ("zarr.json", "schema_version", "two", "schema_version"),
    "no version": ("zarr.json", "softreach_version", None, "softreach_version"),
    "a version that is a list": ("zarr.json", "softreach_version", [1], "softreach_version"),
    "no sampler": ("zarr.json", "sampler", None, "sampler"),
    "a sampler that is true": ("zarr.json", "sampler", True, "sampler"),
    "a seed in words": ("zarr.json", "seed", "zero", "seed.*a whole number"),
    "half a seed": ("zarr.json", "seed", 0.5, "seed.*a whole number"),
    "no tol": ("zarr.json", "tol", None, "tol.*a number"),
    "a tol in words": ("zarr.json", "tol", "small", "tol.*a number"),
    "a negative tol": ("zarr.json", "tol", -1.0, "tol.*> 0"),
    "a tol that is no number": ("zarr.json", "tol", float("nan"), "tol.*> 0"),
    "no arrays": ("zarr.json", "arrays", {"speed": ""}, "array speed in .* = missing"),
    "no length": ("tip/zarr.json", "length", None, "length.*must be 1.0 m, as its design says"),
    "another length": ("tip/zarr.json", "length", 2.0, "length.*must be 1.0 m"),
    "a length in words": ("tip/zarr.json", "length", "long", "length.*must be 1.0 m"),
}


@pytest.mark.parametrize(
    ("file", "name", "value", "told"), CLOUD_ATTRIBUTES.values(), ids=CLOUD_ATTRIBUTES
)
def test_attributes_of_a_cloud_agree_with_its_data(cloud_files, tmp_path, file, name, value, told):
    damage = changed_attribute(name, value)
    place = written(cloud_files, tmp_path / "cloud.zarr", file, damage)
    assert re.search(told, str(raised_by(lambda: sr.open_cloud(place))))


@pytest.mark.parametrize("part", ["tip", "activation", "status"])
@pytest.mark.parametrize(
    "kind", ["complex128", "datetime64[s]", "int64", "float32", "U4", "object"]
)
def test_no_cloud_of_another_type_is_saved(cloud, tmp_path, part, kind):
    other = cloud.copy()
    other[part] = other[part].astype(kind)
    error = raised_by(lambda: sr.save_cloud(other, tmp_path / "cloud.zarr"))
    assert f"cloud.{part} = of type " in str(error)
    assert list(tmp_path.iterdir()) == []


CHANGES = {
    "no coordinate axis": lambda cloud: cloud.drop_vars("axis"),
    "bundles of other names": lambda cloud: cloud.assign_coords(bundle=["a", "b", "c"]),
    "fewer bundles": lambda cloud: cloud.isel(bundle=[0, 1]),
    "another status": lambda cloud: schema.with_status(cloud, np.full(64, 9, np.int8)),
    "complex numbers beside": lambda cloud: cloud.assign(more=("sample", np.ones(64, complex))),
    "no dataset": lambda cloud: cloud.to_dict(),
    "nothing": lambda _: None,
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_no_cloud_that_cannot_be_opened_is_saved(cloud, tmp_path, change):
    raised_by(lambda: sr.save_cloud(change(cloud), tmp_path / "cloud.zarr"))
    assert list(tmp_path.iterdir()) == []


def test_chunks_that_are_all_nan_exist(cloud, tmp_path):
    """So that one that is missing is damage, and no answer."""
    none = cloud.copy()
    none["tip"] = none.tip * np.nan
    sr.save_cloud(none, tmp_path / "cloud.zarr")
    assert sr.open_cloud(tmp_path / "cloud.zarr").identical(none)
    assert (tmp_path / "cloud.zarr/tip/c/0/0").is_file()


@pytest.mark.parametrize("which", ["cloud", "atlas"])
def test_every_chunk_has_a_checksum(cloud_files, atlas_files, which):
    files = cloud_files if which == "cloud" else atlas_files
    documents = [json.loads(text) for name, text in files.items() if name.endswith("zarr.json")]
    codecs = [document["codecs"] for document in documents if document["node_type"] == "array"]
    assert len(codecs) >= 5
    assert all(codec[-1]["name"] == "crc32c" for codec in codecs)


def test_stores_of_other_programs_are_refused(cloud, tmp_path):
    bare = cloud.drop_vars(["axis", "bundle"])
    bare.to_zarr(tmp_path / "own.zarr", zarr_format=3, consolidated=False)
    bare.to_zarr(tmp_path / "old.zarr", zarr_format=2, consolidated=False)
    (tmp_path / "empty.zarr").mkdir()
    (tmp_path / "file.zarr").write_bytes(b"PK")
    for place in sorted(tmp_path.iterdir()):
        for ask in (sr.open_cloud, open_atlas, verify_atlas):
            assert str(place) in str(raised_by(lambda place=place, ask=ask: ask(place)))


def test_a_cloud_and_an_atlas_are_not_taken_for_each_other(cloud_files, atlas_files, tmp_path):
    cloud = written(cloud_files, tmp_path / "cloud.zarr")
    atlas = written(atlas_files, tmp_path / "atlas.zarr")
    assert "this is an atlas" in str(raised_by(lambda: sr.open_cloud(atlas)))
    assert "an atlas written by build_atlas" in str(raised_by(lambda: open_atlas(cloud)))


# ---------------------------------------------------------------- atlases

SHARED = ("taper", "outer_radius", "metric", "axis", "unit_activation", "quantity", "station")
SHARED += ("quantile",)
FIRST = {"metrics": "0/0/0", "curvature": "0/0/0/0/0", "tip": "0/0/0/0", "checksum": "0/0/0"}
FIRST |= {"status": "0/0"}
SHARED_FILES = {
    file: ANY_FILE | DELETED
    for name in SHARED
    for file in (f"{name}/c/{'0/0' if name == 'unit_activation' else '0'}", f"{name}/zarr.json")
}
DESIGN_DOCUMENTS = {f"{name}/zarr.json": ANY_FILE | DELETED for name in (*FIRST, "message")}
DESIGN_CHUNKS = {
    **{f"{name}/c/{place}": ANY_FILE | DELETED for name, place in FIRST.items()},
    "message/c/1/0": ANY_FILE | DELETED,  # of the gap
    "checksum/c/1/0/0": ANY_FILE | DELETED,
    "status/c/1/0": ANY_FILE | DELETED,
}


@pytest.mark.parametrize("file", SHARED_FILES | DESIGN_DOCUMENTS)
def test_what_all_designs_share_is_checked(atlas_files, tmp_path, file):
    for way, damage in (SHARED_FILES | DESIGN_DOCUMENTS)[file].items():
        place = written(atlas_files, tmp_path / way, file, damage)
        error = raised_by(lambda place=place: verify_atlas(place))
        if (
            file != "metrics/zarr.json" or damage(b"{}") is not None
        ):  # without it nothing was sealed
            assert f"array {file.partition('/')[0]} in {place}" in str(error)
        assert "the command that" in str(error)
        assert "\n" not in str(error)


@pytest.mark.parametrize("file", DESIGN_CHUNKS)
def test_a_damaged_design_is_named(atlas_files, tmp_path, file):
    for way, damage in DESIGN_CHUNKS[file].items():
        place = written(atlas_files, tmp_path / way, file, damage)
        found = verify_atlas(place)
        array, _, chunk = file.partition("/c/")
        if not (place / file).exists() and array == "status":
            assert (found.todo, found.damaged) == (1, 0)
        else:
            number = 2 if file.startswith(("message", "checksum/c/1", "status/c/1")) else 0
            assert found.damaged == 1
            assert f"chunk {chunk} of array {array} in {place} = " in found.messages[number]


MENDED = {*SHARED_FILES, *DESIGN_DOCUMENTS, *DESIGN_CHUNKS}


@pytest.mark.parametrize("damage", (ANY_FILE | DELETED).values(), ids=ANY_FILE | DELETED)
def test_the_same_command_brings_every_byte_back(atlas_files, tmp_path, damage):
    place = tmp_path / "atlas.zarr"
    for name, content in atlas_files.items():
        written({name: content}, place, name if name in MENDED else "", damage)
    built_silently(place)
    assert only_files(place) == atlas_files
    assert verify_atlas(place).damaged == 0


@pytest.mark.parametrize("name", FIRST)
def test_the_same_command_says_which_design_it_computes_again(atlas_files, tmp_path, name):
    place = written(atlas_files, tmp_path / "atlas.zarr", f"{name}/c/{FIRST[name]}", flipped)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SoftreachWarning)
        build_atlas(gapped_space(), place, **TINY)
    told = [str(warning.message) for warning in caught]
    assert any("1 design is damaged, first number 0" in line for line in told)
    assert only_files(place) == atlas_files


def test_a_shard_mends_its_own_designs(atlas_files, tmp_path):
    place = written(atlas_files, tmp_path / "atlas.zarr", "tip/c/0/0/0/0", flipped)
    for shard, left in (((1, 2), 1), ((0, 2), 0)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SoftreachWarning)
            build_atlas(gapped_space(), place, shard=shard, **TINY)
        assert verify_atlas(place).damaged == left


def test_verify_says_what_is_damaged_and_fails(atlas_files, tmp_path, capsys):
    place = written(atlas_files, tmp_path / "atlas.zarr", "tip/c/0/0/0/0", flipped)
    assert run(["atlas", "status", str(place), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["damaged"] == 1
    assert run(["atlas", "verify", str(place)]) == 2
    printed = capsys.readouterr()
    assert "chunk 0/0/0/0 of array tip" in printed.out
    assert printed.err.count("\n") == 1
    assert "the command that built the atlas" in printed.err
    built_silently(place)
    assert run(["atlas", "verify", str(place)]) == 0


def test_durable_stores_hold_the_same(cloud, cloud_files, atlas_files, tmp_path):
    sr.save_cloud(cloud, tmp_path / "cloud.zarr", durable=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)
        build_atlas(gapped_space(), tmp_path / "atlas.zarr", durable=True, **TINY)
    assert only_files(tmp_path / "cloud.zarr") == cloud_files
    assert only_files(tmp_path / "atlas.zarr") == atlas_files


def test_a_durable_file_is_synced_before_it_counts(tmp_path, monkeypatch):
    """Every chunk of a design is on the disk before its status is written."""
    synced: list[str] = []

    def fsync(handle: int) -> None:
        synced.append(os.readlink(f"/proc/self/fd/{handle}"))

    monkeypatch.setattr(os, "fsync", fsync)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)
        build_atlas(gapped_space(), tmp_path / "a.zarr", durable=True, **TINY)
    places = [synced.index(str(tmp_path / f"a.zarr/{name}/c/{FIRST[name]}")) for name in FIRST]
    assert places[-1] == max(places)
    assert str(tmp_path / "a.zarr") in synced


def test_nobody_builds_on_an_atlas_whose_root_is_damaged(atlas_files, tmp_path):
    for way, damage in (ANY_FILE | DELETED | DOCUMENT).items():
        place = written(atlas_files, tmp_path / way, "zarr.json", damage)
        before = files_in(place)
        for ask in (open_atlas, verify_atlas, built_silently):
            assert str(place) in told_by(lambda ask=ask, place=place: ask(place))
        assert files_in(place) == before


COMMAND = {
    "no command": None,
    "a number": 7,
    "no JSON": "{",
    "a list": "[]",
    "nothing in it": "{}",
    "only a version": '{"atlas_version": 4}',
}


@pytest.mark.parametrize("value", COMMAND.values(), ids=COMMAND)
def test_a_command_that_is_none_is_refused(atlas_files, tmp_path, value):
    damage = changed_attribute("command", value)
    place = written(atlas_files, tmp_path / "atlas.zarr", "zarr.json", damage)
    assert "\n" not in str(raised_by(lambda: open_atlas(place)))


SETTINGS = {
    "n": ["many", 0, 2.5, None, 11],
    "seed": ["zero", 0.5, None],
    "sampler": [7, "none", None],
    "tol": ["small", None],
    "keep_clouds": ["yes", None],
    "metrics": [None, 7, [7], [{}], ["extent"]],
    "space": [None, 7, {}, {"design": 7}],
    "stations": [None, 7, ["a"], [0.5]],
    "quantiles": [None, 7, [0.5]],
}


@pytest.mark.parametrize(
    ("name", "value"),
    [pytest.param(n, v, id=f"{n} = {v}") for n, values in SETTINGS.items() for v in values],
)
def test_a_command_with_other_settings_is_refused(atlas_files, tmp_path, name, value):
    """An atlas whose attributes say something else than its arrays."""

    def damage(content: bytes) -> bytes:
        document = json.loads(content)
        command = json.loads(document["attributes"]["command"])
        command[name] = value
        if value is None:
            del command[name]
        document["attributes"]["command"] = json.dumps(command)
        return sealed(json.dumps(document).encode())

    place = written(atlas_files, tmp_path / "atlas.zarr", "zarr.json", damage)
    assert "\n" not in str(raised_by(lambda: open_atlas(place)))


def test_damaged_designs_are_left_out_with_a_warning(atlas_files, tmp_path):
    place = written(atlas_files, tmp_path / "atlas.zarr", "metrics/c/0/0/0", flipped)
    with pytest.warns(SoftreachWarning, match=r"1 design is damaged, first number 0: chunk 0/0/0"):
        atlas = open_atlas(place)
    assert np.isfinite(atlas.reach_height.values).tolist() == [[False, True], [False, True]]
    assert atlas.status.values.tolist() == [[5, 1], [3, 1]]


@pytest.mark.parametrize("damage", (ANY_FILE | DELETED).values(), ids=ANY_FILE | DELETED)
def test_damaged_tips_are_noticed_when_they_are_read(atlas_files, tmp_path, damage):
    place = written(atlas_files, tmp_path / "atlas.zarr", "tip/c/0/0/0/0", damage)
    atlas = open_atlas(place)
    at = {name: float(atlas[name][0]) for name in ("taper", "outer_radius")}
    for ask in (lambda: atlas_cloud(atlas, **at), lambda: atlas.tip.isel(taper=0).load()):
        error = raised_by(ask)
        assert isinstance(error, DamagedStore)
        assert (error.array, error.chunk) == ("tip", (0, 0, 0, 0))
        assert error.location == str(place)
    assert atlas_cloud(atlas, taper=at["taper"], outer_radius=0.1).sizes["sample"] == 10


# ---------------------------------------------------------------- commands

CLOUD_COMMANDS = {
    "volume": ["volume", "{}"],
    "export": ["export", "{}", "cloud.csv"],
    "show": ["show", "{}", "--out", "cloud.png"],
    "studio": ["studio", "{}"],
}


@pytest.mark.parametrize("command", CLOUD_COMMANDS.values(), ids=CLOUD_COMMANDS)
def test_commands_name_the_damaged_chunk(cloud_files, tmp_path, capsys, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    place = written(cloud_files, tmp_path / "cloud.zarr", "tip/c/0/0", flipped)
    arguments = [part.format(place) for part in command]
    assert "chunk 0/0 of array tip" in refusal_of(arguments, capsys, tmp_path)


ATLAS_COMMANDS = {
    "status": ["status", "{}"],
    "verify": ["verify", "{}"],
    "best": ["best", "{}", "reach_height"],
    "figures": ["figures", "{}", "--out", "figures"],
}


@pytest.mark.parametrize("command", ATLAS_COMMANDS.values(), ids=ATLAS_COMMANDS)
def test_atlas_commands_name_the_damaged_array(atlas_files, tmp_path, capsys, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    place = written(atlas_files, tmp_path / "atlas.zarr", "taper/c/0", flipped)
    arguments = ["atlas", *(part.format(place) for part in command)]
    assert "array taper" in refusal_of(arguments, capsys, tmp_path)


@pytest.mark.parametrize("shard", ["１/2", "0/２", "²/3", "-1/2", "2/2", "0/0", "1", "a/b", ""])
def test_a_shard_is_two_plain_numbers(tmp_path, capsys, shard):
    arguments = ["atlas", "build", str(tmp_path / "a.zarr"), "--vary", "taper_deg=0,1"]
    assert "shard" in refusal_of([*arguments, f"--shard={shard}"], capsys, tmp_path)


# ---------------------------------------------------------------- any bit of any file


def bit_of(files: Files, place: int) -> tuple[str, int]:
    """The file and bit at a place, counted over all bits of a store."""
    sizes = {name: 8 * len(content) for name, content in files.items()}
    place %= sum(sizes.values())
    for name, size in sizes.items():
        if place < size:
            return name, place
        place -= size
    raise AssertionError


def fails_in_one_line(call: Callable[[], bool], place: Path) -> bool:
    """Whether a call fails, which it must do in one line; else it must be true."""
    try:
        good = call()
    except SoftreachError as error:
        line = str(error)
    else:
        assert good
        return False
    assert "\n" not in line
    assert str(place) in line
    return True


@given(place=st.integers(0, 1 << 40))
def test_any_flipped_bit_of_a_cloud_is_noticed_or_changes_nothing(
    cloud, cloud_files, tmp_path_factory, place
):
    name, bit = bit_of(cloud_files, place)
    folder = tmp_path_factory.mktemp("flipped")
    written(cloud_files, folder, name, lambda content: flipped(content, bit))
    fails_in_one_line(lambda: sr.open_cloud(folder).identical(cloud), folder)
    shutil.rmtree(folder)


@given(place=st.integers(0, 1 << 40))
def test_any_flipped_bit_of_an_atlas_is_noticed(atlas_files, tmp_path_factory, place):
    name, bit = bit_of(atlas_files, place)
    folder = tmp_path_factory.mktemp("flipped")
    written(atlas_files, folder, name, lambda content: flipped(content, bit))
    failed = fails_in_one_line(lambda: verify_atlas(folder).damaged == 1, folder)
    assert failed == (name.split("/")[0] not in (*FIRST, "message") or name.endswith(".json"))
    shutil.rmtree(folder)


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
