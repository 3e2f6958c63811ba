"""Baselines without a rod: constant curvature, and a quadratic ridge."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from softreach.arm.driving import Driving, body_of
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import tables
from softreach.calibration.measurements import Measurements
from softreach.calibration.model import marker_places, marker_stations
from softreach.support.arrays import Array, Mask
from softreach.support.progress import Progress, silent

_SHARES = (1.0, 0.2)  # of the bends of the design, at which the fit of arcs begins
_PENALTIES = np.logspace(-8, 2, 21)


def ridge(features: Array, target: Array) -> Callable[[Array], Array]:
    """Linear law of features (n, feature) with the penalty of least generalized cross-validation.

    It predicts targets (n, number) of other rows of features.
    """
    middle, size = features.mean(axis=0), features.std(axis=0)
    size = np.where(size > 0, size, 1.0)
    scaled, mean = (features - middle) / size, target.mean(axis=0)
    left, values, axes = np.linalg.svd(scaled, full_matrices=False)
    along, n = left.T @ (target - mean), len(features)
    total = ((target - mean) ** 2).sum() - (along**2).sum()

    def cross_validation(penalty: float) -> float:
        keep = values**2 / (values**2 + n * penalty)
        left = total + (((1.0 - keep)[:, None] * along) ** 2).sum()
        return left / max(n - 1.0 - keep.sum(), 1e-3) ** 2

    best = min(_PENALTIES, key=cross_validation)
    weights = axes.T @ ((values / (values**2 + n * best))[:, None] * along)
    return lambda rows: mean + ((rows - middle) / size) @ weights


def quadratic(train: Measurements, test: Measurements) -> tuple[Array, int]:
    """Places of the test samples by a ridge on inputs, their squares and products.

    Returns:
        Places, (n, marker, 3), NaN for a marker that is missing in training; and how many numbers
        it has.
    """
    middle = train.inputs.mean(axis=0)
    size = np.where(np.ptp(train.inputs, axis=0) > 0, np.ptp(train.inputs, axis=0), 1.0)

    def features(inputs: Array) -> Array:
        x = (inputs - middle) / size
        j, k = np.triu_indices(x.shape[1])
        return np.concatenate([x, x[:, j] * x[:, k]], axis=1)

    places = np.full((len(test), test.markers, 3), np.nan)
    for marker in range(test.markers):
        known = np.isfinite(train.places[:, marker]).all(axis=1)
        if known.sum() > 1:
            law = ridge(features(train.inputs[known]), train.places[known, marker])
            places[:, marker] = law(features(test.inputs))
    count = 1 + features(train.inputs[:1]).shape[1]
    return places, 3 * train.markers * count


def constant_curvature(
    arm: Manipulator, train: Measurements, test: Measurements, progress: Progress = silent
) -> tuple[Array, int]:
    """Places of the test samples by arcs of circles, one between each two ends of actuators.

    The bend of an arc is linear in the inputs that act on it; the base stands anywhere.

    Returns:
        Places, (n, marker, 3), and how many numbers were fitted.
    """
    from scipy.optimize import least_squares

    arcs = _Arcs.of(arm, train)
    seen = np.isfinite(train.places)

    def residuals(values: Array) -> Array:
        progress(0)  # which may end the fit
        return (arcs.places(values, train.inputs) - train.places)[seen]

    tries = [
        least_squares(residuals, arcs.start(arm, share), x_scale="jac", max_nfev=60)
        for share in _SHARES
    ]
    best = min(tries, key=lambda result: result.cost)
    return arcs.places(best.x, test.inputs), len(best.x)


class _Arcs(NamedTuple):
    ends: Array
    acts: Mask
    scale: Array
    markers: Array
    offsets: Array

    @classmethod
    def of(cls, arm: Manipulator, data: Measurements) -> _Arcs:
        stations, offsets = marker_stations(arm)
        measured = marker_places(arm, data.marker_names)
        ends = [part.span(arm.length)[1] for part in arm.actuators]
        whole = np.unique(np.round([*ends, arm.length], 9))
        middles = 0.5 * (np.append(0.0, whole[:-1]) + whole)
        each = (part.acts(arm.profile, middles) for part in arm.actuators)
        acts = np.concatenate([np.empty((len(whole), 0), bool), *each], axis=1)
        gains = Driving(arm).widths[: arm.bundles]
        acts = acts.astype(float) @ gains > 0
        moves = np.ptp(data.inputs, axis=0) > 0
        scale = np.where(moves, np.abs(data.inputs).max(axis=0), 1.0)
        return cls(whole, acts & moves, scale, stations[measured], offsets[measured])

    def start(self, arm: Manipulator, share: float) -> Array:
        """A share of the bends that the design has in the middle of each arc, without loads."""
        from scipy.spatial.transform import Rotation

        middles = 0.5 * (np.append(0.0, self.ends[:-1]) + self.ends)
        body, gains = body_of(arm), Driving(arm).gains
        slopes = np.moveaxis(tables(body, middles).curvature[:, :2] @ gains, 1, 2)
        slopes = slopes * self.scale[:, None]
        most = np.abs(slopes).max(initial=0.0)
        if any(unit == "m" for unit in arm.bundle_units) or not np.isfinite(most):
            slopes *= 1.0 / (arm.length * max(most, 1e-12))
        vector = Rotation.from_matrix(arm.base.rotation).as_rotvec()
        rest = np.zeros(2 * len(self.ends))
        return np.concatenate([arm.base.position, vector, rest, share * slopes[self.acts].ravel()])

    def places(self, values: Array, inputs: Array) -> Array:
        """Of the markers, (n, marker, 3)."""
        from scipy.spatial.transform import Rotation

        count = len(self.ends)
        rest = values[6 : 6 + 2 * count].reshape(count, 2)
        slopes = np.zeros((count, inputs.shape[1], 2))
        slopes[self.acts] = values[6 + 2 * count :].reshape(-1, 2)
        x = inputs / self.scale
        place = np.broadcast_to(values[:3], (len(x), 3))
        frame = np.broadcast_to(Rotation.from_rotvec(values[3:6]).as_matrix(), (len(x), 3, 3))
        result, begin = np.empty((len(x), len(self.markers), 3)), 0.0
        for k, end in enumerate(self.ends):
            bend = rest[k] + x @ slopes[k]
            last = k == count - 1
            for m, z in enumerate(self.markers):
                if begin <= z < end or (last and z >= end):
                    along, turn = _arc(bend, z - begin)
                    along = along + turn @ self.offsets[m]
                    result[:, m] = place + np.einsum("nab,nb->na", frame, along)
            along, turn = _arc(bend, end - begin)
            place = place + np.einsum("nab,nb->na", frame, along)
            frame = frame @ turn
            begin = end
        return result


def _arc(bend: Array, length: float) -> tuple[Array, Array]:
    """End of arcs that bend by (u1, u2), and their rotations."""
    from scipy.spatial.transform import Rotation

    size = np.linalg.norm(bend, axis=1)
    angle = size * length
    across = np.stack([bend[:, 1], -bend[:, 0]], axis=1)  # toward which u bends e3
    lean = 0.5 * length**2 * np.sinc(angle / (2 * np.pi)) ** 2
    rise = length * np.sinc(angle / np.pi)
    place = np.concatenate([across * lean[:, None], rise[:, None]], axis=1)
    vector = np.concatenate([bend * length, np.zeros((len(bend), 1))], axis=1)
    return place, Rotation.from_rotvec(vector).as_matrix()
