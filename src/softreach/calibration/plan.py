"""Poses worth measuring: those that tell most about the free numbers of an arm."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.calibration.fit import identifiable
from softreach.calibration.free_numbers import FreeNumbers, free_numbers
from softreach.calibration.measurements import marker_names
from softreach.calibration.model import MarkerModel
from softreach.rod.tip_map import TipStatus
from softreach.sampling import sample_cube
from softreach.schema import provenance
from softreach.support.arguments import as_integer, as_names, as_number
from softreach.support.arrays import Array, Mask, over
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.support.files.text import write_table
from softreach.support.lazy import Dataset

_CORNERS = 10  # free inputs up to which all corners of their box are candidates
_APART = 0.5  # distance of two poses in the box at least, over the mean distance of so many points
_TRUSTED = 2.0  # Largest reaction of a pose to the numbers that counts in full, over the median
_ROUNDS = 50
_GAIN = 1e-6  # least gain of the logarithm of the determinant for which a pose is exchanged
_START = 1e-9  # information on each number before the first pose, over that of all candidates
_WRITTEN = {"m": ("mm", 1e3), "Pa": ("kPa", 1e-3), "N": ("N", 1.0)}


@dataclass(frozen=True, eq=False, repr=False)
class PosePlan:
    """Activations at which to measure an arm, and how well its free numbers then are known."""

    free: FreeNumbers
    """The numbers, at whose values the plan is made."""
    markers: tuple[str, ...]
    """Markers that are going to be seen."""
    activations: Array
    """Inputs of the arm [unit of each], in an order by chance; shape (n, input)."""
    information: Array
    """JᵀJ of all places by the numbers [m² over the units of both], shape (number, number)."""

    def __len__(self) -> int:
        return len(self.activations)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free numbers."""
        return self.free.names

    def sigma(self, noise: float) -> dict[str, float]:
        """Standard deviations to expect of the numbers, in their units.

        Args:
            noise: Standard deviation of a coordinate of a marker [m]: of the measurement, and of
                all that the model does not have.
        """
        noise, scale = as_number("noise", noise, Range(0.0, 1.0, "m", True)), self.free.scale
        inverse = np.linalg.inv(self.information * np.outer(scale, scale))
        widths = noise * scale * np.sqrt(np.diag(inverse))
        return dict(zip(self.names, widths.tolist(), strict=True))

    def to_dataset(self, noise: float = 1e-3) -> Dataset:
        """Activations over `pose`; values, standard deviations to expect and JᵀJ over `number`.

        Args:
            noise: As for `sigma`.
        """
        import xarray as xr

        arm, numbers = self.free.arm, self.free.numbers
        values = over(("pose", "input"), activation=self.activations)
        values |= over("number", value=self.free.start, sigma=list(self.sigma(noise).values()))
        values |= over(("number", "other"), information=self.information)
        names = {"number": list(self.names), "other": list(self.names)}
        names |= {"input": list(arm.input_names)} | over("number", unit=[n.unit for n in numbers])
        names |= over("input", input_unit=list(arm.input_units))
        about = {**provenance(arm), "noise": noise, "markers": ", ".join(self.markers)}
        return xr.Dataset(values, names, about)

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write a CSV to fill in: a column for each input, and empty ones for the markers.

        Args:
            path: The file.
            overwrite: Whether it may replace a file.

        Raises:
            InvalidInput: Something else is there.
            NotWritten: It cannot be written.
        """
        import pandas as pd

        arm = self.free.arm
        columns: dict[str, Any] = {"sample": range(len(self))}
        for k, (name, unit) in enumerate(zip(arm.input_names, arm.input_units, strict=True)):
            written, size = _WRITTEN.get(unit, ("", 1.0))
            columns["_".join([*name.split(), *written.split()])] = size * self.activations[:, k]
        names = ("_".join(name.split()) for name in self.markers)
        empty = dict.fromkeys((f"{name}_{axis}_mm" for name in names for axis in "xyz"), "")
        write_table(path, pd.DataFrame(columns | empty), overwrite=overwrite)

    def __repr__(self) -> str:
        seen = ", ".join(self.markers)
        return f"PosePlan: {len(self)} poses of {seen} for {', '.join(self.names)}"


def plan_poses(
    arm: Manipulator,
    free: Sequence[str],
    n: int = 20,
    *,
    markers: Sequence[str] | None = None,
    candidates: int = 2000,
    seed: int = 0,
) -> PosePlan:
    """The poses from which a calibration learns most about the free numbers.

    Of poses all over the activation box and at its corners those with the largest determinant of
    JᵀJ, by exchange of one pose after another [Fedorov1972]; J are the derivatives of the places of
    the markers by the numbers, at the values of the design. As these are not yet known, poses
    keep a distance in the box, and those that react to the numbers far more than most count less.

    Args:
        arm: The design; the nearer to the real arm, the better is the choice.
        free: As in `calibrate`.
        n: Number of poses.
        markers: Names of the markers that are going to be seen; None for all.
        candidates: Number of poses to choose from.
        seed: Of the candidates, and of the order in which to measure.

    Raises:
        InvalidInput: Numbers that no pose can tell apart, or fewer poses than these need.
        NotPossible: No candidate has a stable equilibrium.
    """
    arm = a_manipulator("arm", arm)
    numbers = free_numbers(arm, free)
    candidates = as_integer("candidates", candidates, 2, 200_000)
    n, seed = as_integer("n", n, 1, candidates), as_integer("seed", seed)
    known, (low, high) = marker_names(arm), arm.input_bounds.T
    names = known if markers is None else as_names("markers", markers)
    if not names or {*names} - {*known} or len({*names}) < len(names):
        allowed = f"of {', '.join(known)}, each once"
        raise InvalidInput("markers", ", ".join(names) or "none", allowed)
    moving = low < high
    cube = _candidates(int(moving.sum()), candidates, seed)
    inputs = np.tile(low, (len(cube), 1))
    inputs[:, moving] += cube * (high - low)[moving]
    prediction = MarkerModel(numbers, inputs, names).predict(numbers.start, slopes=True)
    usable = np.isfinite(prediction.slopes).all(axis=(1, 2, 3))
    usable &= prediction.status == TipStatus.STABLE
    if not usable.any():
        raise NotPossible("the arm has no stable equilibrium in its activation box")
    inputs = inputs[usable]
    slopes = prediction.slopes[usable].reshape(len(inputs), -1, len(numbers))
    identifiable(numbers, slopes.reshape(-1, len(numbers)))
    least = -(-len(numbers) // slopes.shape[1])
    if not least <= n <= len(inputs):
        allowed = f"from {least} for these {len(numbers)} numbers to {len(inputs):,} candidates"
        raise InvalidInput("n", n, allowed)
    # An arm about to snap reacts to everything, and that at activations which are not known yet.
    trusted = slopes * numbers.scale
    size = np.linalg.norm(trusted, axis=(1, 2))
    trusted /= np.sqrt(1.0 + (size / (_TRUSTED * np.median(size))) ** 2)[:, None, None]
    chosen = _chosen(trusted, cube[usable], n)
    np.random.default_rng(seed).shuffle(chosen)
    identifiable(numbers, own := slopes[chosen].reshape(-1, len(numbers)))
    return PosePlan(numbers, names, inputs[chosen], own.T @ own)


def _candidates(dim: int, count: int, seed: int) -> Array:
    """Places all over the unit cube, then corners of it, shape (n, dim)."""
    inside = sample_cube("sobol", 1 << (count - 1).bit_length(), dim, seed)[:count]
    if dim <= _CORNERS:
        return np.concatenate([inside, [*np.ndindex(*[2] * dim)]])
    draw = np.random.default_rng(seed).integers(0, 2, (1 << _CORNERS, dim))
    return np.concatenate([inside, np.unique(draw, axis=0).astype(float)])


def _chosen(slopes: Array, at: Array, n: int) -> NDArray[np.intp]:
    """Rows with a large determinant of JᵀJ: one after another, then by exchange.

    No two of them are nearer in the unit cube than half of the mean distance of n points.
    """
    each = np.einsum("crp,crq->cpq", slopes, slopes)
    total = _START * np.trace(each.sum(axis=0)) / each.shape[1] * np.eye(each.shape[1])
    room = _APART * n ** (-1.0 / max(at.shape[1], 1))
    near = np.zeros(len(slopes), int)  # chosen poses that each candidate is too near to
    chosen: list[int] = []
    for _ in range(n):
        chosen.append(best := _best(slopes, total, near))
        near += _within(at, best, room)
        total = total + each[best]
    for _ in range(_ROUNDS):
        before = np.linalg.slogdet(total)[1]
        for place, old in enumerate(chosen):
            near -= _within(at, old, room)
            rest = total - each[old]
            chosen[place] = best = _best(slopes, rest, near)
            near += _within(at, best, room)
            total = rest + each[best]
        if np.linalg.slogdet(total)[1] - before < _GAIN:
            break
    return np.array(chosen, np.intp)


def _within(at: Array, place: int, room: float) -> Mask:
    """Candidates that are too near to one that is chosen, itself among them."""
    return np.linalg.norm(at - at[place], axis=1) < room


def _best(slopes: Array, total: Array, near: NDArray[np.int_]) -> int:
    """The candidate that adds most to ln det of the information, of those near the fewest."""
    half = np.linalg.cholesky(np.linalg.inv(0.5 * (total + total.T)))
    along = slopes @ half
    gains = np.linalg.slogdet(np.eye(slopes.shape[1]) + along @ along.transpose(0, 2, 1))[1]
    return int(np.argmax(np.where(near == near.min(), gains, -np.inf)))
