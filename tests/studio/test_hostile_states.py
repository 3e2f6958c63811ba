"""Files that no studio saved are refused in one line, at once."""

from __future__ import annotations

import json

import pytest

from softreach.arm import designs
from softreach.studio import StudioState
from softreach.studio.files import state_from
from softreach.studio.start import start_on_state
from softreach.support.errors import SoftreachError

STATE = StudioState(design=designs.minimal_trunk())


def state_with(**changes):
    return json.dumps(json.loads(STATE.to_json()) | changes)


def look_with(**changes):
    return state_with(appearance=json.loads(STATE.to_json())["appearance"] | changes)


def design_with(old, new):
    text = designs.minimal_trunk().to_toml()
    assert old in text
    return text.replace(old, new)


HOSTILE = {
    "many bundles.toml": design_with(
        'name = "longitudinal"', 'name = "longitudinal"\nbundles = 1000000'
    ),
    "nested.json": "[" * 100_000,
    "50 MB.json": " " * 50_000_000,
    "mouse.json": look_with(mouse=["tip"]),
    "huge level.json": look_with(level=10**4000),
    "digits.json": '{"softreach_studio": 2, "activation": ' + "9" * 5000 + "}",
    "infinite activation.json": state_with(activation=[float("inf")] * 3),
    "huge target.json": state_with(target=[10**400, 0, 0]),
    "camera.json": state_with(camera={"position": [1, 2, 3]}),
    "needs.json": state_with(needs="[[reach]]"),
    "needs of a file.json": state_with(needs='[[reach]]\nfile = "/etc/passwd"'),
    "needs of a mesh.json": state_with(needs='[[avoid]]\nmesh = "/etc/passwd"'),
    "many places.json": state_with(needs=f"[[reach]]\nplaces_m = {[[0, 0, 1]] * 301}"),
    "null.json": "null",
    "bytes.json": "\x00\x01",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_refused_in_a_few_words(name):
    with pytest.raises(SoftreachError) as caught:
        state_from(name, HOSTILE[name].encode(), STATE)
    assert len(str(caught.value)) < 6000
    assert "Traceback" not in str(caught.value)


def test_a_large_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "state.json"
    with path.open("wb") as file:
        file.truncate(50_000_000)
    with pytest.raises(SoftreachError, match=r"state\.json: must be at most 2 MB"):
        start_on_state(path)
