"""Definitions, clouds and points of other programs, read and written."""

from softreach.exchange import activefilaments
from softreach.exchange.points import read_points

__all__ = ["activefilaments", "read_points"]
