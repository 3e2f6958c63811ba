"""What a computation of the studio may use."""

from __future__ import annotations

import time

import pytest

from softreach.arm.parameters import changed
from softreach.studio import reach as stages
from softreach.studio import work as budget
from softreach.studio.reach import Quality
from softreach.studio.work import Budget, Dropped, OverBudget, all_cores, level_in_memory

SMALL = Quality(coarse_level=10, fine_level=12, coarse_accuracy=0.1, fine_accuracy=0.05)


def nothing() -> None:
    """Everything is wanted."""


def test_a_computation_ends_when_its_time_is_over():
    spent = Budget(nothing, 0.0)
    time.sleep(0.01)
    with pytest.raises(OverBudget, match="more than 0 s"):
        spent()


def test_a_computation_ends_when_memory_runs_out_meanwhile(monkeypatch):
    monkeypatch.setattr(budget, "free_memory", lambda: 10e9)
    running = Budget(nothing, 60.0)
    assert running.memory < 5e9
    running()
    monkeypatch.setattr(budget, "free_memory", lambda: 1e9)
    time.sleep(0.25)
    with pytest.raises(OverBudget, match="memory"):
        running()


def test_what_nobody_wants_ends_before_its_budget_does():
    def check():
        raise Dropped

    with pytest.raises(Dropped):
        Budget(check, 0.0)()


def test_clouds_fit_into_memory_however_many_bundles_there_are():
    for bundles in (3, 30, 1000):
        level = level_in_memory(bundles, 1e9, 21)
        assert level == 21 or (1 << level) * 8 * (bundles + 3) <= 1e9
    assert level_in_memory(3, 0.0, 17) == 10


def test_a_smaller_cloud_says_what_it_left_out(trunk, monkeypatch):
    monkeypatch.setattr(budget, "free_memory", lambda: 1e6)
    *_, fine = stages.stages(trunk, 12, SMALL, nothing)
    assert fine.samples < fine.wanted == 1 << 12
    assert "1,024 of 4,096 samples" in fine.notes[0]


def test_a_set_without_time_keeps_what_was_known_or_says_why_there_is_none(trunk, monkeypatch):
    exact, calls = stages.reachable_set, []

    def only_once(*given, **options):
        calls.append(options["accuracy"])
        if len(calls) > 1:
            raise OverBudget("more than 30 s")
        return exact(*given, **options)

    monkeypatch.setattr(stages, "reachable_set", only_once)
    coarse, fine = stages.stages(trunk, 12, SMALL, nothing)
    assert fine.exact is coarse.exact is not None
    assert fine.notes == ("exact set coarser than asked: to 5 % it needs more than 30 s",)
    *_, none = stages.stages(trunk, 12, SMALL, nothing)
    assert none.exact is None
    assert none.refusal == "to 5 % it needs more than 30 s"


def test_five_bundles_show_a_cloud_before_their_set_within_the_memory_they_are_given(
    trunk, monkeypatch
):
    exact, given = stages.reachable_set, []

    def noted(*arguments, **options):
        given.append(options["memory"])
        return exact(*arguments, **options)

    monkeypatch.setattr(stages, "reachable_set", noted)
    monkeypatch.setattr(budget, "free_memory", lambda: 2e9)
    arm = changed(trunk, {"longitudinal.bundles": 3})
    first, coarse, fine = stages.stages(arm, 12, SMALL, nothing)
    assert first.exact is None
    assert coarse.volume == pytest.approx(fine.volume, rel=0.1)
    assert set(given) == {0.2 * 2e9}


def test_no_stage_keeps_the_turn_while_its_reach_is_drawn(trunk):
    for arm in (trunk, changed(trunk, {"longitudinal.bundles": 2})):
        for _ in stages.stages(arm, 10, SMALL, nothing):
            assert not all_cores.taken
