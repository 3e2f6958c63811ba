"""How long each test takes: workers begin with slow files, and `make quick` leaves slow tests out.

A test is slow that takes over a twentieth of a second.

`pytest --record` writes `durations.json` after a run of all tests: the seconds of each such test
function with its slowest fixture; the slowest of its cases counts. `pytest --record --quick` adds
what is slow only where those before it are left out, as it is the first to use something.
"""

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import pytest
from xdist.scheduler import LoadFileScheduling

FILE = Path(__file__).with_suffix(".json")
SLOW = 0.05  # [s]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="only tests that are not slow")
    parser.addoption("--record", action="store_true", help="write which tests are slow")


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Durations(), "durations")


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    return ByFile(config, log)


class ByFile(LoadFileScheduling):
    """A worker has whole files, whose fixtures are made once, and one has all that share a page."""

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return "browser" if file.endswith("in_browser.py") else file


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow files first, so that all workers end at about the same time."""
    seconds: Counter[str] = Counter()
    for name, slow in json.loads(FILE.read_text("utf-8")).items():
        seconds[file_of(name)] += slow
    items.sort(key=lambda item: seconds[file_of(item.nodeid)], reverse=True)
    items.sort(key=lambda item: not file_of(item.nodeid).endswith("in_browser.py"))


def file_of(nodeid: str) -> str:
    return nodeid.partition("::")[0]


def function_of(nodeid: str) -> str:
    """A test without its case."""
    return nodeid.partition("[")[0]


class Durations:
    """Measures tests, or leaves out those that are known to be slow."""

    def __init__(self) -> None:
        self.fixtures: dict[object, float] = {}
        self.tests: dict[str, float] = {}

    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        if config.getoption("quick"):
            slow = json.loads(FILE.read_text("utf-8"))
            left_out = [item for item in items if function_of(item.nodeid) in slow]
            items[:] = [item for item in items if function_of(item.nodeid) not in slow]
            config.hook.pytest_deselected(items=left_out)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef) -> Iterator[None]:
        """A fixture that several tests share is as slow for each: any may be the first to ask."""
        begin = perf_counter()
        result = yield
        self.fixtures[fixturedef] = perf_counter() - begin
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        defined = getattr(item, "_fixtureinfo", None)
        shared = defined.name2fixturedefs.values() if defined else ()
        longest = max((self.fixtures.get(d[-1], 0.0) for d in shared), default=0.0)
        item.user_properties.append(("fixtures", longest))
        return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Of a call, or of the end of a test, which knows its fixtures."""
        seconds = dict(report.user_properties).get("fixtures", 0.0)
        seconds = report.duration if report.when == "call" else seconds
        name = function_of(report.nodeid)
        self.tests[name] = max(seconds, self.tests.get(name, 0.0))

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        config = session.config
        if config.getoption("record") and not hasattr(config, "workerinput"):
            known = json.loads(FILE.read_text("utf-8")) if config.getoption("quick") else {}
            slow = known | {name: round(s, 2) for name, s in self.tests.items() if s > SLOW}
            FILE.write_text(json.dumps(slow, indent=0, sort_keys=True) + "\n", "utf-8")
