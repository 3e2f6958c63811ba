"""Rigid pieces: where an arm neither bends nor twists nor changes its length, such as in disks."""

from __future__ import annotations

from dataclasses import dataclass

from softreach.arm.stations import Span

__all__ = ["RigidPiece"]


@dataclass(frozen=True, kw_only=True)
class RigidPiece(Span):
    """A stretch of the arm that neither actuators nor loads deform: a disk, a joint, a hard tip.

    Actuators pass through it and act on what is beyond; its mass is that of the arm there.

    Raises:
        InvalidDesign: A place off the arm, given twice, or an end that is not beyond the start.
    """
