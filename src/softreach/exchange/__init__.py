"""Definitions and clouds of other programs of the field, read and written."""

from softreach.exchange import activefilaments

__all__ = ["activefilaments"]
