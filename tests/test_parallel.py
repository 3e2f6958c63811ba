"""Tasks on threads: their order, how many there are, and what they raise."""

import threading
import time
from functools import partial

import pytest

from softreach.support import parallel


@pytest.fixture(params=["1", "3"], autouse=True)
def threads(request, monkeypatch):
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", request.param)
    return int(request.param)


def test_results_come_in_the_order_of_their_tasks():
    def late(number):
        time.sleep(0.002 * (number % 3 == 0))
        return number

    assert list(parallel.in_order(partial(late, k) for k in range(20))) == list(range(20))


def test_no_more_tasks_run_at_a_time_than_there_are_threads(threads):
    running, most, lock = 0, 0, threading.Lock()

    def task():
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        time.sleep(0.001)
        with lock:
            running -= 1

    list(parallel.in_order(task for _ in range(20)))
    assert 1 <= most <= threads


def test_what_a_task_raises_arrives_in_its_place():
    def broken():
        raise ValueError("broken")

    results = parallel.in_order([lambda: 1, broken, lambda: 3])
    assert next(results) == 1
    with pytest.raises(ValueError, match="broken"):
        next(results)


def test_what_is_done_meanwhile_is_done_once_and_raises_where_it_is_asked_for():
    calls = []
    with parallel.meanwhile(lambda: calls.append(1) or "found") as found:
        assert found() == found() == "found"
    assert calls == [1]
    with parallel.meanwhile(lambda: 1 / 0) as found, pytest.raises(ZeroDivisionError):
        found()


def test_what_is_interrupted_is_given_up_on_every_level(threads):
    begun = []

    raised = threading.Event()

    def inner(number):
        begun.append(number)
        raised.wait()
        time.sleep(0.02)

    def outer(first):
        parallel.run(partial(inner, number) for number in range(first, first + 100))

    def interrupted():
        raised.set()
        raise KeyboardInterrupt

    tasks = [interrupted, *(partial(outer, 100 * k) for k in range(4))]
    with pytest.raises(KeyboardInterrupt):
        parallel.run(tasks)
    assert len(begun) < 400


def test_a_task_that_is_given_up_is_no_failure_of_its_own():
    seen = []

    def task():
        try:
            parallel.run(partial(time.sleep, 0.01) for _ in range(100))
        except Exception as error:
            seen.append(error)

    def broken():
        time.sleep(0.03)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        parallel.run([task, broken])
    assert seen == []


def test_work_that_is_undivided_stays_on_its_thread_while_others_divide_theirs():
    where: list[int] = []
    tasks = [lambda: where.append(threading.get_ident())] * 5
    with parallel.undivided():
        parallel.run(tasks)
        other = threading.Thread(target=parallel.run, args=(tasks,))
        other.start()
        other.join()
    assert where[:5] == [threading.get_ident()] * 5
    assert threading.get_ident() not in where[5:]
    assert len(where) == 10
