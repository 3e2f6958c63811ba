"""Laws of the rooms: imports go down (import-linter) and never round, inside rooms either."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

import grimp


def test_no_module_imports_itself_by_way_of_others():
    graph = grimp.build_graph("softreach", exclude_type_checking_imports=True)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(imports).prepare()
        circle = []
    except CycleError as error:
        circle = error.args[1]
    assert not circle, " -> ".join(circle)
