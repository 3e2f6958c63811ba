"""Compilation is noticed while it lasts."""

from __future__ import annotations

from numba import njit

from softreach.studio.work import CompilationWatch


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
