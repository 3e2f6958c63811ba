"""What to say of loads under which no activation has an equilibrium that could be used."""

from __future__ import annotations

from softreach.support.errors import InvalidInput

__all__ = ["none_of", "none_stable", "too_heavy"]


def none_of(tried: int, sought: str = "a stable equilibrium") -> str:
    """What was found of as many activations, as a sentence.

    Args:
        tried: How many.
        sought: What they do not have.
    """
    return f"none of {tried} activations tried has {sought}"


def too_heavy(found: str) -> InvalidInput:
    """What to raise where nothing is left to go on with.

    Args:
        found: What is missing.
    """
    return InvalidInput("loads", found, "such that some have one", "lighten the load")


def none_stable(tried: int) -> InvalidInput:
    """What to raise where nothing is reached, after as many activations."""
    return too_heavy(none_of(tried))
