"""Design files as nobody should write them: each loads, or is refused in a few clear lines."""

from __future__ import annotations

import math
import os
import re
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import softreach as sr
from softreach.arm.design_file.schema import json_schema
from softreach.support.errors import InvalidDesign, SoftreachError
from tests.abuse.refusals import raised_by, refusal_of

TRUNK = sr.designs.minimal_trunk().to_toml()
SOME = settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])


def with_value(key: str, value: str) -> str:
    """The design with another value for the first such key."""
    text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", TRUNK, count=1)
    assert count == 1
    return text


NUMBERS = [
    ("revolution_deg", "1e300", "<= 36000 deg"),
    ("revolution_deg", "-1e300", ">= -36000"),
    ("revolution_deg", "inf", "a finite number"),
    ("revolution_deg", "nan", "a finite number"),
    ("revolution_deg", "true", "number"),
    ("revolution_deg", '"108"', "number"),
    ("revolution_deg", "[108]", "number"),
    ("revolution_deg", "2026-01-01", "number"),
    ("helical_angle_deg", "90", "< 90 deg"),
    ("length_m", "0", "> 0"),
    ("length_m", "-1", "> 0"),
    ("extent_deg", "0", "> 0"),
    ("extent_deg", "361", "<= 360 deg"),
    ("taper_deg", "90", "< 90 deg"),
    ("taper_deg", "89", "leaves no tip"),
    ("inner_ratio", "1", "< 1"),
    ("inner_ratio", "-1e-300", ">= 0"),
    ("activation_bounds", "[-inf, 0]", "finite numbers"),
    ("activation_bounds", "[nan, 0]", "finite numbers"),
    ("activation_bounds", "[0, -1]", "lower <= upper"),
    ("activation_bounds", "[[0, 1], [0]]", "a pair"),
    ("activation_bounds", "[true, false]", "a pair"),
    ("activation_bounds", '"-1, 0"', "a pair"),
    ("kind", '"sausage"', "must be one of"),
    ("kind", "1", "must be one of"),
    ("version", "3", "must be 2"),
    ("version", "true", "must be 2"),
]


@pytest.mark.parametrize(("key", "value", "told"), NUMBERS, ids=lambda one: str(one)[:24])
def test_a_value_that_no_arm_can_have_is_refused_with_what_is_allowed(key, value, told):
    text = TRUNK if key != "helical_angle_deg" else TRUNK.replace("helical_angle_deg = 0.0", "")
    if key == "helical_angle_deg":
        text = with_value("revolution_deg", "0").replace(
            "revolution_deg = 0", f"{key} = {value}", 1
        )
    else:
        text = with_value(key, value)
    assert told in str(raised_by(lambda: sr.Manipulator.from_toml(text)))


@pytest.mark.parametrize("angle", [89.9, -89.9999])
def test_an_angle_that_winds_without_end_is_refused_before_a_step_is_made(angle):
    left, *others = sr.designs.minimal_trunk().actuators
    steep = left.replace(helical_angle=math.radians(angle))
    arm = sr.designs.minimal_trunk().replace(actuators=(steep, *others))
    for asked in (sr.describe, sr.compute_cloud, sr.reachable_set):
        assert "turns of left" in str(raised_by(lambda asked=asked: asked(arm)))


@pytest.mark.parametrize("bundles", ["101", "1000000", "1000000000000000000", "1.0", "0", "-1"])
def test_a_number_of_bundles_is_refused_before_any_is_made(bundles):
    text = with_value("offset_deg", f"66\nbundles = {bundles}")
    assert "bundles" in str(raised_by(lambda: sr.Manipulator.from_toml(text)))


def test_many_small_actuators_are_counted_together():
    fiber = sr.FiberArchitecture(revolution=0.0, extent=0.01, bundles=60)
    arm = sr.designs.minimal_trunk()
    error = raised_by(lambda: arm.replace(actuators=(fiber, fiber.replace(name="b"))))
    assert "120 bundles" in str(error)


TEXTS = {
    "nothing": "",
    "a comment": "# nothing",
    "10,000 actuators": TRUNK + "[[actuators]]\n" * 10_000,
    "a name of two lines": TRUNK.replace('"left"', '"a\\nb"'),
    "a lone surrogate": 'name = "\\ud800"',
    "JSON": '{"length_m": 1}',
    "YAML": "length_m: 1",
    "a table in place of a list": TRUNK.replace("[[actuators]]", "[actuators]", 1),
    "a list in place of a table": TRUNK.replace("[profile]", "[[profile]]"),
    "the profile twice": TRUNK + "\n[profile]\n",
    "nulls": "length_m = null",
    "a base of a matrix of text": TRUNK + '[base]\npoints = [["1", 0, 0]]\n',
    "a base of a thousand numbers": TRUNK + f"[base]\npoints = {[0.5] * 1000}\n",
    "a base that is no table": TRUNK + 'base = "down"\n',
    "a left-handed base": TRUNK + "[base]\npoints = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\n",
    "loads of text": TRUNK + '[loads]\ntip_force_n = ["1", 0, 0]\n',
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS.keys())
def test_a_text_that_is_no_design_is_refused_in_a_few_lines(text):
    with pytest.raises(SoftreachError) as caught:
        sr.Manipulator.from_toml(text)
    assert len(str(caught.value)) < 10_000
    assert all(len(line) < 800 for line in str(caught.value).splitlines())


