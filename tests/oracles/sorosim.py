"""The 500 equilibria of a steel rod that SoRoSim computed: `tests/data/README.md`.

`python -m tests.oracles.sorosim` compares all of them with the shooting of `loaded_rod`.
"""

import csv
import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests.oracles.loaded_rod import equilibrium
from tests.oracles.rod import Loads, PointLoad, Rod

Array = NDArray[np.float64]

FILE = Path(__file__).parent.parent / "data" / "sorosim_steel.csv"
LENGTH, RADIUS, YOUNG_MODULUS, POISSON_RATIO, DENSITY = 0.6, 0.8e-3, 200e9, 0.33, 7870.0
_HALF = np.array([0.0, 0.0469, 0.2308, 0.5, 0.7692, 0.9531, 1.0])
STATIONS = LENGTH / 2 * np.concatenate([_HALF, 1 + _HALF])
"""Z of the 14 stations [m]; the middle occurs twice."""


class Case(NamedTuple):
    """One equilibrium."""

    loads: Loads
    place: Array
    """[m], shape (14, 3)."""
    angles: Array
    """a, b, c of the rotation Rx(a) Ry(b) Rz(c) from the base [rad], shape (14, 3)."""


def cases() -> list[Case]:
    """All 500."""
    with FILE.open(encoding="utf-8", newline="") as lines:
        rows = [[float(value) for value in row[1:]] for row in list(csv.reader(lines))[2:]]
    return [_case(block) for block in np.array(rows).reshape(-1, 6, len(rows[0]))]


def steel_rod() -> Rod:
    """The rod, along x."""
    area = math.pi * RADIUS**2
    bending = YOUNG_MODULUS * area * RADIUS**2 / 4
    return Rod(
        length=LENGTH,
        axial=lambda z: YOUNG_MODULUS * area,
        bending=lambda z: bending,
        torsion=lambda z: bending / (1 + POISSON_RATIO),
        mass=lambda z: DENSITY * area,
        base=((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    )


def deviation(case: Case, *, rtol: float = 1e-9) -> float:
    """Largest distance along the arm from the shooting of `loaded_rod` [m]."""
    found = equilibrium(steel_rod(), case.loads, STATIONS, rtol=rtol)
    if not found.converged:
        return math.inf
    return float(np.linalg.norm(found.place - case.place, axis=1).max())


def _case(block: Array) -> Case:
    _, gravity, mid_moment, mid_force, tip_moment, tip_force = map(
        tuple, block[:, :3].T.reshape(6, 3).tolist()
    )
    middle = PointLoad(place=LENGTH / 2, force=mid_force, moment=mid_moment)
    wrench = {"tip_force": tip_force, "tip_moment": tip_moment}
    loads = Loads(gravity=gravity, points=(middle,), **wrench)
    return Case(loads, block[3:, 3:].T, block[:3, 3:].T)


if __name__ == "__main__":
    worst = 1e3 * np.array([deviation(case) for case in cases()])
    sys.stdout.write(
        f"{len(worst)} equilibria, {np.isfinite(worst).sum()} found; largest distance along the "
        f"arm: median {np.median(worst):.3f} mm, worst {worst.max():.3f} mm\n"
    )
