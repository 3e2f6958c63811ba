"""What every refusal has in common: one clear line, and nothing lost."""

from collections.abc import Callable
from pathlib import Path

import pytest

from softreach.cli.app import run
from softreach.support.errors import SoftreachError

__all__ = ["files_in", "raised_by", "refusal_of"]


def files_in(folder: Path) -> dict[str, bytes | None]:
    """Every file below the folder with what it holds, and the folders, but Python's bytecode."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
        if "__pycache__" not in path.parts
    }


def refusal_of(arguments: list[str], capsys: pytest.CaptureFixture[str], folder: Path) -> str:
    """The one line that a command answers, which must leave `folder` as it was."""
    before = files_in(folder)
    capsys.readouterr()
    code = run(arguments)
    printed = capsys.readouterr()
    assert code == 2, f"exit code {code}: {printed.out} {printed.err}"
    assert printed.out == ""
    assert "Traceback" not in printed.err
    assert printed.err.count("\n") == 1, printed.err
    assert len(printed.err) < 1_000
    assert files_in(folder) == before
    return printed.err


def raised_by(call: Callable[[], object]) -> SoftreachError:
    """The error of a call in Python, which must be one that softreach raises on purpose."""
    with pytest.raises(SoftreachError) as caught:
        call()
    assert len(str(caught.value)) < 1_000
    return caught.value
