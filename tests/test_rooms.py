"""Laws of the rooms: imports go down (import-linter) and never round, inside rooms either."""

from __future__ import annotations

import grimp

CIRCLES = [
]
"""Modules that reach each other where imports for types count; the list may only shrink."""


def circles(*, of_types: bool) -> list[str]:
    """Modules that reach each other by imports."""
    graph = grimp.build_graph("softreach", exclude_type_checking_imports=not of_types)
    below = {module: graph.find_upstream_modules(module) for module in graph.modules}
    found = {
        frozenset({module, *mutual})
        for module in below
        if (mutual := {other for other in below[module] if module in below[other]})
    }
    return sorted(" ".join(sorted(circle)).replace("softreach.", "") for circle in found)


def test_no_module_imports_itself_by_way_of_others():
    assert circles(of_types=False) == []


def test_circles_of_imports_for_types_are_no_others_than_listed():
    assert circles(of_types=True) == CIRCLES
