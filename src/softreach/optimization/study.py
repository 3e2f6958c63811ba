"""Study of a search: designs from Optuna's samplers, in a storage from which it resumes."""

import json
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any, Literal, get_args

import numpy as np

from softreach.optimization.free_parameters import Values
from softreach.optimization.problem import Candidate, Problem
from softreach.support.arguments import as_one_of, as_path
from softreach.support.errors import InvalidInput, check_installed, in_short
from softreach.support.files.atomic import StrPath
from softreach.support.lazy import lazy

Sampler = Literal["auto", "cma", "tpe", "nsga2", "nsga3", "sobol", "random"]
SAMPLERS: tuple[str, ...] = get_args(Sampler)

_NAME = "softreach"
_MISSED = 1e12  # cost of a design that misses requirements by 1: more than any objective has
_NEVER = 1e15  # cost of what cannot exist
_WARM = 10  # designs that CMA-ES begins from at least: the best tenth of them must be one or more
_JUDGED, _KEY, _PROBLEM = "judged", "asked", "problem"


class Study:
    """Designs of a search: where they come from, and the storage in which they are kept.

    The sampler is fed in memory, always in the same order; the storage says what was judged
    before. A search that was killed so asks for the same designs again, and judges only the rest.
    """

    def __init__(
        self, problem: Problem, *, storage: StrPath | None, sampler: str, seed: int, first: int
    ) -> None:
        """Open the storage, if there is one; the first designs are spread evenly."""
        place = None if storage is None else as_path("storage", storage)
        self.problem, self._first = problem, first
        self._sampler, self.seed = as_one_of("sampler", sampler, SAMPLERS), seed
        self.candidates: list[Candidate] = []
        """All designs that were judged, in their order."""
        self._kept: dict[str, Candidate] = {}  # in the storage, by what was asked
        self._asked: set[str] = set()
        self._seen = 0  # trials of the storage that were read
        self._lock, self._optuna = Lock(), _library()
        self._number = max(1, len(problem.goals))  # of values of a trial
        with _quiet():
            self._study = self._created(None)
            self._storage = None if place is None else self._opened(place)
            for values in first_designs(problem, first, seed):
                self._study.enqueue_trial(dict(values))

    def ask(self, count: int) -> list[tuple[Any, dict[str, float | str]]]:
        """Trials, whose costs `tell` reports, and their designs."""
        with _quiet():
            trials = [self._study.ask(self._space) for _ in range(count)]
        return [(trial, dict(trial.params)) for trial in trials]

    def judged(self, what: Sequence[Any], make: Callable[[], Candidate]) -> tuple[Candidate, bool]:
        """What the storage knows, or what is made and kept there, and whether it was made.

        `what` says by numbers and texts all that it depends on, beside the problem.
        """
        key = json.dumps([self.problem.coarse, *what], sort_keys=True)
        with self._lock:
            self._asked.add(key)
            self._read()
            if key in self._kept:
                return self._kept[key], False
        made = make()
        if self._storage is not None:
            with self._lock, _quiet():
                self._storage.add_trial(self._trial(made, {_JUDGED: made.to_dict(), _KEY: key}))
        return made, True

    def tell(self, candidate: Candidate, trial: Any = None) -> None:
        """Let the sampler know a design that was asked, or comes from elsewhere, as a polish."""
        self.candidates.append(candidate)
        with _quiet():
            if trial is None:
                self._study.add_trial(self._trial(candidate, {}))
            else:
                self._study.tell(trial, self._costs(candidate))

    def others(self) -> list[Candidate]:
        """Designs in the storage that searches of other seeds, or of more designs, have judged."""
        with self._lock:
            self._read()
            return [each for key, each in self._kept.items() if key not in self._asked]

    def _read(self) -> None:
        with _quiet():
            trials = self._storage.get_trials(deepcopy=False) if self._storage else []
        for record in (trial.user_attrs for trial in trials[self._seen :]):
            if _KEY in record:  # what others added by Optuna itself has none
                self._kept.setdefault(record[_KEY], Candidate.from_dict(record[_JUDGED]))
        self._seen = len(trials)

    def _trial(self, candidate: Candidate, attributes: dict[str, Any]) -> Any:
        params = dict(candidate.values)
        for each in self.problem.parameters.real:
            params[each.name] = float(np.clip(float(params[each.name]), each.low, each.high))
        known = {"values": self._costs(candidate), "user_attrs": attributes}
        return self._optuna.trial.create_trial(params=params, distributions=self._space, **known)

    def focus(self) -> None:
        """Let a sampler that begins at one place begin where the best of the known designs are."""
        if self.kind != "cma" or len(self.candidates) < _WARM:
            return
        options = {"n_startup_trials": 0, "warn_independent_sampling": False}
        with _quiet():
            trials = self._study.get_trials(states=(self._optuna.trial.TrialState.COMPLETE,))
            make = partial(self._optuna.samplers.CmaEsSampler, source_trials=trials)
            self._study.sampler = make(seed=self.seed + 1, **options)

    def _created(self, storage: Any) -> Any:
        samplers, quiet = self._optuna.samplers, {"warn_independent_sampling": False}
        population = {"population_size": max(8, min(self._first, 48))}
        after = {"multivariate": True, "constant_liar": True, "n_startup_trials": self._first}
        make, options = {
            "cma": (samplers.CmaEsSampler, quiet),
            "tpe": (samplers.TPESampler, after),
            "nsga2": (samplers.NSGAIISampler, population),
            "nsga3": (samplers.NSGAIIISampler, population),
            "sobol": (samplers.QMCSampler, {"scramble": True, **quiet}),
            "random": (samplers.RandomSampler, {}),
        }[self.kind]
        sampler, directions = make(seed=self.seed, **options), ["minimize"] * self._number
        known = {"storage": storage, "sampler": sampler, "directions": directions}
        return self._optuna.create_study(study_name=_NAME, load_if_exists=True, **known)

    def _opened(self, place: str) -> Any:
        digest = self.problem.digest
        try:
            study = self._created(_storage(place))
            if _PROBLEM not in study.user_attrs:
                study.set_user_attr(_PROBLEM, digest)
            if study.user_attrs[_PROBLEM] == digest:
                return study
        except InvalidInput:
            raise
        except Exception as error:
            allowed = "a file that can be written, of this kind of search"
            raise InvalidInput("storage", place, allowed, in_short(error)) from error
        allowed = "a new file, or that of the same designs, requirements and objectives"
        hint = "it belongs to another search: remove it, or choose another file"
        raise InvalidInput("storage", place, allowed, hint)

    @property
    def kind(self) -> str:
        """The sampler, chosen by what is free and how many goals there are."""
        if self._sampler != "auto":
            return self._sampler
        if len(self.problem.goals) > 1:
            return "nsga2" if len(self.problem.goals) < 4 else "nsga3"
        real = all(each.is_real for each in self.problem.parameters.free)
        return "cma" if real and len(self.problem.parameters) > 1 else "tpe"

    @lazy
    def _space(self) -> dict[str, Any]:
        kinds, space = self._optuna.distributions, {}
        for each in self.problem.parameters.free:
            if each.choices:
                space[each.name] = kinds.CategoricalDistribution(each.choices)
            elif each.whole:
                space[each.name] = kinds.IntDistribution(int(each.low), int(each.high))
            else:
                space[each.name] = kinds.FloatDistribution(each.low, each.high)
        return space

    def _costs(self, candidate: Candidate) -> list[float]:
        """Values that the samplers minimize: objectives, or the excess over requirements first."""
        if candidate.is_feasible and self.problem.goals:
            return [*self.problem.costs(candidate)]
        missed = min(_MISSED * (1.0 + candidate.excess), _NEVER)
        if candidate.fidelity == "bounds":  # what is missed is no less: worse than all judged
            missed += 0.5 * _NEVER
        return [missed] * self._number


