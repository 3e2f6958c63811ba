"""The predicates again, in rational numbers: slow and beyond doubt."""

from collections.abc import Sequence
from fractions import Fraction

__all__ = ["exact_insphere", "exact_orient", "rational"]

Row = Sequence[Fraction]


def rational(point: Sequence[float]) -> list[Fraction]:
    """The exact value of floating-point coordinates."""
    return [Fraction(float(x)) for x in point]


def exact_orient(a: Row, b: Row, c: Row, d: Row) -> int:
    """Sign of det[b-a, c-a, d-a]."""
    return _sign(_det([_minus(p, a) for p in (b, c, d)]))


def exact_insphere(a: Row, b: Row, c: Row, d: Row, e: Row) -> int:
    """+1 if e is inside the sphere through a positively oriented abcd."""
    edges = [_minus(p, e) for p in (a, b, c, d)]
    return -_sign(_det([[*edge, sum(x * x for x in edge)] for edge in edges]))


def _minus(p: Row, q: Row) -> list[Fraction]:
    return [x - y for x, y in zip(p, q, strict=True)]


def _det(rows: Sequence[Row]) -> Fraction:
    if len(rows) == 1:
        return rows[0][0]
    return sum(
        ((-1) ** j * rows[0][j] * _det([[*r[:j], *r[j + 1 :]] for r in rows[1:]]))
        for j in range(len(rows))
    )


def _sign(x: Fraction) -> int:
    return (x > 0) - (x < 0)
