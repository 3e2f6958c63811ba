"""How much arithmetic our tip kernel needs, counted by running it on numbers that count themselves.

Run with NUMBA_DISABLE_JIT=1; prints the floating-point operations of one step of one arm.
"""

from __future__ import annotations

import sys
from typing import ClassVar

from softreach.kernels.rod.magnus import exponent
from softreach.kernels.rod.twist import act


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


if __name__ == "__main__":
    print(flops_per_step(int(sys.argv[1])))
