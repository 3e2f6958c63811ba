"""How much arithmetic kernels need, counted by running them on numbers that count themselves.

Run with NUMBA_DISABLE_JIT=1 and a number of bundles: prints the floating-point operations of one
step of one arm. With a file of points instead: prints those of each test of a triangulation, and
how many tests a point takes.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from softreach.kernels.points import bowyer_watson
from softreach.kernels.rod.magnus import act, exponent


class Counted:
    """A number that counts the additions and multiplications done with it.

    Zeros and ones written into the code are folded by the compiler and cost nothing.
    """

    operations: ClassVar[int] = 0

    @staticmethod
    def _binary(neutral):
        def operate(_, other):
            if isinstance(other, float | int) and other == 0 and neutral == 1:
                return 0.0
            if not (isinstance(other, float | int) and other in (neutral, -neutral)):
                Counted.operations += 1
            return Counted()

        return operate

    def __abs__(self) -> Counted:
        return self

    def __gt__(self, other: object) -> bool:
        return False


Counted.__add__ = Counted.__radd__ = Counted.__sub__ = Counted.__rsub__ = Counted._binary(0)
Counted.__mul__ = Counted.__rmul__ = Counted._binary(1)


def flops_per_step(bundles: int) -> int:
    """Additions and multiplications of a step: 12 node values, 9 products, exponent, action."""
    node_values = 12 * 2 * bundles
    products = 9

    def twist():
        x = Counted()
        return x, x, x, 0.0, 0.0, x

    point = (Counted(), Counted(), Counted())
    Counted.operations = 0
    act(exponent(twist(), twist(), twist()), point)
    return node_values + products + Counted.operations


TESTS = {"insphere_filter": 5, "orient_filter": 4}
"""Tests that a triangulation consists of, and the points of each."""


def tests_of_triangulation(points: np.ndarray) -> dict[str, tuple[int, float]]:
    """Operations of each test, and how many of it one of these points takes on average."""
    calls, operations = Counter[str](), dict[str, int]()
    for name, corners in TESTS.items():
        test = getattr(bowyer_watson, name)
        Counted.operations = 0
        test(np.array([[Counted() for _ in range(3)] for _ in range(corners)]), *range(corners))
        operations[name] = Counted.operations
        setattr(bowyer_watson, name, _counting(calls, name, test))
    with np.errstate(over="ignore"):  # a random number wraps around
        bowyer_watson.triangulate(points, lambda: False)
    return {name: (operations[name], calls[name] / len(points)) for name in TESTS}


def _counting(calls: Counter[str], name: str, test: Callable[..., float]) -> Callable[..., float]:
    def counted(*arguments: Any) -> float:
        calls[name] += 1
        return test(*arguments)

    return counted


if __name__ == "__main__":
    if sys.argv[1].isdigit():
        print(flops_per_step(int(sys.argv[1])))
    else:
        print(json.dumps(tests_of_triangulation(np.load(sys.argv[1]))))
