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

from softreach.arm.number import fields_of
from softreach.arm.tables import quadrature
from softreach.arm.tensions import LengthLaw, Tensions
from softreach.rod.free import ArmRod
from softreach.rod.response import NodeTables, linear_response, node_tables, rod_state, step_grid
from softreach.rod.tip_map import InvalidLoads
from softreach.support import parallel
from softreach.support.arrays import Array, Mask, rows
from softreach.support.lazy import lazy

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
        of_free = law.shortening_slopes(law.inner(bundles, start.tension))[..., law.columns]
        slopes = np.broadcast_to(of_free, (n, *law.compliance.shape * 2)).copy()
        lowered, shortening = self._after(
            0.0 * start.tension, start.tension, bundles, _HALVINGS + 1
        )
        left = np.flatnonzero(~_has_nan(shortening))
        state = rows(_State(lowered, shortening, slopes), left)
        for _ in range(_MOST_STEPS):
            if not len(left):
                break
            aim = self._aimed(state, pulled[left])
            open_ = ~self._is_solved(state, pulled[left])
            done = left[~open_]
            tension[done], taut[done] = state.tension[~open_], aim.is_taut[~open_]
            left, state, aimed = left[open_], rows(state, open_), aim.tension[open_]
            step = aimed - state.tension
            step, shortening = self._after(state.tension, step, bundles[left], _HALVINGS)
            slopes = _corrected(state.slopes, step, shortening - state.shortening)
            kept = ~_has_nan(shortening)
            state = rows(_State(state.tension + step, shortening, slopes), kept)
            left = left[kept]
        return Tensions(tension, taut)

    def _after(
        self, tension: Array, step: Array, bundles: Array, tries: int
    ) -> tuple[Array, Array]:
        """Steps of tensions, halved until there is an equilibrium, and s behind them, else NaN."""
        step, shortening = step.copy(), np.full_like(tension, np.nan)
        lost = np.flatnonzero(np.isfinite(step).all(axis=1))
        for _ in range(tries):
            if not len(lost):
                break
            shortening[lost] = self.shortening(
                self.law.inner(bundles[lost], tension[lost] + step[lost])
            )
            lost = lost[_has_nan(shortening[lost])]
            step[lost] *= 0.5
        return step, shortening

    def _aimed(self, state: _State, pulled: Array) -> Tensions:
        """Tensions of the complementarity problem of s linearized."""
        excess = pulled - state.shortening
        excess += np.einsum("nij,nj->ni", state.slopes, state.tension)
        return self.law.complementary(state.slopes + np.diag(self.law.compliance), excess)

    def _is_solved(self, state: _State, pulled: Array) -> Mask:
        """Samples whose tendons are as long as they are to be, or slack."""
        law = self.law
        left = state.tension * law.compliance + state.shortening - pulled
        own = np.diagonal(state.slopes, axis1=1, axis2=2) + law.compliance
        miss = np.abs(np.minimum(left, own * state.tension)).max(axis=1)
        return miss <= _CONVERGED * law.arm.length

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
            s = [self.shortening(each) for each in ends]
            slopes[..., k] = (s[1] - s[0]) / (2.0 * widths[k])
        return slopes

    @lazy
    def _measures(self) -> tuple[NodeTables, Array] | None:
        """Tables for the linear response, and N and M of the tendons at their nodes."""
        arm, nowhere = self.rod.arm, np.empty(0)
        grid = step_grid(arm, nowhere, max(_STEPS, self.rod.steps))
        try:
            table = node_tables(arm, nowhere, grid)
        except InvalidLoads:  # that it does not know
            return None
        force, moment = self.law.loads_at(table.stations.ravel(), np.ones(table.stations.size))
        loads = np.concatenate([moment, force[:, None]], axis=1)
        return table, loads.reshape(*table.stations.shape, *loads.shape[1:])


def _has_nan(values: Array) -> Mask:
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
