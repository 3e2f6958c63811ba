"""The paper that softreach began with, recomputed: every figure, every number, every statement."""

from softreach.paper.reproduce import reproduce_paper

__all__ = ["reproduce_paper"]
