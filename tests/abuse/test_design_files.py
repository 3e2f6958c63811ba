"""Design files as nobody should write them: each loads, or is refused in a few clear lines."""

import math
import os
from pathlib import Path

import pytest

import softreach as sr
from tests.abuse.refusals import raised_by, refusal_of

TRUNK = sr.designs.minimal_trunk().to_toml()


@pytest.mark.parametrize("angle", [89.9, -89.9999])
def test_an_angle_that_winds_without_end_is_refused_before_a_step_is_made(angle):
    left, *others = sr.designs.minimal_trunk().actuators
    steep = left.replace(helical_angle=math.radians(angle))
    arm = sr.designs.minimal_trunk().replace(actuators=(steep, *others))
    for asked in (sr.describe, sr.compute_cloud, sr.reachable_set):
        assert "turns of left" in str(raised_by(lambda asked=asked: asked(arm)))


def test_many_small_actuators_are_counted_together():
    fiber = sr.FiberArchitecture(revolution=0.0, extent=0.01, bundles=60)
    arm = sr.designs.minimal_trunk()
    error = raised_by(lambda: arm.replace(actuators=(fiber, fiber.replace(name="b"))))
    assert "120 bundles" in str(error)


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
