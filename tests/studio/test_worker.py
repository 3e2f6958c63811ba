"""Laws of background work."""

from __future__ import annotations

import threading

from softreach.studio.work import Latest


def test_of_waiting_work_only_the_last_is_done():
    done, started, go = [], threading.Event(), threading.Event()
    latest = Latest(done.append)

    def first(check):
        started.set()
        go.wait(600)
        done.append("first")

    latest.submit(first)
    assert started.wait(600)
    for name in ("second", "third", "fourth"):
        latest.submit(lambda check, name=name: done.append(name))
    go.set()
    assert latest.join(600)
    assert done == ["first", "fourth"]


def test_stale_work_is_dropped_between_its_stages():
    done, coarse, go = [], threading.Event(), threading.Event()
    latest = Latest(done.append)

    def staged(check):
        done.append("coarse")
        coarse.set()
        go.wait(600)
        check()
        done.append("fine")

    latest.submit(staged)
    assert coarse.wait(600)
    latest.submit(lambda check: done.append("newer"))
    go.set()
    assert latest.join(600)
    assert done == ["coarse", "newer"]


def test_trouble_is_told_and_the_next_work_is_done():
    told, done = [], []
    latest = Latest(told.append)
    latest.submit(lambda check: 1 / 0)
    assert latest.join(600)
    latest.submit(lambda check: done.append("next"))
    assert latest.join(600)
    assert isinstance(told[0], ZeroDivisionError)
    assert done == ["next"]


def test_a_closed_worker_does_nothing_more():
    done = []
    latest = Latest(done.append)
    latest.close()
    latest.submit(lambda check: done.append("late"))
    assert latest.join(600)
    assert done == []