def first_designs(problem: Problem, count: int, seed: int) -> Iterator[Values]:
    """Designs evenly spread over all ranges and choices, after the one that the user has."""
    from scipy.stats import qmc

    free, start = problem.parameters.free, problem.parameters.start()
    yield from [] if start is None else [start]
    sampler = qmc.Sobol(len(free), rng=np.random.default_rng(seed))
    for place in sampler.random_base2(math.ceil(math.log2(max(count, 1))))[:count]:
        yield {each.name: each.at(float(x)) for each, x in zip(free, place, strict=True)}


def _storage(place: str) -> Any:
    """Optuna's storage in a file, which is new or was begun by a search; others stay as they are.

    A line that a killed process or a full disk cut off is removed: Optuna would append to it, and
    could not read the journal from then on.
    """
    path = Path(place)
    if not path.parent.is_dir() or (path.exists() and not path.is_file()):
        raise InvalidInput("storage", place, "a file in a folder that exists")
    is_new = not path.exists() or not path.stat().st_size
    if not is_new and not _is_of_a_search(path):
        raise InvalidInput("storage", place, "a new file, or that of a search: choose another name")
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend, JournalFileSymlinkLock

    if not is_new:
        lock = JournalFileSymlinkLock(str(path))
        lock.acquire()  # another process may be in the middle of a line
        try:
            with path.open("r+b") as file:
                file.truncate(file.read().rfind(b"\n") + 1)
        finally:
            lock.release()
    return JournalStorage(JournalFileBackend(str(path)))


def _is_of_a_search(path: Path) -> bool:
    with suppress(ValueError, KeyError, TypeError), path.open("rb") as file:
        first = json.loads(file.readline(4096))
        return first["op_code"] == 0 and first["study_name"] == _NAME
    return False


def _library() -> Any:
    check_installed("optuna", "cmaes")
    import optuna

    return optuna


@contextmanager
def _quiet() -> Iterator[None]:
    optuna = _library()
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            yield
    finally:
        optuna.logging.set_verbosity(before)
