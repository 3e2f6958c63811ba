"""What other programs of the field define and compute, read and written."""

from __future__ import annotations

from softreach.exchange import activefilaments

__all__ = ["activefilaments"]
