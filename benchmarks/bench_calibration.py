"""Measured arms: rods of more and more numbers beside what a laboratory would use, held out.

`python -m benchmarks.bench_calibration [robot]` prints a Markdown table, that of all robots into
the documentation; under pytest-benchmark one small fit runs.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

import softreach as sr
from benchmarks.table import VALIDATION, put_between_marks
from softreach.arm import (
    Chamber,
    Drive,
    LengthTendon,
    LinearTaper,
    Manipulator,
    Marker,
    Material,
    Measured,
    PiecewiseTaper,
    RigidPiece,
    Ring,
    Samples,
    Section,
    Tendon,
)
from softreach.calibration import Measurements, PlacementErrors, read_measurements
from softreach.calibration.calibration import constant_curvature, quadratic
from softreach.calibration.errors import misses
from softreach.rod.kinematics import marker_positions

DATA = Path(__file__).parent / "data"
MODULUS, DENSITY = "rings[0].material.young_modulus", "rings[0].material.density"


def tentacle() -> Manipulator:
    """A cone of silicone that hangs, two tendons, four markers."""
    silicone = Material(young_modulus=315e3, poisson_ratio=0.45, density=1318.0)
    away = Samples(
        stations_over_length=(0.0, 1.0),
        values=(0.0114, 0.0114 - 0.0295 * 0.36),
        interpolation="linear",
    )
    tendons = tuple(
        Tendon(
            name=f"tendon {k}",
            distance=away,
            offset=np.radians(angle),
            end=0.305,
            activation_bounds=(0.0, 8.0),
        )
        for k, angle in ((1, -60.0), (2, 60.0))
    )
    places = (0.1291, 0.025, 0.0), (0.2195, -0.021, 0.0), (0.28, 0.02, 0.0), (0.36, 0.0, 0.008)
    return Manipulator(
        profile=PiecewiseTaper(
            length=0.36,
            stations_over_length=(0.0, 0.305 / 0.36, 1.0),
            radii=(0.01541, 0.00642, 0.0048),
        ),
        section=Section(rings=(Ring(inner_ratio=0.0, material=silicone),)),
        actuators=tendons,
        loads=sr.Loads(),
        base=sr.Base(points="down", position=(-0.03, 0.0, 0.013)),
        markers=tuple(
            Marker(name=f"marker{k + 1}", station=z, offset=(x, 0.0, ahead))
            for k, (z, x, ahead) in enumerate(places)
        ),
    )


def wire(lengths: tuple[float, ...], angles: tuple[float, ...], modulus: float) -> Manipulator:
    """A wire with three segments of three tendons that are driven by length."""
    ends = np.cumsum(lengths)
    tendons = tuple(
        LengthTendon(
            name=f"s{k + 1}",
            bundles=3,
            distance=0.0045,
            offset=np.radians(angle),
            end=float(end) if k < 2 else None,
            activation_bounds=(-0.01, 0.02),
            tendon_stiffness=1e4,
        )
        for k, (end, angle) in enumerate(zip(ends, angles, strict=True))
    )
    steel = Material(young_modulus=modulus, poisson_ratio=0.3, density=0.0)
    return Manipulator(
        profile=LinearTaper(length=float(ends[-1]), outer_radius=0.0005),
        section=Section(rings=(Ring(inner_ratio=0.0, material=steel),)),
        actuators=tendons,
    )


def hose() -> Manipulator:
    """A vacuum hose that hangs, six motors that each pull one of two opposite tendons."""
    angles, disks = (165, 45, 195, 105, 315, 255), (3, 2, 1, 1, 2, 3)
    tendons, drives = [], []
    for k, (angle, disk) in enumerate(zip(angles, disks, strict=True), start=1):
        for sign, turn in (("+", 0.0), ("-", 180.0)):
            tendons.append(
                Tendon(
                    name=f"m{k}{sign}",
                    distance=0.02,
                    offset=np.radians(angle + turn),
                    end=f"disk{disk}",
                    activation_bounds=(0.0, 40.0),
                )
            )
        gains, offsets = {f"m{k}+": 5.0, f"m{k}-": -5.0}, {f"m{k}+": 15.0, f"m{k}-": 15.0}
        drives.append(Drive(name=f"u{k}", bounds=(-1, 1), gains=gains, offsets=offsets))
    measured = Measured(
        axial_stiffness=2000.0, bending_stiffness=0.05, torsion_stiffness=0.05, mass_per_length=0.3
    )
    return Manipulator(
        profile=LinearTaper(length=0.3, outer_radius=0.02),
        section=Section(rings=(Ring(inner_ratio=0.8, material=Material()),), measured=measured),
        actuators=tuple(tendons),
        drives=tuple(drives),
        loads=sr.Loads(gravity=(0.0, -9.81, 0.0)),
        base=sr.Base(points="-y", position=(0.1, 0.0, 0.105)),
        stations={"disk1": 0.1, "disk2": 0.2, "disk3": 0.3},
        markers=(
            Marker(name="disk1", station="disk1"),
            Marker(name="disk2", station="disk2"),
            Marker(name="disk3", offset=(0.0, 0.0, 0.02)),
        ),
    )


def cable(guides: int) -> Manipulator:
    """A soft spine with three cables that are driven by length, counted clockwise."""
    cables = LengthTendon(
        name="s1",
        bundles=3,
        distance=0.004,
        offset=(0.0, np.radians(-120.0), np.radians(-240.0)),
        activation_bounds=(-0.002, 0.012),
        tendon_stiffness=1e4,
        guides=guides,
    )
    measured = Measured(axial_stiffness=300.0, bending_stiffness=2.5e-3, torsion_stiffness=2e-3)
    return Manipulator(
        profile=LinearTaper(length=0.11, outer_radius=0.0005),
        section=Section(rings=(Ring(inner_ratio=0.0, material=Material()),), measured=measured),
        actuators=(cables,),
        base=sr.Base(points="-y"),
    )


def bellows() -> Manipulator:
    """Two segments that hang, three bladders each, rigid pieces behind them."""
    ends = np.cumsum((0.12, 0.037, 0.12, 0.022)).tolist()
    area, radius = 0.025 * 0.060, 0.012
    own = {
        "bundles": 3,
        "offset": np.radians((180.0, 0.0, 90.0)),
        "distance": 0.032,
        "radius": radius,
        "area_factor": area / (np.pi * radius**2),
        "activation_bounds": (0.0, 1e5),
    }
    measured = Measured(
        axial_stiffness=2000.0, bending_stiffness=2.0, torsion_stiffness=2.0, mass_per_length=1.0
    )
    return Manipulator(
        profile=LinearTaper(length=ends[-1], outer_radius=0.05),
        section=Section(rings=(Ring(inner_ratio=0.9, material=Material()),), measured=measured),
        actuators=(
            Chamber(name="s2", end=ends[0], **own),
            Chamber(name="s1", start=ends[1], end=ends[2], **own),
        ),
        rigid_pieces=(RigidPiece(start=ends[0], end=ends[1]), RigidPiece(start=ends[2])),
        loads=sr.Loads(),
        base=sr.Base(points="down", position=(0.007, -0.211, 0.559)),
        markers=(Marker(name="middle", station=ends[1]), Marker(name="tip", station=ends[3])),
    )


STIFF = "s1.tendon_stiffness = s2.tendon_stiffness = s3.tendon_stiffness"
WIRES = [
    ["pose"],
    ["pose", "s2.offset", STIFF],
    ["pose", "s2.offset", "s3.offset", STIFF, "s1.slack", "s2.slack", "s3.slack"],
    [
        "pose",
        "s2.offset",
        "s3.offset",
        STIFF,
        "s1.slack",
        "s2.slack",
        "s3.slack",
        "rest.curvature_x",
    ],
    ["pose", "s2.offset", "s3.offset", STIFF, "s1.slack[*]", "s2.slack[*]", "s3.slack[*]"],
]


class Robot(NamedTuple):
    """A measured arm, and how it is fitted."""

    name: str
    arm: Manipulator
    file: str
    columns: dict[str, object]
    free: list[list[str]]
    train: int
    """Most samples of a fit."""


def robots() -> list[Robot]:
    """All six."""
    ends = ["markers.marker1.station", "markers.marker2.station"]
    gains = [f"u{k}.gain" for k in range(1, 7)]
    v4 = wire((0.06, 0.0625, 0.064), (-175.3, -146.8, -117.5), 50e9)
    v6 = wire((0.1, 0.1, 0.022), (0.0, 30.0, 60.0), 10e9)
    words = ("left", "right", "mid")
    bladders = {
        f"{s} {k}": f"{s}_{word}_psi" for s in ("s1", "s2") for k, word in enumerate(words, 1)
    }
    softness = ["pose", "s1.distance", "measured.axial_stiffness"]
    bending = ["pose", "measured.bending_stiffness"]
    disks = {"markers": {"disk1": "1", "disk2": "2", "disk3": "3"}}
    return [
        Robot(
            "silicone tentacle",
            tentacle(),
            "soromox_tentacle.csv.gz",
            {},
            [
                [],
                [MODULUS, DENSITY],
                [MODULUS, "profile.radii[2]", *ends, "pose.rx", "pose.rz"],
                [MODULUS, DENSITY, "pose"],
            ],
            99,
        ),
        Robot("tendon robot v4", v4, "opencr_v4.csv.gz", {}, WIRES, 270),
        Robot("tendon robot v6", v6, "opencr_v6.csv.gz", {}, WIRES, 270),
        Robot(
            "hose",
            hose(),
            "asl_trunk.csv.gz",
            disks,
            [["pose"], ["pose", *gains[:2]], ["pose", *gains, "measured.mass_per_length"]],
            300,
        ),
        Robot("cable arm, guides everywhere", cable(0), "armlab_cable.csv.gz", {}, [softness], 270),
        Robot("cable arm, five guides", cable(5), "armlab_cable.csv.gz", {}, [softness], 270),
        Robot(
            "bellows",
            bellows(),
            "asu_pneumatic.csv.gz",
            {"inputs": bladders},
            [bending, [*bending, "measured.axial_stiffness", "rest.curvature_*"]],
            58,
        ),
    ]


def split(data: Measurements, train: int) -> tuple[Measurements, Measurements]:
    """Samples of a fit and others, by chance; of few samples every third is held out."""
    if len(data) < 90:
        held = np.arange(len(data)) % 3 == 1
        return data.of(~held), data.of(held)
    order = np.random.default_rng(0).permutation(len(data))
    return data.of(np.sort(order[:train])), data.of(np.sort(order[train : 3 * train]))


def gaussian_process(train: Measurements, test: Measurements) -> np.ndarray:
    """Places of the test samples by Gaussian processes, one width for each input."""
    moving = np.ptp(train.inputs, axis=0) > 0
    middle, size = train.inputs.mean(axis=0)[moving], train.inputs.std(axis=0)[moving]
    x, new = ((each.inputs[:, moving] - middle) / size for each in (train, test))
    y = train.places.reshape(len(train), -1)
    mean, spread = y.mean(axis=0), y.std()
    y = (y - mean) / spread

    def kernel(a: np.ndarray, b: np.ndarray, widths: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * cdist(a / widths, b / widths, "sqeuclidean"))

    def cost(logs: np.ndarray) -> float:
        widths, noise = np.exp(logs[:-1]), np.exp(logs[-1])
        try:
            root = np.linalg.cholesky(kernel(x, x, widths) + noise * np.eye(len(x)))
        except np.linalg.LinAlgError:
            return 1e12
        solved = np.linalg.solve(root, y)
        square = float((solved**2).sum()) / y.shape[1]
        return len(x) * np.log(square) + 2.0 * float(np.log(np.diag(root)).sum())

    best = minimize(
        cost,
        np.append(np.full(moving.sum(), np.log(2.0)), np.log(1e-2)),
        method="L-BFGS-B",
        bounds=[(-2.0, 5.0)] * int(moving.sum()) + [(-14.0, 1.0)],
        options={"maxiter": 30},
    )
    widths, noise = np.exp(best.x[:-1]), np.exp(best.x[-1])
    weights = np.linalg.solve(kernel(x, x, widths) + noise * np.eye(len(x)), y)
    return (mean + spread * kernel(new, x, widths) @ weights).reshape(test.places.shape)


class Row(NamedTuple):
    """A law and its errors."""

    law: str
    numbers: int
    held_out: PlacementErrors
    coverage: float = np.nan
    """Share of held-out coordinates within two standard deviations of their prediction."""


def _rows(robot: Robot, train: Measurements, test: Measurements) -> Iterator[Row]:
    def row(law: str, numbers: int, places: np.ndarray) -> Row:
        return Row(law, numbers, misses(places - test.places))

    for free in robot.free:
        if not free:  # as the source has it
            yield row("softreach", 0, marker_positions(robot.arm, test.inputs))
            continue
        result = sr.calibrate(robot.arm, train, free=free, rivals=False)
        places = result.residuals_on(test) + test.places
        left, sigma = np.abs(places - test.places), result.predict(test.inputs)[1]
        within = float((left <= 2.0 * sigma)[np.isfinite(left)].mean())
        yield row("softreach", len(result.names), places)._replace(coverage=within)
    places, numbers = constant_curvature(robot.arm, train, test)
    yield row("constant curvature", numbers, places)
    places, numbers = quadratic(train, test)
    yield row("quadratic ridge", numbers, places)
    yield row("Gaussian process", len(train), gaussian_process(train, test))


HEAD = """\
| arm | softreach | within 2σ | constant curvature | quadratic ridge | Gaussian process |
|---|--:|--:|--:|--:|--:|
"""


def _robot_row(robot: Robot) -> str:
    """Errors of one arm by its last fit and by other laws: rms and median, behind the numbers."""
    data = read_measurements(robot.arm, DATA / robot.file, **robot.columns)  # pyright: ignore
    train, test = split(data, robot.train)
    *fits, curvature, ridge, process = _rows(robot, train, test)
    for row in fits[:-1]:
        print(f"<!-- {robot.name}, {shown(row)} -->")
    cells = [
        f"{robot.name}, {1e3 * robot.arm.length:.0f} mm, {len(train)} + {len(test)} samples",
        shown(fits[-1]),
        f"{100 * fits[-1].coverage:.0f} %",
        *map(shown, (curvature, ridge)),
        shown(process).split(": ")[1],
    ]
    return f"| {' | '.join(cells)} |\n"


def shown(row: Row) -> str:
    """How many numbers a law has, and its errors in mm."""
    return f"{row.numbers}: {1e3 * row.held_out.rms:.2f} ({1e3 * row.held_out.median:.2f})"


def main(*names: str) -> None:
    """Print a row for each robot."""
    warnings.simplefilter("ignore")
    table = HEAD
    print(table, end="")
    for robot in robots():
        if not names or any(name in robot.name for name in names):
            row = _robot_row(robot)
            print(row, end="", flush=True)
            table += row
    if not names:
        put_between_marks(VALIDATION, "measured arms", table)


def test_a_fit(benchmark) -> None:
    data = read_measurements(tentacle(), DATA / "soromox_tentacle.csv.gz")
    free = [MODULUS, DENSITY]
    result = benchmark(lambda: sr.calibrate(tentacle(), data, free=free, rivals=False))
    assert result.train.rms < 0.014


if __name__ == "__main__":
    main(*sys.argv[1:])
