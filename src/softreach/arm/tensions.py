"""Tensions of tendons that are driven by length, from what is pulled in: theory (95) to (97).

A unit of tension loads the sections by N and M, and does work on their strains: it shortens the
path of its tendon by s = ∫ N (ζ - 1) + M·ω dZ, with ω = η u. This is exact for tendons parallel to
the axis of an arm that is not twisted, and consistent with the loads of `Tendon` for all others.
Without loads s is linear in the tensions, and its slopes C are symmetric and positive semidefinite;
so tensions solve a linear complementarity problem. As every tension shortens the axis, it has a
solution for all displacements.

Under loads, and between guides, s is not linear in τ. Each step then solves the complementarity
problem of s linearized; its slopes begin as those of the arm without loads and are corrected by
what each step shows (BFGS), which keeps them symmetric and positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import LengthTendon
from softreach.arm.body import Body, RestStrains
from softreach.arm.guides import ArcLoads, Guides
from softreach.arm.tables import Works
from softreach.support import parallel
from softreach.support.arrays import Array, Mask, rows
from softreach.support.lazy import lazy

_BLOCK = 256
_MOST_STEPS = 40
_CONVERGED = 1e-11  # of the length
_HALVINGS = 6


class Tensions(NamedTuple):
    """Tensions of the tendons that are driven by length."""

    tension: Array  # τ >= 0 [N], shape (n, tendon)
    is_taut: Mask  # Tendons whose tension follows the displacements, shape (n, tendon)


@dataclass(frozen=True, eq=False)
class LengthLaw:
    """Shortening of the paths of tendons that are driven by length, and the tensions it takes.

    Activations have tensions [N] in the columns of these tendons where they are called inner, else
    displacements [m].
    """

    arm: Body  # With its rest shape as a bundle: see `body_of`

    @lazy
    def columns(self) -> NDArray[np.intp]:
        """Bundles of the arm that are tendons driven by length."""
        kinds = [isinstance(each, LengthTendon) for each in self.arm.bundle_actuators]
        return np.flatnonzero(kinds)

    @lazy
    def works(self) -> Works:
        """s of the paths from the straight arm: what unit tensions do work on."""
        return Works(self.arm, self.columns)

    @lazy
    def compliance(self) -> Array:
        """1/k of each [m/N]."""
        each = (self.arm.bundle_actuators[k] for k in self.columns)
        return np.array([x.compliance for x in each if isinstance(x, LengthTendon)])

    @lazy
    def taut_from(self) -> Array:
        """Displacement from which each is taut while the arm keeps its shape [m]."""
        tendons = (each for each in self.arm.actuators if isinstance(each, LengthTendon))
        return np.concatenate([np.empty(0), *(tendon.taut_from for tendon in tendons)])

    @lazy
    def rest(self) -> Array:
        """Activations of the arm that nothing drives, shape (1, bundle)."""
        return np.array([[float(isinstance(x, RestStrains)) for x in self.arm.bundle_actuators]])

    @lazy
    def at_rest(self) -> Array:
        """s of the arm at rest from the straight one [m], shape (1, tendon)."""
        return self.works.of(self.rest)

    def tensions(self, bundles: Array) -> Tensions:
        """Tensions at activations with displacements, shape (n, bundles)."""
        slack = self.with_tensions(bundles, np.zeros((len(bundles), len(self.columns))))
        shortening = self.works.of(slack) - self.at_rest
        excess = bundles[:, self.columns] - self.taut_from - shortening
        matrix = self.works.by_bundle(slack)[..., self.columns] + np.diag(self.compliance)
        return self.complementary(matrix, excess)

    def complementary(self, matrix: Array, excess: Array) -> Tensions:
        """Tensions τ >= 0 with w = matrix τ - excess >= 0 and τ·w = 0.

        The matrix is ∂s/∂τ + 1/k [m/N], (n or 1, tendon, tendon), the excess in m, (n, tendon).
        """
        from softreach.kernels.box.complementarity import complementary  # loads Numba

        tension, taut = np.empty(excess.shape), np.empty(excess.shape, np.int8)
        solved = np.empty(len(excess), np.int8)
        matrix, excess = np.ascontiguousarray(matrix), np.ascontiguousarray(excess)
        complementary(matrix, excess, tension, taut, solved)
        tension[solved == 0] = np.nan
        return Tensions(tension, taut == 1)

    def with_tensions(self, bundles: Array, tension: Array) -> Array:
        """Activations with tensions in place of displacements, shape (n, bundles)."""
        inner = bundles.copy()
        inner[:, self.columns] = tension
        return inner

    def inner(self, bundles: Array) -> tuple[Array, Mask]:
        """Activations of the inner arm, and which tendons are taut, at those with displacements."""
        tensions = self.tensions(bundles)
        return self.with_tensions(bundles, tensions.tension), tensions.is_taut

    def slopes(self, inner: Array, is_taut: Mask) -> Array:
        """∂(activations with tensions)/∂(activations with displacements), (n, bundle, bundle)."""
        return self.slopes_of_taut(inner, is_taut, self.works.slopes(inner))

    def slopes_of_taut(self, inner: Array, is_taut: Mask, of_strains: Array) -> Array:
        """The same where ∂s/∂γ at `inner` is given, shape (n or 1, tendon, bundle)."""
        n, columns = len(inner), self.columns
        matrix = of_strains[..., columns] + np.diag(self.compliance)
        both = is_taut[:, :, None] & is_taut[:, None, :]
        matrix = np.where(both, matrix, np.eye(len(columns)))
        wanted = np.tile(-of_strains, (1 if len(of_strains) == n else n, 1, 1))
        wanted[..., columns] = np.eye(len(columns))
        wanted *= is_taut[..., None]
        slopes = np.tile(np.eye(inner.shape[1]), (n, 1, 1))
        slopes[:, columns] = np.linalg.solve(matrix, wanted)
        return slopes


class _State(NamedTuple):
    """Tensions on their way, for some samples."""

    inner: Array  # Activations of the inner arm, shape (n, bundle)
    shortening: Array  # s [m], shape (n, tendon)
    slopes: Array  # Estimate of ∂s/∂τ [m/N], shape (n, tendon, tendon)


@dataclass(frozen=True)
class PulledTendons:
    """Tendons whose paths shorten nonlinearly in their tensions: here those between guides."""

    law: LengthLaw

    @lazy
    def guides(self) -> Guides | None:
        """Guides of tendons; None if there are none."""
        arm = self.law.arm
        return Guides(arm) if arm.actuators and isinstance(arm.actuators[-1], ArcLoads) else None

    def works(self, inner: Array, which: Works) -> Array:
        """Works of unit loads on the strains at activations of the inner arm, shape (n, work)."""
        return which.of(inner)

    def work_slopes(self, inner: Array, each: list[Works]) -> list[Array]:
        """Their derivatives by the activations, shape (n or 1, work, bundle) each."""
        return [which.slopes(inner) for which in each]

    def _settled(self, inner: Array) -> Array:
        """With the loads of arcs that guided tendons put on an arm at tensions."""
        if self.guides is None:
            return inner
        return self.guides.settled(inner, partial(self.works, which=self.guides.works))

    def continued_from(self, inner: Array, frames: Array | None = None) -> PulledTendons:
        """Those of the arm in its posture at activations of the inner arm, shape (k, bundles)."""
        return self

    def shortening(self, inner: Array) -> Array:
        """s of paths [m] at activations of the inner arm, (n, tendon); NaN without equilibrium."""
        law = self.law
        s = self.works(inner, law.works) - law.at_rest
        if self.guides is not None and (self._guided[0]).size:
            own, column = self._guided
            lengths = self.guides.lengths(self.works(inner, self.guides.works))
            s[:, own] = (self._lengths_at_rest - lengths)[:, column]
        return s

    @lazy
    def _guided(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Tendons driven by length that are guided: their places among those and among these."""
        assert self.guides is not None
        return np.intersect1d(self.law.columns, self.guides.columns, return_indices=True)[1:]

    @lazy
    def _lengths_at_rest(self) -> Array:
        assert self.guides is not None
        return self.guides.lengths(self.guides.works.of(self.law.rest))

    def inner(self, bundles: Array) -> tuple[Array, Mask]:
        """Activations of the inner arm, and which tendons are taut, at those with displacements.

        NaN where none are found. Blocks of samples are independent of each other.
        """
        inner = np.empty_like(bundles)
        taut = np.empty((len(bundles), len(self.law.columns)), bool)

        def fill(block: slice) -> None:
            inner[block], taut[block] = self._of_block(bundles[block])

        parallel.run(partial(fill, block) for block in parallel.blocks(len(bundles), _BLOCK))
        return inner, taut

    def _of_block(self, bundles: Array) -> tuple[Array, Mask]:
        law, n = self.law, len(bundles)
        if not len(law.columns):
            return self._settled(bundles), np.empty((n, 0), bool)
        pulled = bundles[:, law.columns] - law.taut_from
        start = law.tensions(bundles)
        inner, taut = np.full_like(bundles, np.nan), start.is_taut.copy()
        slack = law.with_tensions(bundles, 0.0 * start.tension)
        of_free = law.works.slopes(law.with_tensions(bundles, start.tension))[..., law.columns]
        slopes = np.broadcast_to(of_free, (n, *law.compliance.shape * 2)).copy()
        first, shortening = self._after(slack, start.tension, _HALVINGS + 1)
        left = np.flatnonzero(~_has_nan(shortening))
        state = rows(_State(first, shortening, slopes), left)
        for _ in range(_MOST_STEPS):
            if not len(left):
                break
            tension = state.inner[:, law.columns]
            aim = self._aimed(state, tension, pulled[left])
            open_ = ~self._is_solved(state, tension, pulled[left])
            inner[left[~open_]], taut[left[~open_]] = state.inner[~open_], aim.is_taut[~open_]
            left, state, step = left[open_], rows(state, open_), (aim.tension - tension)[open_]
            moved, shortening = self._after(state.inner, step, _HALVINGS)
            step = (moved - state.inner)[:, law.columns]
            slopes = _corrected(state.slopes, step, shortening - state.shortening)
            kept = ~_has_nan(shortening)
            state, left = rows(_State(moved, shortening, slopes), kept), left[kept]
        return inner, taut

    def _after(self, inner: Array, step: Array, tries: int) -> tuple[Array, Array]:
        """Activations after steps of tensions, halved until the arm holds them, and s there."""
        moved, step = inner.copy(), step.copy()
        shortening = np.full_like(step, np.nan)
        lost = np.flatnonzero(np.isfinite(step).all(axis=1))
        for _ in range(tries):
            if not len(lost):
                break
            trial = inner[lost]
            trial[:, self.law.columns] += step[lost]
            moved[lost] = self._settled(trial)
            shortening[lost] = self.shortening(moved[lost])
            lost = lost[_has_nan(shortening[lost])]
            step[lost] *= 0.5
        return moved, shortening

    def _aimed(self, state: _State, tension: Array, pulled: Array) -> Tensions:
        """Tensions of the complementarity problem of s linearized."""
        excess = pulled - state.shortening
        excess += np.einsum("nij,nj->ni", state.slopes, tension)
        return self.law.complementary(state.slopes + np.diag(self.law.compliance), excess)

    def _is_solved(self, state: _State, tension: Array, pulled: Array) -> Mask:
        """Samples whose tendons are as long as they are to be, or slack."""
        law = self.law
        left = tension * law.compliance + state.shortening - pulled
        own = np.diagonal(state.slopes, axis1=1, axis2=2) + law.compliance
        miss = np.abs(np.minimum(left, own * tension)).max(axis=1)
        return miss <= _CONVERGED * law.arm.length

    def slopes(self, inner: Array, is_taut: Mask) -> Array:
        """∂(activations of the inner arm)/∂(those with displacements), (n, bundle, bundle)."""
        bundles = inner.shape[1]
        return self.response(inner, is_taut, np.eye(bundles), np.zeros((bundles, bundles)))

    def response(self, inner: Array, is_taut: Mask, pulled: Array, on_arcs: Array) -> Array:
        """Changes of the activations of the inner arm with what drives it, (n, bundle, change).

        `pulled` are those of activations with displacements, `on_arcs` in the rows of the loads of
        arcs those at the same strains and tensions, (n or none, bundle, change) each.
        """
        law, guides = self.law, self.guides
        if guides is None:
            (of_paths,) = self.work_slopes(inner, [law.works])
            return law.slopes_of_taut(inner, is_taut, of_paths) @ pulled
        of_paths, of_arcs = self.work_slopes(inner, [law.works, guides.works])
        arcs, tension = self.works(inner, guides.works), inner[:, guides.columns]
        by_arcs, by_tension = guides.on_arcs_slopes(arcs, tension)
        # w = w(arcs(γ, w), τ)
        given = np.array(by_arcs @ of_arcs)
        given[..., guides.columns] += by_tension
        own = np.linalg.inv(np.eye(len(guides.loads)) - given[..., guides.loads])
        given[..., guides.loads] = 0.0
        loads = np.tile(np.eye(inner.shape[1]), (len(inner), 1, 1))
        loads[:, guides.loads] = own @ given
        places, column = self._guided
        of_paths = np.tile(of_paths, (len(inner) // len(of_paths), 1, 1))
        of_paths[:, places] = -(guides.slopes(arcs) @ of_arcs)[:, column]
        changed = np.zeros((len(inner), *pulled.shape[-2:]))
        changed[:, guides.loads] = own @ on_arcs[..., guides.loads, :]
        left = pulled + np.zeros_like(changed)
        left[:, law.columns] -= of_paths @ changed
        return changed + loads @ law.slopes_of_taut(inner, is_taut, of_paths @ loads) @ left


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
