"""Compilation is noticed while it lasts."""

from __future__ import annotations

import os
import sys

import pytest
from numba import njit

from softreach.studio.work import CompilationWatch, IdleCompiler


def test_compilation_is_told_when_it_begins_and_when_all_of_it_has_ended():
    told = []
    watch = CompilationWatch(told.append)
    inner = njit(lambda x: x + 1)
    outer = njit(lambda x: 2 * inner(x))
    assert outer(1) == 4
    assert told == [True, False]
    assert outer(2) == 6
    assert told == [True, False]  # compiled already
    assert watch.done == 1
    watch.close()
    outer(1.5)
    assert told == [True, False]


@pytest.mark.skipif(sys.platform == "win32", reason="priorities are others")
def test_what_is_compiled_ahead_waits_for_all_others_and_ends_with_the_studio():
    compiler = IdleCompiler()
    compiler.close()
    compiler.start()
    assert compiler._process is None
    compiler = IdleCompiler()
    compiler.start()
    process = compiler._process
    compiler.start()
    assert compiler._process is process
    assert os.getpriority(os.PRIO_PROCESS, process.pid) == 19
    compiler.close()
    assert process.returncode is not None
