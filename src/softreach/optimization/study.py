"""Study of a search: designs asked of Optuna's samplers and told, in a storage that resumes."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from softreach.optimization.free_parameters import Values
from softreach.optimization.problem import Candidate, Problem
from softreach.support.arguments import as_one_of, as_path
from softreach.support.errors import InvalidInput, MissingExtra, in_short
from softreach.support.lazy import lazy

if TYPE_CHECKING:
    import optuna

__all__ = ["SAMPLERS", "Sampler", "Study"]

Sampler = Literal["auto", "cma", "tpe", "nsga2", "nsga3", "sobol", "random"]
SAMPLERS = ("auto", "cma", "tpe", "nsga2", "nsga3", "sobol", "random")

_NAME = "softreach"
_MISSED = 1e12
"""Cost of a design that misses requirements by 1: more than any objective has, as only the order
matters to the samplers."""
_NEVER = 1e15
"""Cost of what cannot exist."""
_WARM = 10
"""Designs that CMA-ES begins from at least: the best tenth of them must be one or more."""
_JUDGED, _PROBLEM = "judged", "problem"


class Study:
    """Designs of a search: where they come from, and where they are kept."""

    def __init__(
        self, problem: Problem, *, storage: str | None, sampler: str, seed: int, first: int
    ) -> None:
        """Open the storage, or begin it with the first designs.

        Args:
            problem: The problem.
            storage: File of a journal, or an SQLite file by its suffix `.db` or `.sqlite`; None for
                memory alone.
            sampler: One of `SAMPLERS`.
            seed: Of the sampler.
            first: Number of designs, evenly spread, that come before those of the sampler.

        Raises:
            InvalidInput: The storage cannot be opened, or belongs to another search or program.
            MissingExtra: Optuna is not installed.
        """
        self.problem, self._first = problem, first
        self._sampler = as_one_of("sampler", sampler, SAMPLERS)
        self.seed = seed
        self._judged: dict[int, Candidate] = {}  # by the number of its trial
        self._optuna = _library()
        self._complete = (self._optuna.trial.TrialState.COMPLETE,)
        with _quiet():
            self._study = self._opened(storage)
            self._begin(storage)

    def ask(self, count: int) -> list[tuple[Any, dict[str, float | str]]]:
        """Trials to be told, and their designs."""
        with _quiet():
            trials = [self._study.ask(self._space) for _ in range(count)]
        return [(trial, dict(trial.params)) for trial in trials]

    def tell(self, trial: Any, candidate: Candidate) -> None:
        """Keep a design that was asked."""
        with _quiet():
            trial.set_user_attr(_JUDGED, candidate.to_dict())
            self._study.tell(trial, self._costs(candidate))

    def add(self, candidate: Candidate) -> None:
        """Keep a design that came from elsewhere, such as a polish."""
        params = dict(candidate.values)
        for each in self.problem.parameters.real:
            params[each.name] = float(np.clip(float(params[each.name]), each.low, each.high))
        with _quiet():
            trial = self._optuna.trial.create_trial(
                params=params,
                distributions=self._space,
                values=self._costs(candidate),
                user_attrs={_JUDGED: candidate.to_dict()},
            )
            self._study.add_trial(trial)

    def candidates(self) -> list[Candidate]:
        """All designs that were judged, by this process or another, in their order."""
        with _quiet():
            trials = self._study.get_trials(deepcopy=False, states=self._complete)
        for trial in trials:
            if trial.number not in self._judged and _JUDGED in trial.user_attrs:
                candidate = Candidate.from_dict(trial.params, trial.user_attrs[_JUDGED])
                self._judged[trial.number] = candidate
        return [self._judged[number] for number in sorted(self._judged)]

    def focus(self) -> None:
        """Let a sampler that begins at one place begin where the best of the known designs are."""
        if self.kind != "cma":
            return
        with _quiet():
            known = self._study.get_trials(states=self._complete)
            if len(known) < _WARM:
                return
            self._study.sampler = self._optuna.samplers.CmaEsSampler(
                source_trials=known,
                n_startup_trials=0,
                seed=self.seed + 1,
                warn_independent_sampling=False,
            )

    def _opened(self, storage: str | None) -> optuna.Study:
        optuna, place = self._optuna, None if storage is None else as_path("storage", storage)
        try:
            return optuna.create_study(
                study_name=_NAME,
                storage=None if place is None else _storage(place),
                directions=["minimize"] * max(1, len(self.problem.goals)),
                sampler=self._made_sampler(self.seed),
                load_if_exists=True,
            )
        except InvalidInput:
            raise
        except Exception as error:
            allowed = "a file that can be written, of this kind of search"
            raise InvalidInput("storage", storage, allowed, in_short(error)) from error

    def _begin(self, place: str | None) -> None:
        """Note the problem and ask for the first designs; refuse the storage of another one.

        What was killed in between goes on, and a second process asks for none again.
        """
        digest = self.problem.digest
        noted = self._study.user_attrs.get(_PROBLEM, digest)
        if noted != digest:
            allowed = "that of the same designs, requirements and objectives"
            hint = "it is of another search: remove it, or choose another file"
            raise InvalidInput("storage", place, allowed, hint)
        self._study.set_user_attr(_PROBLEM, digest)
        known = self._study.get_trials(deepcopy=False)
        if known:  # else another process would draw the same designs
            self._study.sampler = self._made_sampler(self.seed + len(known))
        names = self.problem.parameters.names
        planned = [trial.system_attrs.get("fixed_params", {}) for trial in known]
        each = [trial.params or plan for trial, plan in zip(known, planned, strict=True)]
        asked = {tuple(values.get(name) for name in names) for values in each}
        for values in first_designs(self.problem, self._first, self.seed):
            if tuple(values[name] for name in names) not in asked:
                self._study.enqueue_trial(dict(values))

    @property
    def kind(self) -> str:
        """The sampler, chosen by what is free and how many goals there are."""
        if self._sampler != "auto":
            return self._sampler
        if len(self.problem.goals) > 1:
            return "nsga2" if len(self.problem.goals) < 4 else "nsga3"
        real = all(each.is_real for each in self.problem.parameters.free)
        return "cma" if real and len(self.problem.parameters) > 1 else "tpe"

    def _made_sampler(self, seed: int) -> Any:
        samplers = self._optuna.samplers
        population = max(8, min(self._first, 48))
        return {
            "cma": lambda: samplers.CmaEsSampler(seed=seed, warn_independent_sampling=False),
            "tpe": lambda: samplers.TPESampler(
                seed=seed, multivariate=True, constant_liar=True, n_startup_trials=self._first
            ),
            "nsga2": lambda: samplers.NSGAIISampler(seed=seed, population_size=population),
            "nsga3": lambda: samplers.NSGAIIISampler(seed=seed, population_size=population),
            "sobol": lambda: samplers.QMCSampler(
                seed=seed, scramble=True, warn_independent_sampling=False
            ),
            "random": lambda: samplers.RandomSampler(seed=seed),
        }[self.kind]()

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
        return [missed] * max(1, len(self.problem.goals))


def first_designs(problem: Problem, count: int, seed: int) -> Iterator[Values]:
    """Designs evenly spread over all ranges and choices, after the one that the user has."""
    from scipy.stats import qmc

    start = problem.parameters.start()
    if start is not None:
        yield start
    free = problem.parameters.free
    sampler = qmc.Sobol(len(free), rng=np.random.default_rng(seed))
    cube = sampler.random(1 << max(0, math.ceil(math.log2(max(count, 1)))))[:count]
    for place in cube:
        yield {each.name: each.at(float(x)) for each, x in zip(free, place, strict=True)}


def _storage(place: str) -> Any:
    """Optuna's storage in a file, which is new or was begun by a search; others stay as they are.

    A line that a killed process or a full disk cut off is removed: Optuna would append to it, and
    could not read the journal from then on.
    """
    path = Path(place)
    if not path.parent.is_dir() or (path.exists() and not path.is_file()):
        allowed = "a file in a folder that exists"
        raise InvalidInput("storage", place, allowed)
    is_new = not path.exists() or not path.stat().st_size
    is_database = path.suffix in (".db", ".sqlite", ".sqlite3")
    if not is_new and not _is_own(path, is_database):
        raise InvalidInput("storage", place, "a new file, or that of a search: choose another name")
    if is_database:
        return f"sqlite:///{path}"
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


def _is_own(path: Path, is_database: bool) -> bool:
    if is_database:
        import sqlite3

        place = f"{path.absolute().as_uri()}?mode=ro"
        try:
            with closing(sqlite3.connect(place, uri=True)) as database:
                names = database.execute("SELECT study_name FROM studies").fetchall()
            return set(names) <= {(_NAME,)}
        except sqlite3.Error:
            return False
    try:
        with path.open("rb") as file:
            first = json.loads(file.readline(4096))
        return first["op_code"] == 0 and first["study_name"] == _NAME
    except (ValueError, KeyError, TypeError):
        return False


def _library() -> Any:
    try:
        import cmaes  # pyright: ignore[reportUnusedImport]  # noqa: F401
        import optuna
    except ImportError as error:
        raise MissingExtra(("optuna", "search"), ("cmaes", "search")) from error
    return optuna


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what Optuna logs for people who use it themselves."""
    optuna = _library()
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            yield
    finally:
        optuna.logging.set_verbosity(before)
