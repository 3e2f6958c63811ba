"""Laws of a search: what it finds, that it goes on, and that chance is in its seed alone."""

import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import Metric
from softreach.optimization.free_parameters import free_parameters
from softreach.requirements import Limits, Requirements, Target
from softreach.support.errors import InvalidInput

ARM = sr.designs.minimal_trunk(material=sr.Material(young_modulus=1e6, density=1000.0))
FREE = {"taper": (0.0, 0.05), "outer_radius": (0.06, 0.08), "revolution": (0.0, 1.8)}
NEEDS = Requirements(limits=Limits(mass=8.0, shortening=0.9))
FAST = dict(designs=16, accuracy=0.2, seed=1)


def heavy(**options):
    """The heaviest arm that is not too heavy."""
    return sr.search(ARM, FREE, NEEDS, maximize="mass", **{**FAST, **options})


@pytest.fixture(scope="module")
def alone():
    """That search on one thread, without interruption or company."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTREACH_NUM_THREADS", "1")
        return heavy()


def rows(search):
    return [(each.values, each.objectives, each.excess) for each in search.candidates]


def test_the_best_is_the_first_that_no_other_beats_and_meets_all(alone):
    assert alone.met
    assert alone.arm == alone.problem.parameters.arm(alone.best.values)
    assert sr.check(alone.arm, NEEDS, accuracy=0.2).met
    best = alone.best.objectives[0].value
    assert best == pytest.approx(8.0, rel=1e-3)
    assert best == pytest.approx(sr.describe(alone.arm).mass)
    assert best >= max(each.objectives[0].value for each in alone.candidates if each.is_feasible)
    assert alone.judged["bounds"] == sum(bool(each.missed) for each in alone.candidates) > 0
    assert all(each.fidelity == "full" for each in alone.finalists)
    ends = [each for each in alone.candidates if each.designs > 1 and each.is_feasible]
    near = [end for end in ends if abs(end.objectives[0].value / best - 1.0) <= 0.1]
    assert alone.restarts == (len(ends), len(near))
    assert f"how sure: {len(near)} of {len(ends)} restart" in repr(alone)


def test_the_same_seed_gives_the_same_designs_on_any_number_of_threads(alone, monkeypatch):
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "3")
    assert rows(heavy()) == rows(alone)
    assert rows(heavy(seed=2, designs=4, polish=False))[:4] != rows(alone)[:4]


KILLED = """
    import os, signal, sys
    from tests.optimization.test_search import heavy
    count = int(sys.argv[2])
    def follow(candidate):
        global count
        count -= 1
        if not count:
            os.kill(os.getpid(), signal.SIGKILL)
    heavy(storage=sys.argv[1], follow=follow)
