"""Whatever a terminal can show, and whether or not there is one, a command says what it has to."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from softreach.cli.app import run
from softreach.cli.console import console
from softreach.support import progress


@pytest.fixture
def streams(monkeypatch):
    """Standard output and error of an encoding that refuses what it does not have."""

    def of(encoding: str, out: io.RawIOBase | None = None):
        made = [
            io.TextIOWrapper(io.BytesIO() if raw is None else io.BufferedWriter(raw), encoding)
            for raw in (out, None)
        ]
        monkeypatch.setattr(sys, "stdout", made[0])
        monkeypatch.setattr(sys, "stderr", made[1])
        return made

    return of


def printed(stream: io.TextIOWrapper) -> str:
    stream.flush()
    return stream.buffer.getvalue().decode(stream.encoding)


SAID = {
    "--help": "softreach reach minimal_trunk",
    "volume --help": "-shape radius: 0.05L",
    "design minimal_trunk": "-1.667 to 0",
    "design σ.toml": ".toml: must be",
}


@pytest.mark.parametrize("encoding", ["ascii", "cp437", "utf-8"])
@pytest.mark.parametrize("words", SAID)
def test_every_encoding_can_show_what_is_said(words, encoding, streams):
    out, err = streams(encoding)
    assert run(words.split()) == (2 if "σ" in words else 0)
    assert SAID[words] in printed(out) + printed(err)


def test_letters_that_cannot_be_shown_are_escaped(streams):
    out, _ = streams("latin-1")
    with console.listening():
        console.line("L³ ± é γ")
        console.line(os.fsdecode(b"caf\xe9.toml"))
    assert printed(out) == "L³ ± é \\u03b3\ncaf\\udce9.toml\n"


class Gone(io.RawIOBase):
    gone = True

    def writable(self):
        return True

    def write(self, data):
        if self.gone:
            raise BrokenPipeError
        return len(data)


@pytest.mark.parametrize("arguments", [["list", "designs"], ["design", "minimal_trunk"]])
def test_a_reader_that_has_gone_ends_a_command_without_a_word(arguments, streams):
    out, err = streams("utf-8", pipe := Gone())
    assert run(arguments) == 141
    assert "rror" not in printed(err)
    pipe.gone = False
    out.close()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full on this system")
@pytest.mark.parametrize("arguments", [["--help"], ["list", "designs"], ["--version"]])
def test_results_that_cannot_be_written_are_an_error(arguments, streams):
    out, err = streams("utf-8", io.FileIO("/dev/full", "w"))
    assert run(arguments) == 2
    out.close()
    assert "No space left on device" in printed(err)
    assert printed(err).count("\n") == 1


@pytest.mark.parametrize("width", ["1", "200", "-3", "wide"])
@pytest.mark.parametrize(
    ("words", "said"), [("--help", "softreachreachminimal_trunk"), ("cloud --help", "--sampler")]
)
def test_help_is_whole_on_terminals_of_every_width(words, said, width, streams, monkeypatch):
    monkeypatch.setenv("COLUMNS", width)
    out, _ = streams("ascii")
    assert run(words.split()) == 0
    assert said in "".join(printed(out).split())


def test_a_backend_that_does_not_exist_is_named():
    command = [sys.executable, "-c", "from softreach.plot.style import pyplot; pyplot()"]
    environment = os.environ | {"MPLBACKEND": "nonsense"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert "InvalidInput: MPLBACKEND = nonsense" in done.stderr


START = f"{sys.executable} -m softreach"


@pytest.mark.parametrize(
    ("line", "code", "error"),
    [
        (f"{START} --help | head -1", 0, ""),
        (f"{START} --help 2>&-", 0, ""),
        (f"{START} design nowhere.toml 2>&-", 2, ""),
        (f"{START} design nowhere.toml 2>/dev/full", 2, ""),
        (f"{START} --help >/dev/full", 2, "No space left on device"),
        (f"LC_ALL=C PYTHONUTF8=0 PYTHONCOERCECLOCALE=0 {START} --help", 0, ""),
    ],
)
def test_processes_end_as_they_should(line, code, error, tmp_path):
    command = ["bash", "-c", f"set -o pipefail; {line}" if "|" not in line else line]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == code
    assert "Traceback" not in done.stderr
    assert error in done.stderr
    if not error:
        assert not [one for one in done.stderr.splitlines() if not one.startswith("softreach: ")]


def test_progress_in_a_pipe_is_a_line_now_and_then_and_none_if_quiet(capsys, monkeypatch):
    clock = iter([0.0, 10.0, 31.0, 40.0, 70.0, 125.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.bar("computing designs", 2_000) as done:
        for _ in range(5):
            done(300)
    first, _, last = capsys.readouterr().err.splitlines()
    assert first == "computing designs: 600 of 2,000, 0:31 so far"
    assert last == "computing designs: 1,500 of 2,000, 2:05 so far"
    monkeypatch.setattr(progress, "hidden", True)
    with progress.bar("computing designs", 2_000) as done:
        done(300)
    assert capsys.readouterr().err == ""


def test_a_shell_learns_to_complete_commands(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run(["--install-completion", "--shell", "bash"]) == 0
    (script,) = (path for path in tmp_path.rglob("*") if path.is_file())
    assert str(script) in capsys.readouterr().out
    assert "--accuracy" in script.read_text(encoding="utf-8")
