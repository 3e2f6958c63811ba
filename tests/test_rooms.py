"""Law of the rooms: imports go down (import-linter) and never round, inside rooms either."""

import grimp


def test_no_module_imports_itself_by_way_of_others_for_types_included():
    graph = grimp.build_graph("softreach", exclude_type_checking_imports=False)
    below = {module: graph.find_upstream_modules(module) for module in graph.modules}
    circles = {
        frozenset({module, *mutual})
        for module in below
        if (mutual := {other for other in below[module] if module in below[other]})
    }
    assert sorted(" ".join(sorted(circle)) for circle in circles) == []
