"""Attributes that are computed at their first use, without a lock."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    lazy = cached_property
else:

    class lazy(cached_property):
        """As `functools.cached_property`, which in Python 3.11 has one lock for all objects.

        Threads that ask different arms would wait for each other. Here two threads that ask the
        same object at once may both compute it.
        """

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            if instance is None:
                return self
            value = instance.__dict__[self.attrname] = self.func(instance)
            return value
