"""Whole files of other stores, designs and versions: noticed, mended, and never thrown away."""

from __future__ import annotations

import gc
import json
import os
import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import softreach as sr
from softreach import schema
from softreach.atlas import (
    DamagedStore,
    DesignSpace,
    atlas_cloud,
    build_atlas,
    open_atlas,
    verify_atlas,
)
from softreach.atlas.layout import CHECKSUM
from softreach.atlas.store import AtlasStore
from softreach.support.errors import InvalidInput, SoftreachWarning
from softreach.support.files.documents import ARRAYS, CHUNKS, DIGEST, sealed
from tests.abuse.refusals import files_in, raised_by
from tests.abuse.test_damaged_stores import Files, listed, only_files, written
from tests.atlas.families import TINY, assert_same

Change = Callable[[Files, Files], Files]
"""Files of a store, and files of another one -> those of the first that are replaced."""


def taken(*names: str) -> Change:
    """Files of the other store in the place of these."""
    return lambda own, other: {
        name: content
        for name, content in other.items()
        if any(name == wanted or name.startswith(f"{wanted}/") for wanted in names)
    }


def exchanged(*pairs: tuple[str, str]) -> Change:
    """Files of the store in each other's place."""
    return lambda own, other: {a: own[b] for pair in pairs for a, b in (pair, pair[::-1])}


# ---------------------------------------------------------------- clouds


def cloud_of(seed: int, **design: float):
    arm = sr.designs.minimal_trunk(**design)
    return schema.with_status(
        sr.compute_cloud(arm, n=64, seed=seed), np.full(64, seed % 2, np.int8)
    )


@pytest.fixture(scope="module")
def clouds(tmp_path_factory) -> dict[str, Files]:
    """Clouds of as many samples, in chunks of 32."""
    made = {"own": cloud_of(0), "other": cloud_of(1), "of another arm": cloud_of(3, taper=0.01)}
    place = tmp_path_factory.mktemp("clouds")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("softreach.cloud.clouds._CHUNK", 32)
        for name, cloud in made.items():
            sr.save_cloud(cloud, place / name)
    return {name: only_files(place / name) for name in made}


OF_CLOUDS: dict[str, Change] = {
    "tips": taken("tip/c/0/0"),
    "activations": taken("activation/c/0/0"),
    "the status": taken("status/c/0"),
    "what describes the tips": taken("tip/zarr.json"),
    "the tips and what describes them": taken("tip"),
    "the root": taken("zarr.json"),
    "all arrays": taken("tip", "activation", "status"),
    "chunks of one array": exchanged(("tip/c/0/0", "tip/c/1/0")),
    "tips and activations": exchanged(("tip/c/0/0", "activation/c/0/0")),
}


@pytest.mark.parametrize("other", ["other", "of another arm"])
@pytest.mark.parametrize("change", OF_CLOUDS.values(), ids=OF_CLOUDS)
def test_a_file_of_another_cloud_or_place_is_noticed(clouds, tmp_path, change, other):
    own = clouds["own"]
    place = written(own | change(own, clouds[other]), tmp_path / "a.zarr")
    assert only_files(place) != own
    error = raised_by(lambda: sr.open_cloud(place))
    assert isinstance(error, DamagedStore)
    assert f" in {place} = " in str(error)
    assert "must be as softreach wrote it; compute the cloud again" in str(error)


@pytest.mark.parametrize("name", ["zarr.json", "tip/zarr.json", "tip/c/0/0"])
def test_a_pipe_in_the_place_of_a_file_of_a_cloud_is_refused_at_once(clouds, tmp_path, name):
    place = written(clouds["own"], tmp_path / "a.zarr")
    (place / name).unlink()
    os.mkfifo(place / name)
    error = raised_by(lambda: sr.open_cloud(place))
    assert " = no file: must be as softreach wrote it; compute the cloud again" in str(error)


def test_an_interrupted_copy_over_a_cloud_is_noticed(clouds, tmp_path):
    """Whichever files it came to, in any order; all of them are the other cloud."""
    own, other = clouds["own"], clouds["other"]
    for names in (sorted(own), sorted(own)[::-1]):
        differ = [k + 1 for k, name in enumerate(names) if own[name] != other[name]]
        for count in differ[:-1]:
            copied = {name: other[name] for name in names[:count]}
            place = written(own | copied, tmp_path / "a.zarr")
            assert isinstance(raised_by(lambda place=place: sr.open_cloud(place)), DamagedStore)
    whole = sr.open_cloud(written(other, tmp_path / "a.zarr"))
    assert whole.identical(cloud_of(1))


@pytest.mark.parametrize("way", ["other arrays", "added arrays"])
def test_of_several_arrays_of_another_cloud_only_the_first_is_told(clouds, tmp_path, caplog, way):
    """What a library loses in its threads is not printed when they end."""
    own, other = clouds["own"], clouds["other"]
    tips = {name.removeprefix("tip/"): text for name, text in taken("tip")(own, own).items()}
    files = {
        "other arrays": taken("tip", "activation", "status")(own, other),
        "added arrays": {f"my_{k}/{name}": text for k in "abcd" for name, text in tips.items()},
    }[way]
    place = written(own | files, tmp_path / "a.zarr")
    raised_by(lambda: sr.open_cloud(place))
    gc.collect()
    assert "never retrieved" not in caplog.text


