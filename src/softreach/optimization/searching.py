"""Search for the best designs: spread, polish, sample where it pays, judge the best again."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.atlas.metrics import Metric
from softreach.optimization.free_parameters import free_parameters
from softreach.optimization.polish import MOST_DESIGNS, can_polish, polished
from softreach.optimization.problem import SETS, Candidate, Problem, goals
from softreach.optimization.result import Search
from softreach.optimization.study import Sampler, Study
from softreach.requirements.requirements import Requirements
from softreach.support import parallel
from softreach.support.arguments import as_flag, as_function, as_instance, as_integer, as_number
from softreach.support.arrays import Array
from softreach.support.progress import Progress, as_progress
from softreach.workspace.reach import ACCURACIES

_BATCH = 4  # designs asked together, whatever the number of threads, so that this changes nothing
_COARSER = 10.0  # times the accuracy, on the way
_COARSEST = 0.03
_FIRST_SHARE = 0.25  # of all designs, before anything is known
_ROUND_SHARE = 0.15  # of all designs, between polishes
_POLISHES = 4  # side by side
_DESIGNS_OF_POLISH = 30  # at most, as a rule
_LEAST_OF_POLISH = 4  # designs, with which one begins
_LAST_SHARE, _MOST_LAST = 0.2, 20  # of all designs, kept for the polish to full accuracy
_APART = 0.08  # of the ranges, in the mean: designs nearer to each other lead to the same end
_LAST = 3  # designs that are judged to full accuracy
_FRONTS = 12  # of designs that polishes of several objectives begin with


def search(
    base: Manipulator | Mapping[str, Manipulator],
    free: Mapping[str, Any],
    requirements: Requirements | None = None,
    *,
    maximize: str | Metric | Sequence[str | Metric] = (),
    minimize: str | Metric | Sequence[str | Metric] = (),
    choices: Mapping[str, Sequence[Any]] | None = None,
    designs: int = 200,
    accuracy: float = 3e-3,
    polish: bool = True,
    sampler: Sampler = "auto",
    seed: int = 0,
    storage: str | PathLike[str] | None = None,
    follow: Callable[[Candidate], object] | None = None,
    progress: Progress | None = None,
) -> Search:
    """The designs that meet requirements and are best in one objective or in several.

    A design is judged by bounds first, which prove in a millisecond what it cannot do, then on
    coarse sets. The first quarter is spread evenly over all ranges and choices; the best are
    polished by quadratic programs on exact derivatives, in which the poses at the targets move
    along; then a sampler of Optuna (CMA-ES for numbers, TPE where there are choices, NSGA-II for
    several objectives) looks where it pays, and the best of what it finds are polished again. What
    is reported was computed again to full accuracy, the best polished there once more.

    Args:
        base: The design to vary, or several by name, one of which is chosen.
        free: Parameter -> range (low, high) in its SI unit, or text that ties it to a free one:
            `{"left.revolution": (-3.1, 3.1), "right.revolution": "-left.revolution"}`. Names as
            `arm.parameters` has them.
        requirements: What every design must meet; None for nothing.
        maximize: Objectives to make large: names of `OBJECTIVES`, or metrics of the atlas.
        minimize: Objectives to make small. Without any objective the search is for a design that
            meets the requirements, and ends with the first.
        choices: Parameter -> values to choose from; `bundles` -> numbers of copies of the first
            actuator; `material` -> names of materials.
        designs: Number of designs that are looked at, with those of polishes.
        accuracy: Relative error of the volumes that are reported.
        polish: Whether designs are polished, where objectives have derivatives.
        sampler: Of Optuna: "cma", "tpe", "nsga2", "nsga3", "sobol", "random"; "auto" chooses.
        seed: Of the first designs and of the sampler; the number of threads changes no result.
        storage: Journal in which every design is kept: the same call goes on where it was
            interrupted, and ends as if it had not been. Searches of other seeds may share it, and
            each ends with the best of all.
        follow: Called with each `Candidate` that was judged in this call.
        progress: Called with the number of designs since its last call.

    Returns:
        The best designs, the front of several objectives, and everything that was judged.

    Raises:
        InvalidInput: An argument out of range, an unknown parameter or objective, or a storage that
            cannot be used or belongs to another search.
        MissingExtra: Optuna is not installed.

    Examples:
        >>> arm, free = sr.designs.minimal_trunk(), {"taper": (0.0, 0.05)}
        >>> found = sr.search(arm, free, maximize="exact_volume", designs=4, accuracy=0.1)
        >>> print(f"taper of {found.best.values['taper']:.3f} rad")
        taper of 0.028 rad
    """
    needs = Requirements() if requirements is None else requirements
    as_instance("requirements", needs, Requirements, "Requirements")
    accuracy = as_number("accuracy", accuracy, ACCURACIES)
    targets = goals(maximize, minimize, needs)
    parameters = free_parameters(base, free, choices)
    errors = {"accuracy": accuracy, "coarse": min(_COARSER * accuracy, max(accuracy, _COARSEST))}
    problem = Problem(parameters=parameters, requirements=needs, goals=targets, **errors)
    seed = as_integer("seed", seed, 0, 2**31)
    designs = as_integer("designs", designs, 1, 1_000_000)
    first = max(min(designs, 4 * len(problem.parameters)), int(_FIRST_SHARE * designs))
    follow = (lambda _: None) if follow is None else as_function("follow", follow)
    study = Study(problem, storage=storage, sampler=sampler, seed=seed, first=first)
    polishes = as_flag("polish", polish) and can_polish(problem)
    asked = {*needs.measures, *(goal.name for goal in targets)}
    by_sets = bool(needs.regions) or not asked.isdisjoint(SETS)  # what is best depends on accuracy
    last = polishes and (len(targets) > 1 or by_sets)
    kept = min(_MOST_LAST, int(_LAST_SHARE * designs)) if last else 0
    run = _Run(problem, study, designs, kept, polishes, follow, as_progress(progress))
    return run.result(first)


@dataclass(eq=False)
class _Run:
    problem: Problem
    _study: Study
    _designs: int
    _kept: int  # designs, for the polish to full accuracy
    _polishes: bool
    _follow: Callable[[Candidate], object]
    _progress: Progress
    _spent: int = 0
    _begun: float = field(default_factory=time.perf_counter)
    _starts: list[Array] = field(default_factory=list)

    def result(self, first: int) -> Search:
        """Search until the designs are spent, the first of them spread; judge the best again."""
        study = self._study
        while (left := first - len(study.candidates)) > 0 and not self._is_over:
            self._sample(min(left, _BATCH))
        study.focus()
        while not self._is_over:
            self._polish()
            if not self._is_over:
                self._sample(min(max(_BATCH, int(_ROUND_SHARE * self._designs)), self._left))
        others = study.others()
        every = [*study.candidates, *others]
        finalists = self._at_full_accuracy(every)
        found: Any = {
            "front": tuple(self.problem.front(finalists)),
            "finalists": tuple(finalists),
            "candidates": tuple(every),
            "seed": study.seed,
            "sampler": study.kind,
        }
        spent, seconds = sum(each.designs for each in others), time.perf_counter() - self._begun
        spent += self._spent
        return Search(problem=self.problem, designs=spent, seconds=seconds, **found)

    @property
    def _left(self) -> int:
        """Designs that are left, but for the polish to full accuracy."""
        return self._designs - self._kept - self._spent

    @property
    def _is_over(self) -> bool:
        is_met = any(each.is_feasible for each in self._study.candidates)
        return self._left <= 0 or (is_met and not self.problem.goals)

    def _sample(self, count: int) -> None:
        while count > 0:
            trials = self._study.ask(min(_BATCH, count))
            count -= len(trials)
            ask, judge = self._study.judged, self._judged
            tasks = (partial(ask, ["design", each], partial(judge, each)) for _, each in trials)
            for (trial, _), judged in zip(trials, parallel.in_order(tasks), strict=True):
                self._note(*judged, trial)

    def _judged(self, values: Any, *, bounds: bool = True) -> Candidate:
        with parallel.undivided():
            return self.problem.judge(values, bounds=bounds)

    def _polish(self) -> None:
        if not self._polishes or self._left < _LEAST_OF_POLISH:
            return
        room = max(1, self._left // _DESIGNS_OF_POLISH)
        starts = self._chosen(self._study.candidates, min(_POLISHES, room))
        most = min(MOST_DESIGNS, self._left // max(1, len(starts)))
        tasks = []
        for k, start in enumerate(starts):
            turn = self._turn(start, k)
            what = ["polish", dict(start.values), most, *turn]
            make = partial(polished, self.problem, start, most, turn, self.problem.coarse)
            tasks.append(partial(self._study.judged, what, make))
        for candidate, is_new in parallel.in_order(tasks):
            if candidate.designs:
                self._note(candidate, is_new)
                self._starts.append(self._place(candidate))

    def _turn(self, start: Candidate, k: int = 0) -> tuple[int, tuple[float, ...]]:
        """The goal of the next polish but k, in turn, and what all others must stay as good as."""
        goals = self.problem.goals
        if len(goals) < 2:
            return 0, ()
        moving = [k for k, goal in enumerate(goals) if goal.name != "actuators"]
        goal = (moving or [0])[(len(self._starts) + k) % max(1, len(moving))]
        return goal, self.problem.costs(start) if start.is_feasible else ()

    def _chosen(self, candidates: Sequence[Candidate], count: int) -> list[Candidate]:
        judged = [each for each in candidates if each.fidelity != "bounds"]
        ordered = sorted(judged, key=self.problem.score)
        if len(self.problem.goals) > 1:  # the front, that of the others, and so on
            ordered = []
            for _ in range(_FRONTS):
                ordered += (front := self.problem.front(judged))
                judged = [each for each in judged if all(each is not best for best in front)]
        chosen: list[Candidate] = []
        for candidate in ordered:
            place = self._place(candidate)
            if all(np.abs(place - start).mean() > _APART for start in self._starts):
                chosen.append(candidate)
                self._starts.append(place)
            if len(chosen) == count:
                break
        return chosen

    def _place(self, candidate: Candidate) -> Array:
        """Place of a design in the ranges and choices, each from 0 to 1."""
        pairs = ((p, p.number(candidate.values[p.name])) for p in self.problem.parameters.free)
        return np.array([x if p.choices else (x - p.low) / (p.high - p.low) for p, x in pairs])

    def _note(self, candidate: Candidate, is_new: bool, trial: Any = None) -> None:
        self._study.tell(candidate, trial)
        self._spent += candidate.designs
        self._progress(candidate.designs)
        if is_new:
            self._follow(candidate)

    def _at_full_accuracy(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """The best, polished on finer sets and judged as they are reported: none by bounds."""
        problem = self.problem
        # What bounds prove of a design is less than it misses: where no design meets all, those of
        # which they prove less than the best misses are judged as the others are.
        known = [each for each in candidates if each.fidelity != "bounds"]
        least = min((each.excess for each in known if not each.fault), default=np.inf)
        bounds = [each for each in candidates if each.fidelity == "bounds" and not each.fault]
        waiting = sorted(bounds, key=problem.score)
        while waiting and waiting[0].excess < least:
            values, waiting = [each.values for each in waiting[:_BATCH]], waiting[_BATCH:]
            tasks = (partial(self._judged, each, bounds=False) for each in values)
            known += (judged := list(parallel.in_order(tasks)))
            least = min([least, *(each.excess for each in judged if not each.fault)])
        best = problem.front(known)
        if len(problem.goals) < 2 or not (best and best[0].is_feasible):
            finite = [each for each in known if np.isfinite(each.excess)]
            best = sorted(finite, key=problem.score)[:_LAST] or list(candidates[:1])
        left = min(MOST_DESIGNS, self._designs - self._spent)
        if self._polishes and left >= _LEAST_OF_POLISH:
            turn = self._turn(best[0])
            best.append(end := polished(problem, best[0], left, turn, problem.accuracy))
            self._spent += end.designs
        return [problem.judge(each.values, fine=True) for each in best]
