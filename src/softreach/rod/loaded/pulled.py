"""Tendons driven by length on an arm under loads: tensions by Newton steps on the active set.

Under loads the shortening s of the paths is no longer linear in the tensions τ. Each step solves
the complementarity problem of s linearized; its slopes begin as those of the arm without loads and
are corrected by what each step shows (BFGS), which keeps them symmetric and positive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.number import fields_of
from softreach.arm.tables import quadrature
from softreach.arm.tensions import LengthLaw, Tensions
from softreach.rod.free import ArmRod
from softreach.rod.response import NodeTables, linear_response, node_tables, rod_state, step_grid
from softreach.support import parallel
from softreach.support.arrays import rows
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy

__all__ = ["LoadedLengths"]

Array = NDArray[np.float64]

_BLOCK = 256
_PIECES = 8  # of the arm, on which its strains are smooth
_MOST_STEPS = 40
_CONVERGED = 1e-11  # of the length
_HALVINGS = 6
_STEPS = 48  # of the linear response
_DIFFERENCE = 1e-4  # of the widest range, for derivatives


class _State(NamedTuple):
    """Tensions on their way, for some samples."""

    tension: Array
    """τ [N], shape (n, tendon)."""
    shortening: Array
    """s [m], shape (n, tendon)."""
    slopes: Array
    """Estimate of ∂s/∂τ [m/N], shape (n, tendon, tendon)."""


@dataclass(frozen=True)
class LoadedLengths:
    """Tensions, and their slopes, of tendons driven by length under loads."""

    law: LengthLaw = field(compare=False)
    """That of the arm without loads."""
    rod: ArmRod
    """The map of the inner arm under loads, accurate enough for s."""

    @lazy
    def shortening(self) -> Callable[[Array], Array]:
        """s [m] as a function of activations with tensions; NaN without an equilibrium."""
        arm = self.law.arm
        turns = [
            abs(each.value_on("revolution", arm.profile, arm.section))
            for each in arm.actuators
            if "revolution" in fields_of(type(each))
        ]
        z, weights, _ = quadrature(arm, _PIECES + int(max(turns, default=0.0)))
        force, moment = self.law.loads_at(z, weights)
        moment, at_rest = moment.reshape(-1, len(self.law.columns)), self.law.at_rest

        def shortening(inner: Array) -> Array:
            strains = self.rod.strains(inner, z)
            turn = (strains.curvature * strains.extension[..., None]).reshape(len(inner), 1, -1)
            # One product for each sample, so that none depends on those beside it.
            work = np.matmul(strains.extension[:, None] - 1.0, force) + np.matmul(turn, moment)
            return work[:, 0] - at_rest

        return shortening

    def tensions(self, bundles: Array) -> Tensions:
        """Tensions at activations with displacements, shape (n, bundles); NaN where none is found.

        Blocks of samples are independent of each other.
        """
        tension = np.empty((len(bundles), len(self.law.columns)))
        taut = np.empty(tension.shape, bool)

        def fill(block: slice) -> None:
            tension[block], taut[block] = self._of_block(bundles[block])

        parallel.run(partial(fill, block) for block in parallel.blocks(len(bundles), _BLOCK))
        return Tensions(tension, taut)

    def _of_block(self, bundles: Array) -> Tensions:
        law, n = self.law, len(bundles)
        pulled = bundles[:, law.columns] - law.taut_from
        start = law.tensions(bundles)
        tension, taut = np.full_like(start.tension, np.nan), start.is_taut.copy()
        inner = law.inner(bundles, start.tension)
        slopes = np.broadcast_to(
            law.shortening_slopes(inner)[..., law.columns], (n, *law.compliance.shape * 2)
        )
        state = _State(start.tension, self.shortening(inner), slopes.copy())
        state, left = self._lowered(state, bundles)
        for _ in range(_MOST_STEPS):
            if not len(left):
                break
            aim = self._aimed(state, pulled[left])
            open_ = ~self._is_solved(state, pulled[left])
            done = left[~open_]
            tension[done], taut[done] = state.tension[~open_], aim.is_taut[~open_]
            left, state, aimed = left[open_], rows(state, open_), aim.tension[open_]
            state, kept = self._stepped(state, aimed, bundles[left])
            left, state = left[kept], rows(state, kept)
        return Tensions(tension, taut)

    def _lowered(self, state: _State, bundles: Array) -> tuple[_State, NDArray[np.intp]]:
        """Tensions that have an equilibrium to start with, halves of the first; and their rows."""
        for _ in range(_HALVINGS):
            lost = np.flatnonzero(_has_nan(state.shortening))
            if not len(lost):
                break
            state.tension[lost] *= 0.5
            inner = self.law.inner(bundles[lost], state.tension[lost])
            state.shortening[lost] = self.shortening(inner)
        kept = ~_has_nan(state.shortening)
        return rows(state, kept), np.flatnonzero(kept)

    def _aimed(self, state: _State, pulled: Array) -> Tensions:
        """Tensions of the complementarity problem of s linearized."""
        excess = pulled - state.shortening
        excess += np.einsum("nij,nj->ni", state.slopes, state.tension)
        return self.law.complementary(state.slopes + np.diag(self.law.compliance), excess)

    def _is_solved(self, state: _State, pulled: Array) -> NDArray[np.bool_]:
        """Samples whose tendons are as long as they are to be, or slack."""
        law = self.law
        left = state.tension * law.compliance + state.shortening - pulled
        own = np.diagonal(state.slopes, axis1=1, axis2=2) + law.compliance
        miss = np.abs(np.minimum(left, own * state.tension)).max(axis=1)
        return miss <= _CONVERGED * law.arm.length

    def _stepped(
        self, state: _State, aimed: Array, bundles: Array
    ) -> tuple[_State, NDArray[np.bool_]]:
        """The state after a step, halved where it has no equilibrium, and where there is one."""
        step = aimed - state.tension
        shortening = np.full_like(state.shortening, np.nan)
        todo = np.flatnonzero(np.isfinite(step).all(axis=1))
        for _ in range(_HALVINGS):
            if not len(todo):
                break
            inner = self.law.inner(bundles[todo], state.tension[todo] + step[todo])
            shortening[todo] = self.shortening(inner)
            todo = todo[_has_nan(shortening[todo])]
            step[todo] *= 0.5
        slopes = _corrected(state.slopes, step, shortening - state.shortening)
        after = _State(state.tension + step, shortening, slopes)
        return after, ~_has_nan(shortening)

    def continued_from(self, inner: Array, frames: Array | None = None) -> LoadedLengths:
        """Those of the arm in its posture at activations with tensions, shape (k, bundles)."""
        rod = self.rod.continued_from(inner, frames)
        assert isinstance(rod, ArmRod)
        return replace(self, rod=rod)

    def shortening_slopes(self, inner: Array) -> Array:
        """∂s/∂γ at activations with tensions, (n, tendon, bundle); NaN where these are.

        Exact where loads have a linear response, else by central differences.
        """
        slopes = np.full((len(inner), *self.law.columns.shape, inner.shape[1]), np.nan)
        known = ~_has_nan(inner)
        slopes[known] = self._slopes(inner[known])
        return slopes

    def _slopes(self, inner: Array) -> Array:
        if self._measures is not None:
            table, measures = self._measures
            state = rod_state(self.rod, inner, table)
            return linear_response(table, state, [], measures).works
        n, count = inner.shape
        slopes = np.zeros((n, len(self.law.columns), count))
        widths = _DIFFERENCE * self.rod.box.widths
        for k in np.flatnonzero(widths > 0):
            ends = [inner.copy(), inner.copy()]
            ends[0][:, k] -= widths[k]
            ends[1][:, k] += widths[k]
            s = [self._in_blocks(each) for each in ends]
            slopes[..., k] = (s[1] - s[0]) / (2.0 * widths[k])
        return slopes

    @lazy
    def _measures(self) -> tuple[NodeTables, Array] | None:
        """Tables for the linear response, and N and M of the tendons at their nodes."""
        arm, nowhere = self.rod.arm, np.empty(0)
        grid = step_grid(arm, nowhere, max(_STEPS, self.rod.steps))
        try:
            table = node_tables(arm, nowhere, grid)
        except InvalidInput:  # loads that it does not know
            return None
        force, moment = self.law.loads_at(table.stations.ravel(), np.ones(table.stations.size))
        loads = np.concatenate([moment, force[:, None]], axis=1)
        return table, loads.reshape(*table.stations.shape, *loads.shape[1:])

    def _in_blocks(self, inner: Array) -> Array:
        blocks = parallel.blocks(len(inner), _BLOCK)
        none = np.empty((0, len(self.law.columns)))
        return np.concatenate([none, *(self.shortening(inner[block]) for block in blocks)])


def _has_nan(values: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isnan(values).any(axis=1))


def _corrected(slopes: Array, step: Array, change: Array) -> Array:
    """Slopes that explain a change after a step, else as they were (BFGS); those of NaN stay."""
    along = np.einsum("nij,nj->ni", slopes, step)
    expected, seen = (step * along).sum(axis=1), (step * change).sum(axis=1)
    good = (expected > 0.0) & (seen > 0.1 * expected)
    corrected = slopes.copy()
    for values, size, sign in ((along, expected, -1.0), (change, seen, 1.0)):
        chosen = values[good]
        squares = chosen[:, :, None] * chosen[:, None, :]
        corrected[good] += sign * squares / size[good, None, None]
    return corrected