"""


def started(storage, count):
    """A process with that search, killed after some new designs, if there are so many."""
    arguments = [str(storage), str(count)]
    return subprocess.Popen([sys.executable, "-c", textwrap.dedent(KILLED), *arguments])


@pytest.mark.parametrize("each", [12, pytest.param(1, marks=pytest.mark.large)])
def test_a_search_that_was_killed_ends_as_if_it_had_not_been(each, tmp_path, alone):
    storage, kills = tmp_path / "search.journal", 0
    while started(storage, each).wait() == -9:
        kills += 1
    assert kills >= 1
    seen = []
    search = heavy(storage=storage, follow=seen.append)
    assert seen == []
    assert rows(search) == rows(alone)
    assert (search.finalists, search.designs) == (alone.finalists, alone.designs)


@pytest.mark.large
def test_searches_of_other_seeds_share_a_storage_and_each_ends_with_the_best_of_all(tmp_path):
    few = dict(designs=6, polish=False, storage=tmp_path / "search.journal")
    alone = heavy(designs=6, polish=False)
    with ThreadPoolExecutor(2) as pool:
        *_, first = pool.map(lambda seed: heavy(**few, seed=seed), (2, 1))
    assert rows(first)[: len(rows(alone))] == rows(alone)
    both = heavy(**few)
    assert both.designs > alone.designs
    assert both.best.objectives[0].value >= alone.best.objectives[0].value
    again = heavy(**few, seed=2)
    assert sorted(map(str, rows(again))) == sorted(map(str, rows(both)))


def test_the_storage_of_another_search_is_refused(tmp_path):
    storage = tmp_path / "search.journal"
    heavy(storage=storage, designs=1, polish=False)
    with pytest.raises(InvalidInput, match=r"storage = .*belongs to another search: remove it"):
        sr.search(ARM, FREE, NEEDS, minimize="mass", storage=storage, **FAST)


FOREIGN = {
    "notes.txt": b"my notes\nof a year\n",
    "list.json": b"[1, 2]\n",
    "numbers": b'{"op_code": 0}\n',
    "optuna.journal": b'{"op_code":0,"worker_id":"a","study_name":"mine","directions":[1]}\n',
    "picture.db": b"\x89PNG\r\n\x1a\n",
}


def test_a_storage_that_softreach_did_not_write_stays_as_it_is(tmp_path):
    for name, content in FOREIGN.items():
        (tmp_path / name).write_bytes(content)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for place in before:
        with pytest.raises(InvalidInput, match="a new file, or that of a search: choose another"):
            heavy(storage=place)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_journal_whose_last_line_was_cut_off_goes_on(tmp_path):
    storage = tmp_path / "search.journal"
    whole = heavy(storage=storage, designs=2, polish=False)
    text = storage.read_bytes()
    start = text.rindex(b"\n", 0, -1) + 1
    for kept in (start + 1, (start + len(text)) // 2, len(text) - 1):
        storage.write_bytes(text[:kept])
        assert rows(heavy(storage=storage, designs=2, polish=False)) == rows(whole)


def test_without_an_objective_it_ends_with_the_first_design_that_meets_all():
    search = sr.search(ARM, FREE, Requirements(limits=Limits(mass=5.0)), designs=5000, accuracy=0.1)
    assert search.met
    assert search.designs < 500
    assert search.best.objectives == ()
    assert sr.describe(search.arm).mass <= 5.0


def test_what_no_design_reaches_is_proved_by_bounds_and_judged_in_full():
    far = Requirements(targets=(Target([[0, 0, 2.0]], name="moon"),), limits=Limits(mass=100.0))
    search = sr.search(ARM, FREE, far, minimize="mass", polish=False, designs=4, accuracy=0.2)
    assert not search.met
    assert search.judged["bounds"] == len(search.candidates)
    assert search.best.fidelity == "full"  # what bounds prove is less than what is missed
    assert search.best.excess == sr.check(search.arm, far, accuracy=0.2).excess
    assert "MISSED  moon: 0 of 1 place reached" in repr(search)


def test_bounds_discard_designs_and_the_best_misses_least_of_all_judged_in_full():
    """A bound of 0.04 is no better than a design that misses 0.058."""
    needs = Requirements(targets=(Target([[0.0, 0.75, 0.75]], within=1e-3),))
    free = {"length": (0.6, 1.1)}
    search = sr.search(ARM, free, needs, minimize="mass", designs=8, polish=False, accuracy=0.2)
    assert search.judged["bounds"] > 0
    arms = [search.problem.parameters.arm(each.values) for each in search.candidates]
    assert search.best.excess == min(sr.check(arm, needs, accuracy=0.2).excess for arm in arms)


def test_ties_follow_what_they_are_tied_to():
    ties = {"right.offset": "-1*left.offset + 90deg", "left.offset": (0.0, 1.0)}
    parameters = free_parameters(ARM, ties)
    arm = parameters.arm({"left.offset": 0.3})
    offsets = [one.offset for one in arm.actuators[:2]]
    assert offsets == pytest.approx([0.3, np.pi / 2 - 0.3])


def test_choices_and_integers_are_among_those_allowed():
    choices = {"bundles": [2, 3], "material": ["ecoflex_00_30", "spring_steel"]}
    options = {"minimize": "mass", "designs": 16, "accuracy": 0.1}
    search = sr.search(ARM, {"taper": (0.0, 0.02)}, choices=choices, **options)
    assert {each.values["bundles"] for each in search.candidates} == {2, 3}
    assert search.best.values["material"] == "ecoflex_00_30"
    assert len(search.arm.actuators) == search.best.values["bundles"]
    table = search.to_dataset()
    row = table.sel(parameter="material")
    assert str(row.choices.values) == "ecoflex_00_30, spring_steel"
    assert float(row.value[table.front.values].max()) == 0.0


def test_designs_by_name_are_chosen_among():
    long = sr.designs.minimal_trunk(length=1.5, material=ARM.section.rings[0].material)
    designs = {"long": long, "short": ARM}
    search = sr.search(designs, {"taper": (0.0, 0.02)}, minimize="mass", **FAST)
    assert search.best.values["design"] == "short"


def test_an_objective_that_no_design_has_is_said_in_one_line():
    about = {"name": "hope", "unit": "1", "meaning": "no number", "needs": ()}
    nothing = Metric(**about, compute=lambda: float("nan"))
    search = sr.search(ARM, FREE, maximize=nothing, polish=False, **FAST)
    assert not search.met
    assert "hope = nan: must be finite" in repr(search)
    assert repr(search).startswith("Search: no design that can be judged was found")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (dict(free={"taper": (0.0, 9.0)}), "in its range"),
        (dict(free={**FREE, "left.offset": "offset"}), "another free parameter"),
        (dict(free={}), "one parameter or more"),
        (dict(free=FREE, maximize="coverage"), "the requirements have no regions"),
        (dict(free=FREE, maximize="mass", minimize="mass"), "given once"),
        (dict(free=FREE, designs=0), "whole number"),
        (dict(free=FREE, sampler="luck"), "one of auto, cma"),
        (dict(free=FREE, storage="."), "a file in a folder that exists"),
    ],
)
def test_what_cannot_be_searched_is_refused_in_one_line(arguments, said):
    free = arguments.pop("free")
    with pytest.raises(InvalidInput, match=said) as error:
        sr.search(ARM, free, **arguments)
    assert "\n" not in str(error.value)
