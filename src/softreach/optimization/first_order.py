"""First-order effect of deviations on a reachable set: theory (99)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from softreach.optimization.deviations import (
    NORMAL,
    Deviations,
    Spread,
    deviations_of,
    probabilities,
)
from softreach.requirements.requirements import Requirements, Target, with_payload
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible
from softreach.workspace.gradient import volume_gradient
from softreach.workspace.moving_boundary import MovingBoundary
from softreach.workspace.reach import reachable_set
from softreach.workspace.solid import ReachableSolid

__all__ = ["TOL", "FirstOrder", "region_places"]

TOL = 1e-6  # of tips at targets, in L
_IN_REGION = 2048  # places of a region
_BLOCK = 1 << 22  # numbers at once


class FirstOrder:
    """Sets, their boundaries and what deviations do to them, to first order."""

    def __init__(
        self, deviations: Deviations, needs: Requirements, accuracy: float, changes: Array
    ) -> None:
        self.deviations, self.needs, self.accuracy = deviations, needs, accuracy
        self.changes = changes
        self.gradient = volume_gradient(deviations.arm, deviations.names, accuracy=accuracy)
        self.solid = self.gradient.solid
        self.boundary = MovingBoundary.of(self.solid, deviations.parameters)
        self.loaded = [self._under(payload) for payload in needs.payloads or (None,)]

    def _under(self, payload: float | None) -> tuple[ReachableSolid | None, MovingBoundary | None]:
        """Set under a payload, and its boundary; none of either where nothing is stable."""
        arm = with_payload(self.deviations.arm, payload)
        if arm is self.deviations.arm or not self.needs.targets:
            return self.solid, self.boundary
        try:
            solid = reachable_set(arm, accuracy=self.accuracy)
        except InvalidInput as error:
            if error.name != "loads":
                raise
            return None, None
        if not isinstance(solid, ReachableSolid):
            raise NotPossible(f"with {payload:g} kg at its tip the arm reaches no volume")
        return solid, MovingBoundary.of(solid, deviations_of(arm, self.sigmas).parameters)

    @property
    def sigmas(self) -> dict[str, float]:
        """Deviations by name."""
        return dict(zip(self.deviations.names, self.deviations.sigmas.tolist(), strict=True))

    def kept(self) -> Spread:
        """Share of the volume that is kept."""
        volume, sigmas = self.solid.volume, self.deviations.sigmas
        shares = 1.0 - self.boundary.lost(self.changes) / volume
        # The triangles sweep what the gradient, which is more exact, says to be swept in all.
        off = np.linalg.norm((self.boundary.growth - self.gradient.volume) * sigmas)
        return Spread(
            name="reach kept",
            unit="1",
            nominal=1.0,
            mean=1.0 - self.boundary.mean_lost(sigmas) / volume,
            deviation=float(shares.std()),
            quantile=float(max(0.0, np.quantile(shares, 0.05))),
            error=float(off) / volume / math.sqrt(2.0 * math.pi),
        )

    def costs(self) -> Array:
        """Share lost by each parameter alone."""
        each = np.diag(self.deviations.sigmas)
        return np.array([self.boundary.mean_lost(row) for row in each]) / self.solid.volume

    def of_set(self, name: str, unit: str, sense: float) -> Spread:
        """A number of the set, by its gradient."""
        nominal = float(getattr(self.solid, name))
        slopes, errors = (getattr(self.gradient, part) for part in (name, f"{name}_error"))
        deviation = float(np.linalg.norm(slopes * self.deviations.sigmas))
        return Spread(
            name=name,
            unit=unit,
            nominal=nominal,
            mean=nominal,
            deviation=deviation,
            quantile=nominal - sense * NORMAL * deviation,
            error=float(np.linalg.norm(errors * self.deviations.sigmas)),
            sense=sense,
        )

    def depths(self, places: Array, within: float) -> Iterator[tuple[Array, Array]]:
        """Depth of places within reach [m], and how the boundary there moves, by payloads."""
        for solid, boundary in self.loaded:
            if solid is None or boundary is None:
                yield np.full(len(places), -np.inf), np.zeros((len(places), len(self.sigmas)))
            else:
                yield within - solid.distance(places), boundary.speed_at(places)

    def probability(self, target: Target) -> Array:
        """Probability that each place is reached, under the worst payload."""
        assert target.places is not None
        sigmas, within = self.deviations.sigmas, max(target.within, TOL * self.solid.arm.length)
        return np.min(
            [
                probabilities(depth, np.linalg.norm(speed * sigmas, axis=1))
                for depth, speed in self.depths(target.places, within)
            ],
            axis=0,
        )

    def covered(self, target: Target) -> Spread:
        """Share of a region that is covered, under the worst payload."""
        places = region_places(target)
        shares, nominal = np.ones(len(self.changes)), 1.0
        for depth, speed in self.depths(places, target.within):
            nominal = min(nominal, float((depth >= 0.0).mean()))
            for block in parallel.blocks(len(shares), max(1, _BLOCK // len(places))):
                held = (depth + self.changes[block] @ speed.T >= 0.0).mean(axis=1)
                shares[block] = np.minimum(shares[block], held)
        return Spread(
            name=target.name,
            unit="1",
            nominal=nominal,
            mean=float(shares.mean()),
            deviation=float(shares.std()),
            quantile=float(np.quantile(shares, 0.05)),
            error=math.sqrt(max(nominal * (1.0 - nominal), 1.0 / len(places)) / len(places)),
        )


def region_places(target: Target) -> Array:
    """Places of a region by which its share is measured."""
    assert target.region is not None
    return target.region.places(_IN_REGION)
