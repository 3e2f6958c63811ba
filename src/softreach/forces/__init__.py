"""Forces that a tip can exert."""

from __future__ import annotations

from softreach.forces.blocked import blocked_force
from softreach.forces.stop import Stop

__all__ = ["Stop", "blocked_force"]
