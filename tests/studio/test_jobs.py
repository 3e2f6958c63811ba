"""What follows from a change of the state."""

import threading
from itertools import permutations

import numpy as np

from softreach.arm import Loads, designs
from softreach.arm.parameters import changed
from softreach.requirements import Requirements
from softreach.studio.found import Found, Known
from softreach.studio.jobs import Job, Learned, what_follows
from softreach.studio.reach import Reach
from softreach.studio.session import Session
from softreach.studio.state import Camera, Slice, StudioState
from softreach.studio.tabs import JOBS
from softreach.studio.work import Latest
from softreach.support.errors import InvalidInput
from tests.studio.sockets import page

NEEDS = Requirements(payloads=(0.0,)).to_toml()
NOTHING = Found()


def stale(old, new, before=NOTHING, after=NOTHING):
    """Names of the jobs that follow from a change."""
    given = None if old is None else Known(old, before)
    return {job.name for job in what_follows(JOBS, given, Known(new, after))}


def test_each_change_makes_stale_what_depends_on_it_and_is_shown_or_taken_away(trunk):
    bare, other = StudioState(design=trunk), changed(trunk, {"taper": 0.01})
    full = bare.replace(target=(0.1, 0.0, 0.8), reference=trunk, needs=NEEDS)
    full = full.showing(section=True, sweep="taper")
    shown = {"reach", "slopes", "cloud", "surface", "arm", "axes", "camera", "theme", "drag"}
    aimed = bare.replace(target=(0.1, 0.0, 0.8)).showing(section=True, surface=False)
    changes = [
        (None, bare, shown),  # a first state
        (None, aimed, shown - {"surface"} | {"inverse", "section"}),
        (bare, bare.replace(activation=(-1.0, 0.0, 0.0)), {"arm"}),
        (bare, bare.showing(color="multiplicity"), {"cloud", "surface"}),
        (bare, bare.showing(slice=Slice(axis="x")), {"cloud", "surface"}),
        (bare, bare.showing(surface=False), {"cloud", "surface"}),
        (bare, bare.showing(half=False), {"camera"}),
        (bare, bare.showing(dark=True), {"theme", "surface"}),
        (bare, bare.showing(unit="mm"), {"reach"}),
        (bare, bare.replace(needs=NEEDS), {"needs"}),
        (bare, bare.replace(reference=trunk), {"reference"}),
        (bare, bare.replace(design=other), {"reach", "slopes", "arm"}),
        (bare, bare.replace(camera=Camera(position=(1, 1, 1), look_at=(0, 0, 0))), set()),
        (full, full.replace(design=other), {"reach", "slopes", "arm", "inverse", "needs", "sweep"}),
        (full, full.showing(slice=Slice(axis="x")), {"cloud", "reference", "surface", "section"}),
        (full, full.showing(section=False, sweep=""), {"sweep", "section"}),
        (full, full.replace(target=None), {"inverse"}),
        (full, full.replace(reference=None, needs=""), {"reference", "needs"}),
    ]
    for old, new, jobs in changes:
        assert stale(old, new) == jobs
    for tip, other in permutations((np.zeros(3), np.ones(3), None), 2):  # None: no equilibrium
        assert stale(bare, bare, Found(tip=tip), Found(tip=other)) == {"camera"}
    reach = Found(reach=object.__new__(Reach))
    assert stale(full, full, NOTHING, reach) == {"axes", "surface", "slopes", "section"}
    assert stale(full, full, reach, reach) == set()


def test_the_cloud_without_loads_follows_the_design_but_not_its_loads(trunk):
    arm = designs.lce_arm()
    bare = StudioState(design=arm)
    light = bare.replace(design=arm.replace(loads=Loads()))
    heavy = bare.replace(design=arm.replace(loads=Loads(payload=0.001)))
    assert "free" in stale(bare, light)
    assert "free" not in stale(light, heavy)
    assert "free" in stale(heavy, bare)
    assert "free" not in stale(bare, bare.replace(design=trunk))


def test_a_job_that_fails_forgets_what_it_knew_and_takes_away_what_it_drew(studio):
    def compute(given):
        yield Learned({"check_refusal": "known"})
        if given.state.target is not None:
            raise InvalidInput("target", "wrong", "right")

    def draw(given):
        given.scene.dots("/mark", np.zeros((1, 3)), (0, 0, 0), 0.01)

    mark = Job("mark", "target", compute, draw, makes="check_refusal", draws="/mark")
    with page(studio) as tab:
        session = Session(tab.client, studio.start, [mark])
        session.begin()
        assert session.settle()
        drawn = session.client.scene.get_handle_by_name
        assert session.found.check_refusal == "known"
        assert drawn("/mark") is not None
        session.update(lambda state: state.replace(target=(0.0, 0.0, 0.5)))
        assert session.settle()
        assert session.found.check_refusal == ""
        assert drawn("/mark") is None
        assert "target = wrong" in session.note


# Laws of background work


def test_of_waiting_work_only_the_last_is_done_and_stale_work_ends_between_its_stages():
    done, coarse, go = [], threading.Event(), threading.Event()
    latest = Latest(done.append)

    def staged(check):
        done.append("coarse")
        coarse.set()
        go.wait(600)
        done.append("unchecked")
        check()
        done.append("fine")

    latest.submit(staged)
    assert coarse.wait(600)
    for name in ("second", "third", "fourth"):
        latest.submit(lambda check, name=name: done.append(name))
    go.set()
    assert latest.join(600)
    assert done == ["coarse", "unchecked", "fourth"]


def test_trouble_is_told_the_next_work_is_done_and_none_after_closing():
    told, done = [], []
    latest = Latest(told.append)
    for work in (lambda check: 1 / 0, lambda check: done.append("next")):
        latest.submit(work)
        assert latest.join(600)
    latest.close()
    latest.submit(lambda check: done.append("late"))
    assert latest.join(600)
    assert isinstance(told[0], ZeroDivisionError)
    assert done == ["next"]