FILES: dict[str, tuple[bytes, str]] = {
    "Latin-1": (TRUNK.replace("left", "lévogyre").encode("latin-1"), "text in UTF-8"),
    "UTF-16": (TRUNK.encode("utf-16"), "text in UTF-8"),
    "UTF-16 without a mark": (TRUNK.encode("utf-16-le"), "is NUL"),
    "UTF-32": (TRUNK.encode("utf-32"), "text in UTF-8"),
    "a NUL": (TRUNK.encode() + b"\0", "is NUL"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "text in UTF-8"),
    "50 MB": (b"# spaces\n" + b" " * 50_000_000, "at most 0.25 MB"),
    "a broken character": (TRUNK.encode() + b"# \xf0\x9f", "text in UTF-8"),
}


@pytest.mark.parametrize(("content", "told"), FILES.values(), ids=FILES.keys())
def test_a_file_that_is_no_text_is_refused(content, told, tmp_path):
    file = tmp_path / "arm.toml"
    file.write_bytes(content)
    assert told in str(raised_by(lambda: sr.Manipulator.load(file)))


@pytest.mark.parametrize("name", ["sparse", "folder", "pipe", "zero", "missing", "self"])
def test_what_is_no_file_is_refused_and_never_waited_for(name, tmp_path):
    path = tmp_path / "arm.toml"
    if name == "sparse":  # a terabyte that takes no room
        with path.open("wb") as stream:
            stream.truncate(10**12)
    elif name == "folder":
        path.mkdir()
    elif name == "pipe":
        os.mkfifo(path)
    elif name == "zero":
        path = Path("/dev/zero")
    elif name == "self":
        path.symlink_to(path)
    assert str(path) in str(raised_by(lambda: sr.Manipulator.load(path)))


@pytest.mark.parametrize("command", ["design", "volume", "studio"])
@pytest.mark.parametrize("name", ["arm.toml", "arm", "state.json", "STATE.JSON"])
def test_a_pipe_in_the_place_of_a_design_or_a_state_is_refused(name, command, tmp_path, capsys):
    os.mkfifo(path := tmp_path / name)
    said = refusal_of([command, str(path)], capsys, tmp_path)
    assert f"{path}: must be a file, not a folder, a pipe or a device" in said


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"], ids=["Unix", "Windows", "old Mac"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["", "marked"])
def test_lines_end_as_any_system_ends_them(ends, mark, tmp_path):
    file = tmp_path / "arm.toml"
    file.write_bytes(mark + ("# a trunk\n" + TRUNK).replace("\n", ends).encode())
    assert sr.Manipulator.load(file) == sr.designs.minimal_trunk()


def keys_of(schema: object) -> set[str]:
    """Every key that a design file may have."""
    if isinstance(schema, dict):
        found = set(schema.get("properties", {}))
        return found.union(*map(keys_of, schema.values())) if schema else found
    return set().union(*map(keys_of, schema)) if isinstance(schema, list) and schema else set()


KEYS = sorted(keys_of(json_schema()))
VALUES = st.recursive(
    st.one_of(
        st.floats(-1e6, 1e6) | st.sampled_from([math.nan, math.inf]),
        st.integers(-(10**6), 10**6),
        st.sampled_from([0, 1, -1.0, 90.0]),
        st.text(max_size=8),
        st.booleans(),
        st.sampled_from(["fiber", "tendon", "chamber", "linear", "sampled", "steel"]),
    ),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=3)
    ),
    max_leaves=8,
)


def toml(value: object) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        inside = "".join(f"\\U{ord(one):08x}" for one in value if not 0xD800 <= ord(one) < 0xE000)
        return f'"{inside}"'
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(one)}" for key, one in value.items()) + "}"
    return repr(value)


def loads_or_is_refused(text: str) -> None:
    """The design, which its own text gives again, or an InvalidDesign."""
    with suppress(InvalidDesign):
        arm = sr.Manipulator.from_toml(text)
        assert sr.Manipulator.from_toml(arm.to_toml()) == arm


@SOME
@given(st.data())
def test_a_design_with_any_value_in_one_place_loads_or_is_refused(data):
    lines = TRUNK.splitlines()
    places = [k for k, line in enumerate(lines) if " = " in line]
    place = data.draw(st.sampled_from(places))
    lines[place] = f"{lines[place].split(' = ')[0]} = {toml(data.draw(VALUES))}"
    loads_or_is_refused("\n".join(lines))
