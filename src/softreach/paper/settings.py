"""Sizes of the clouds with which the paper is recomputed."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FULL", "QUICK", "Settings"]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Sizes of the paper's clouds and sweeps, or smaller ones."""

    designs: int
    """Designs along each edge of the atlas."""
    samples: int
    """Activations of each design of the atlas."""
    alpha: float
    """Radius of the α-shapes, in L; the paper states none."""
    panels: int
    """Designs along each edge of the sheets."""
    accuracy: float
    """Relative error asked of exact volumes."""
    redundant_samples: int
    """Activations of the clouds that are compared for redundancy."""
    queries: int
    """Points at which D̄ is evaluated."""
    seed: int = 0
    """Seed of every cloud."""


FULL = Settings(
    designs=16,
    samples=400_000,
    alpha=0.05,
    panels=7,
    accuracy=3e-3,
    redundant_samples=2_000_000,
    queries=10_000,
)
"""The sizes that the paper states (sections 3 and 5)."""

QUICK = Settings(
    designs=4,
    samples=10_000,
    alpha=0.13,
    panels=2,
    accuracy=5e-2,
    redundant_samples=50_000,
    queries=1_000,
)
"""The same in under a minute; its numbers are coarse."""