# ---------------------------------------------------------------- atlases


def space() -> DesignSpace:
    """Six designs, of which numbers 2 and 4 cannot exist."""
    taper, radius = np.radians([2.0, 4.0, 5.0]), [1 / 16, 0.1]
    return DesignSpace.grid(sr.designs.minimal_trunk(), taper=taper, outer_radius=radius)


def built(place: Path, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)
        return build_atlas(space(), place, **TINY | options)


@pytest.fixture(scope="module")
def atlases(tmp_path_factory) -> dict[str, Files]:
    place = tmp_path_factory.mktemp("atlases")
    for seed in (0, 1):
        built(place / f"{seed}.zarr", seed=seed)
    return {"own": only_files(place / "0.zarr"), "other": only_files(place / "1.zarr")}


PLACES = {"metrics": "0", "curvature": "0/0/0", "tip": "0/0", CHECKSUM: "0"}


def chunk(array: str, design: str) -> str:
    return "/".join(filter(None, (array, "c", design, PLACES.get(array))))


FIRST = [chunk(array, "0/0") for array in (*PLACES, "status")]
OF_ATLASES: dict[str, Change] = {
    "metrics of two designs": exchanged((chunk("metrics", "0/0"), chunk("metrics", "0/1"))),
    "curvature of two designs": exchanged((chunk("curvature", "0/0"), chunk("curvature", "0/1"))),
    "tips of two designs": exchanged((chunk("tip", "0/0"), chunk("tip", "0/1"))),
    "bindings of two designs": exchanged((chunk(CHECKSUM, "0/0"), chunk(CHECKSUM, "0/1"))),
    "two designs": exchanged(*((chunk(a, "0/0"), chunk(a, "0/1")) for a in (*PLACES, "status"))),
    "messages of two gaps": exchanged((chunk("message", "1/0"), chunk("message", "2/0"))),
    "bindings of two gaps": exchanged((chunk(CHECKSUM, "1/0"), chunk(CHECKSUM, "2/0"))),
    "the status of a design and a gap": exchanged((chunk("status", "0/0"), chunk("status", "1/0"))),
    "metrics of another atlas": taken(chunk("metrics", "0/0")),
    "curvature of another atlas": taken(chunk("curvature", "0/0")),
    "tips of another atlas": taken(chunk("tip", "0/0")),
    "a design of another atlas": taken(*FIRST),
    "activations of another atlas": taken("unit_activation"),
    "designs of another atlas": taken(*PLACES, "status", "message"),
}


def damage_of(place: Path) -> list[str]:
    """What verifying an atlas says is damaged."""
    try:
        status = verify_atlas(place)
    except DamagedStore as error:
        return [str(error)]
    return [text for text in status.messages.values() if "must be as softreach wrote it" in text]


@pytest.mark.parametrize("change", OF_ATLASES.values(), ids=OF_ATLASES)
def test_a_file_of_another_design_or_atlas_is_noticed_and_mended(atlases, tmp_path, change):
    own = atlases["own"]
    place = written(own | change(own, atlases["other"]), tmp_path / "a.zarr")
    assert damage_of(place)
    built(place)
    assert only_files(place) == own
    assert not damage_of(place)


def test_the_root_of_another_atlas_owns_none_of_the_designs(atlases, tmp_path):
    place = written(atlases["own"], tmp_path / "a.zarr")
    (place / "zarr.json").write_bytes(atlases["other"]["zarr.json"])
    assert "unit_activation" in str(raised_by(lambda: verify_atlas(place)))
    with pytest.raises(InvalidInput, match="seed: 1 there, 0 here"):
        built(place)
    built(place, seed=1)
    assert only_files(place) == atlases["other"]


def test_tips_of_another_design_are_noticed_when_they_are_read(atlases, tmp_path):
    own = atlases["own"]
    change = OF_ATLASES["tips of two designs"]
    atlas = open_atlas(written(own | change(own, own), tmp_path / "a.zarr"))
    with pytest.raises(DamagedStore, match=r"chunk 0/1/0/0 of array tip in .* = of another store"):
        atlas_cloud(atlas, taper=0.0, outer_radius=0.1)


def test_designs_of_the_same_atlas_built_elsewhere_belong(atlases, tmp_path):
    """Two machines may share the work in two folders and copy them together."""
    halves = [tmp_path / "0.zarr", tmp_path / "1.zarr"]
    for k, place in enumerate(halves):
        built(place, shard=(k, 2))
    both = written(only_files(halves[0]) | only_files(halves[1]), tmp_path / "both.zarr")
    assert only_files(both) == atlases["own"]
    assert verify_atlas(both).todo == 0


# ---------------------------------------------------------------- stores of earlier versions


