"""Many tabs, tabs that are shaken, and tabs that are gone: without a browser, as sockets."""

import gc
import threading
import time
import weakref
from collections.abc import Iterator

import numpy as np
import pytest

import softreach.studio.app
import softreach.studio.reach as stages
from softreach.arm.parameters import changed
from softreach.inverse.prepared import prepared_map
from softreach.studio import Studio, work
from softreach.studio.jobs import Job
from softreach.studio.session import Session
from tests.studio.sockets import PATIENCE, connected, page, until


@pytest.fixture(scope="module")
def studio(studio) -> Iterator[Studio]:
    """A studio without the tab that all journeys share, which would be counted."""
    with Studio(studio.start) as running:
        yield running


@pytest.fixture(autouse=True)
def _short_rest(monkeypatch) -> None:
    monkeypatch.setattr(work, "LONG_REST", 0.5)  # its thread would be counted


def own_threads() -> int:
    """Threads other than those of viser's pool, which grows as events come together."""
    return sum(not thread.name.startswith("ThreadPool") for thread in threading.enumerate())


def shake(session: Session, times: int, pause: float = 0.0) -> None:
    """Move the sliders of a design and of its activation."""
    for k in range(times):
        taper = 0.01 + 0.02 * (k % 17) / 17
        session.update(
            lambda s, taper=taper: s.replace(design=changed(s.design, {"taper": taper})),
            by_widget=True,
        )
        time.sleep(pause)


def test_arm_and_axes_are_drawn_while_libraries_load_and_before_any_work(studio, monkeypatch):
    seen, drawn, loaded = [], threading.Event(), threading.Event()

    def compute(given):
        room = np.ptp(given.scene.axes.corners, axis=0).min() > 1.0  # a view is framed by it
        seen.append((room, loaded.is_set()))
        yield from ()

    def load():
        drawn.wait(PATIENCE)
        loaded.set()

    monkeypatch.setattr(softreach.studio.app, "JOBS", (Job("first", "design", compute),))
    monkeypatch.setattr(softreach.studio.app, "load_libraries", load)
    with Studio(studio.start) as other, connected(other):
        until(lambda: other.sessions)
        (session,) = other.sessions.values()
        find = session.client.scene.get_handle_by_name
        until(lambda: find("/arm/0") and find("/axes/lines"))
        drawn.set()
        until(lambda: seen)
    assert seen[0] == (True, True)


def test_a_tab_is_dark_where_its_system_is(studio):
    for dark in (True, False):
        with page(studio, f"softreach_dark={int(dark)}") as session:
            assert session.state.appearance.dark is dark


@pytest.mark.large
def test_memory_is_returned_once_a_tab_rests_and_nothing_stays_of_gone_ones(studio, monkeypatch):
    returned: list[int] = []
    monkeypatch.setattr(work, "return_memory", lambda: returned.append(len(studio.sessions)))
    with page(studio):
        pass  # what is made once
    until(lambda: not studio.sessions)
    before, gone = own_threads(), []
    for _ in range(2):
        with page(studio) as session:
            assert session.settle(PATIENCE)
            until(lambda: 1 in returned)
            gone.append(weakref.ref(session.found.reach.cloud))
            prepared = weakref.ref(prepared_map(session.state.design))
            del session
    until(lambda: not studio.sessions and own_threads() <= before)

    def clouds() -> int:
        gc.collect()
        return len({id(one()) for one in gone if one() is not None})

    until(lambda: clouds() <= 1)  # the one that all tabs begin with
    until(lambda: {0, 1} <= {*returned} and prepared() is None)


@pytest.mark.large
def test_a_shaken_tab_computes_its_last_place_and_lets_another_have_its_turn(studio, monkeypatch):
    computed = []
    plain = stages.compute_cloud
    monkeypatch.setattr(
        stages, "compute_cloud", lambda *a, **o: computed.append(a[0]) or plain(*a, **o)
    )
    with page(studio) as session, page(studio) as calm:
        computed.clear()
        threads = own_threads()
        shake(session, 40, 0.01)
        assert session.settle(PATIENCE)
        assert session.found.reach.arm == session.state.design
        assert computed[-1] == session.state.design
        assert len(computed) < 60  # each in two or three stages, of which the later are dropped
        assert len(session.history.past) < 50
        until(lambda: own_threads() <= threads)
        stop = threading.Event()

        def go_on() -> None:
            while not stop.is_set():
                shake(session, 1, 0.02)

        shaking = threading.Thread(target=go_on)
        shaking.start()
        try:
            calm.update(lambda s: s.replace(design=changed(s.design, {"taper": 0.021})))
            assert calm.settle(PATIENCE)  # while the other is still shaken
            assert calm.found.reach.arm == calm.state.design
        finally:
            stop.set()
            shaking.join(PATIENCE)
        assert session.settle(PATIENCE)


def test_a_tab_that_is_closed_before_it_is_furnished_leaves_no_session(studio, monkeypatch):
    go, furnish = threading.Event(), softreach.studio.app.furnish
    entered = threading.Event()

    def waits(*given):
        entered.set()
        assert go.wait(PATIENCE)
        furnish(*given)

    monkeypatch.setattr(softreach.studio.app, "furnish", waits)
    with connected(studio):
        assert entered.wait(PATIENCE)
    until(lambda: not studio.server.get_clients())
    go.set()
    until(lambda: not studio.sessions)
