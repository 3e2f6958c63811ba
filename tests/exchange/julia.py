"""What ActiveFilaments.jl writes as JSON of a filament: its constructors, in Python."""

import json
import math
from typing import Any

import numpy as np


def json_of(script: str) -> str:
    """The lines of docs/clouds.md after a script, which is Python but for three things."""
    python = script.replace("using ActiveFilaments\n", "").replace("(rings;", "(rings,")
    names: dict[str, Any] = {
        "MechanicalProperties": lambda E, ν: {"E": E, "ν": ν},
        "Geometry": lambda R1, R2: {"R1": R1, "R2": R2, "phi2": 0.0},
        "FiberArchitecture": lambda α2: {"α2": α2},
        "PiecewiseStructure": lambda values, ranges: {
            "expressions": values,
            "piecewiseRanges": ranges,
        },
        "InnerTube": _tube,
        "Ring": lambda mechanics, geometry, architecture: {
            **_tube(mechanics, geometry),
            "fiberArchitecture": architecture,
        },
        "ActivationPiecewiseGamma": lambda N, γ, σ, θ0: {"N": N, "γ": γ, "σ": σ, "θ0": θ0},
        "AFilament": _filament,
        "pi": math.pi,
    }
    exec(python, names)
    bounds = {name: names[name] for name in ("γBounds",) if name in names}
    return json.dumps({**names["filament"], "activation": names["activation"], **bounds})


def _tube(mechanics: dict, geometry: dict) -> dict:
    return {"mechanicalProperties": mechanics, "geometry": geometry}


def _filament(
    rings: list[dict],
    *,
    L: float = 1.0,
    phi2: float = 0.0,
    ρvol: float = 1000.0,
    innerTube: dict | None = None,
) -> dict:
    """An AFilament: where it is tapered, radii are vectors along Z."""
    first, last = rings[0]["geometry"], rings[-1]["geometry"]["R2"]
    if innerTube is None:
        geometry = {"R1": 0.0, "R2": first["R1"], "phi2": phi2}
        innerTube = _tube(rings[0]["mechanicalProperties"], geometry)
    if phi2:
        along = 1 - np.linspace(0, L, 32) / last * math.tan(phi2)
        for part in (*rings, innerTube):
            radii = part["geometry"]
            part["geometry"] = {name: (radii[name] * along).tolist() for name in ("R1", "R2")}
    return {"L": L, "phi2": phi2, "ρvol": ρvol, "rings": rings, "innerTube": innerTube}
