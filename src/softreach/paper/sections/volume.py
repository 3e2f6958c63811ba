"""Section 4: volume of α-shapes against the volume that can be reached."""

from __future__ import annotations

from typing import Any

import numpy as np

from softreach.arm.designs import minimal_trunk
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.volume import volume_curve
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, Verdict
from softreach.plot import plot_volume_curve
from softreach.workspace import reachable_set

_RADII = (0.02, 0.03, 0.04, 0.05, 0.07, 0.1)
_CURVE = np.geomspace(0.008, 1.0, 120)


def computed(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """V(α) of the paper's design for two sizes of clouds, and the exact volume."""
    arm = minimal_trunk()
    reached = reachable_set(arm, accuracy=settings.accuracy)
    sizes = (settings.samples // 16, settings.samples)
    clouds = {n: compute_cloud(arm, n, seed=settings.seed).tip for n in sizes}
    curves = {f"{n:,} tips": volume_curve(tips, _CURVE) for n, tips in clouds.items()}
    known: dict[str, Any] = {"exact": reached.volume, "convex": reached.convex_volume}
    words = (
        "Volume of the α-shape of the paper's design against its radius, which the paper does not "
        "state, beside the exact volume of the reachable set and of its convex hull."
    )
    ax = plot_volume_curve(curves, _CURVE, length=arm.length, **known)
    notes.draw("", "alpha_dependence", words, ax)
    return {
        **known,
        "exact_error": reached.volume_error,
        "radii": _RADII,
        "volumes": {str(n): volume_curve(t, np.array(_RADII)).tolist() for n, t in clouds.items()},
    }


def dependence(n: Numbers) -> Finding:
    size, volumes = list(n.volumes.items())[-1]
    values = ", ".join(f"{v:.3f} at {r:g} L" for r, v in zip(n.radii, volumes, strict=True))
    words = (
        f"{int(size):,} points give {values}; the exact volume is {n.exact:.4f} ± "
        f"{n.exact_error:.0e} L³"
    )
    return Finding(words, Verdict.OPEN)
