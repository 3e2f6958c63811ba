"""Points of the unit cube: (sampler, n, dim, seed) -> (n, dim), streamed in blocks.

A sequence depends on its four arguments alone: blocks only cut it.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from softreach.support.arguments import as_integer, as_one_of
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput

Draw = Callable[[int, int], Array]
"""(first, count) -> the points first .. first + count; called in order, without gaps."""

_LARGEST_SEED = 2**63 - 1  # what stores hold as a number


class Sampler(NamedTuple):
    """One way to spread points."""

    begin: Callable[[int, int, int], Draw]  # (n, dim, seed) -> a source of points
    refusal: Callable[[int, int], str | None]  # (n, dim) -> which n will do; None if n does


def sample_cube(sampler: str, n: int, dim: int, seed: int = 0) -> Array:
    """All n points at once [-], shape (n, dim).

    Samplers are `uniform` (the paper's), `boundary` (uniform, a fifth of the points on the faces),
    `counter` (uniform; each point follows from seed and number alone, on every device),
    `sobol` (scrambled, n a power of two) and `grid` (n a dim-th power, ends included).
    """
    n, seed = check_sampler(sampler, n, dim, seed)
    return next(cube_blocks(sampler, n, dim, seed, size=n))


def cube_blocks(sampler: str, n: int, dim: int, seed: int, size: int) -> Iterator[Array]:
    """The points of `sample_cube`, of checked arguments, in consecutive blocks up to `size`."""
    draw = (SAMPLERS[sampler].begin if dim else _uniform)(n, dim, seed)
    for first in range(0, n, size):
        yield draw(first, min(size, n - first))


def check_sampler(sampler: str, n: int, dim: int, seed: int) -> tuple[int, int]:
    """The n and the seed of a sampler, checked."""
    as_one_of("sampler", sampler, SAMPLERS)
    n = as_integer("n", n, 1)
    seed = as_integer("seed", seed, 0, _LARGEST_SEED)
    if dim and (advice := SAMPLERS[sampler].refusal(n, dim)) is not None:
        raise InvalidInput("n", n, advice)
    return n, seed


def _uniform(n: int, dim: int, seed: int) -> Draw:
    rng = np.random.default_rng(seed)
    return lambda first, count: rng.random((count, dim))


def _counter(n: int, dim: int, seed: int) -> Draw:
    return lambda first, count: counted_points(np.arange(first, first + count), dim, seed)


def counted_points(numbers: Index, dim: int, seed: int) -> Array:
    """The points of the sampler `counter` with these numbers [-], shape (n, dim)."""
    from softreach.kernels.counting import fill

    points = np.empty((len(numbers), dim))
    fill(np.uint64(seed), numbers.astype(np.uint64), points)
    return points


def _boundary(n: int, dim: int, seed: int) -> Draw:
    """Every fifth uniform point is moved onto a face, the 2 dim faces in turn."""
    inside = _uniform(n, dim, seed)

    def draw(first: int, count: int) -> Array:
        points = inside(first, count)
        rows = np.arange(-first % 5, count, 5)
        face = (first + rows) // 5 % (2 * dim)
        points[rows, face // 2] = face % 2
        return points

    return draw


def _sobol(n: int, dim: int, seed: int) -> Draw:
    from scipy.stats import qmc

    sequence = qmc.Sobol(dim, scramble=True, rng=np.random.default_rng(seed))
    # Blocks need not be powers of two, the whole is: its balance is what counts. SciPy would warn
    # of a first draw that is none, so that the first point is drawn by itself.
    start = sequence.random(1)

    def draw(first: int, count: int) -> Array:
        if first or not count:
            return sequence.random(count)
        return np.concatenate([start, sequence.random(count - 1)]) if count > 1 else start

    return draw


def _grid(n: int, dim: int, seed: int) -> Draw:
    """A lattice with both ends, the last coordinate running fastest."""
    side = _root(n, dim)
    ticks = np.linspace(0.0, 1.0, side) if side > 1 else np.array([0.5])

    def draw(first: int, count: int) -> Array:
        index = np.unravel_index(np.arange(first, first + count), (side,) * dim)
        return ticks[np.stack(index, axis=1)]

    return draw


def _power_of_two(n: int, dim: int) -> str | None:
    if n & (n - 1) == 0:
        return None
    low = 1 << (n.bit_length() - 1)
    return f"a power of two for the sobol sampler, {low} or {2 * low} for instance"


def _whole_power(n: int, dim: int) -> str | None:
    side = _root(n, dim)
    if side**dim == n:
        return None
    near = (f"{k}^{dim} = {k**dim}" for k in (side, side + 1) if k > 0)
    return f"k^{dim} for the grid sampler with {dim} bundles, {' or '.join(near)} for instance"


def _root(n: int, dim: int) -> int:
    """The largest whole number whose dim-th power is within n."""
    side = round(n ** (1 / dim))
    return side if side**dim <= n else side - 1


SAMPLERS: dict[str, Sampler] = {
    "uniform": Sampler(_uniform, lambda n, dim: None),
    "boundary": Sampler(_boundary, lambda n, dim: None),
    "counter": Sampler(_counter, lambda n, dim: None),
    "sobol": Sampler(_sobol, _power_of_two),
    "grid": Sampler(_grid, _whole_power),
}