def as_before(files: Files) -> Files:
    """A store as earlier versions wrote it, which listed no chunks."""
    kept = {name: text for name, text in files.items() if not name.startswith(f"{CHECKSUM}/")}
    root = json.loads(kept["zarr.json"])
    root["attributes"].pop(CHUNKS, None)
    root["attributes"][ARRAYS].pop(CHECKSUM, None)
    kept["zarr.json"] = sealed(json.dumps(root).encode())
    for name in [name for name in kept if name.endswith("/zarr.json")]:
        document = json.loads(kept[name])
        document["attributes"].pop(CHUNKS, None)
        kept[name] = json.dumps(document).encode()
        kept["zarr.json"] = listed(kept["zarr.json"], name.partition("/")[0], kept[name])
    assert DIGEST in json.loads(kept["zarr.json"])["attributes"]
    return kept


def test_an_earlier_cloud_opens_and_is_replaced(clouds, tmp_path):
    place = written(as_before(clouds["own"]), tmp_path / "a.zarr")
    assert sr.open_cloud(place).identical(cloud_of(0))
    sr.save_cloud(cloud_of(1), place)
    assert sr.open_cloud(place).identical(cloud_of(1))


def test_the_root_of_an_earlier_cloud_is_noticed_in_a_cloud_of_today(clouds, tmp_path):
    root = as_before(clouds["other"])["zarr.json"]
    place = written(clouds["own"] | {"zarr.json": root}, tmp_path / "a.zarr")
    assert isinstance(raised_by(lambda: sr.open_cloud(place)), DamagedStore)


def test_an_earlier_atlas_opens_goes_on_and_says_what_it_lacks(atlases, tmp_path):
    before = as_before(atlases["own"])
    place = written(before, tmp_path / "a.zarr")
    whole = open_atlas(written(atlases["own"], tmp_path / "today.zarr")).load()
    assert_same(open_atlas(place).load(), whole)
    with pytest.warns(SoftreachWarning, match="begun by an earlier version .* in a new folder"):
        assert verify_atlas(place).damaged == 0
    for name in (chunk("status", "0/0"), chunk("message", "1/0"), "unit_activation/c/0/0"):
        (place / name).unlink()
    built(place)
    assert only_files(place) == before


def test_other_activations_in_an_earlier_atlas_are_noticed_by_their_digest(atlases, tmp_path):
    own, other = as_before(atlases["own"]), as_before(atlases["other"])
    name = "unit_activation/c/0/0"
    place = written(own | {name: other[name]}, tmp_path / "a.zarr")
    with pytest.raises(DamagedStore, match=r"unit_activation in .* = with other activations"):
        _ = AtlasStore.open(place).cube
    built(place)
    assert only_files(place) == own


# ---------------------------------------------------------------- things of ones own in a store

OWN = ["thesis.tex", "tip/notes.txt", "tip/c/notes.txt", "mine/zarr.json", "mine/c/0/0", "mine/"]


def with_a_thing(place: Path, thing: str) -> Path:
    (place / thing).parent.mkdir(parents=True, exist_ok=True)
    if thing.endswith("/"):
        (place / thing).mkdir()
    else:
        (place / thing).write_text("precious")
    return place


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("thing", OWN)
@pytest.mark.parametrize("kind", ["cloud", "atlas"])
def test_a_store_with_a_thing_of_ones_own_is_never_replaced(
    clouds, atlases, tmp_path, kind, thing, overwrite
):
    files = clouds["own"] if kind == "cloud" else atlases["own"]
    place = with_a_thing(written(files, tmp_path / "a.zarr"), thing)
    before = files_in(place)
    error = raised_by(lambda: sr.save_cloud(cloud_of(1), place, overwrite=overwrite))
    assert "which is never replaced" in str(error)
    named = thing if thing.startswith("tip") else re.split("/", thing)[0]
    assert f"; {named} is not as softreach wrote it: move it away, or choose" in str(error)
    assert files_in(place) == before


def test_a_folder_with_a_root_of_another_program_is_never_replaced(clouds, tmp_path):
    """Nor one with a damaged root: nobody knows what is in it."""
    cloud = cloud_of(0)
    bare = cloud.drop_vars(["axis", "bundle"])
    bare.to_zarr(tmp_path / "own.zarr", zarr_format=3, consolidated=False)
    written(clouds["own"], tmp_path / "damaged.zarr", "zarr.json", lambda text: text[:-9])
    with_a_thing(tmp_path / "thesis.zarr", "thesis.tex")
    (tmp_path / "thesis.zarr/zarr.json").write_text("{}")
    before = files_in(tmp_path)
    for place in sorted(tmp_path.iterdir()):
        error = raised_by(lambda place=place: sr.save_cloud(cloud, place, overwrite=True))
        assert "; zarr.json is not as softreach wrote it: move it away" in str(error)
    assert files_in(tmp_path) == before


def test_an_atlas_gives_way_to_a_cloud_only_if_one_says_so(atlases, tmp_path):
    place = written(atlases["own"], tmp_path / "a.zarr")
    assert "something else is there" in str(raised_by(lambda: sr.save_cloud(cloud_of(0), place)))
    assert only_files(place) == atlases["own"]
    sr.save_cloud(cloud_of(0), place, overwrite=True)
    assert sr.open_cloud(place).identical(cloud_of(0))
