"""Shared fixtures, and what is said of tests that were skipped."""

import gc
import json
import os
import sys
from collections.abc import Iterator

os.environ.setdefault("MPLBACKEND", "agg")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the workers of the tests keep all cores busy

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from softreach.arm import designs
from softreach.arm.manipulator import Manipulator
from softreach.plot import style
from tests.browser import MISSING, browser  # noqa: F401  (a fixture)

pytest_plugins = ["tests.durations"]

for profile, examples in {"usual": 5, "large": 25}.items():
    settings.register_profile(
        profile,
        derandomize=True,
        deadline=None,  # the first call compiles
        max_examples=examples,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    )
settings.load_profile("usual")


def pytest_xdist_auto_num_workers() -> int:
    """One more process than cores, as browsers and killed workers are waited for; at most four."""
    return min(4, len(os.sched_getaffinity(0)) + 1) if hasattr(os, "sched_getaffinity") else 2


def pytest_configure(config: pytest.Config) -> None:
    """More random designs where the large sizes are asked for."""
    if config.option.markexpr == "large or not large":
        settings.load_profile("large")


@pytest.fixture(scope="session")
def trunk() -> Manipulator:
    """The paper's best design."""
    return designs.minimal_trunk()


@pytest.fixture(scope="session", autouse=True)
def coarse() -> Iterator[None]:
    """Few pixels, since laws do not depend on their number, and PDF files without fonts."""
    with pytest.MonkeyPatch.context() as patch:
        for module in ("axes", "style"):
            patch.setattr(f"softreach.plot.{module}.DPI", 60)
        patch.setitem(style._SAVING, "pdf.use14corefonts", True)
        yield


@pytest.fixture(autouse=True)
def closed_figures() -> Iterator[None]:
    """No figure of one test is seen by the next, on which worker it may run."""
    yield
    if figures := sys.modules.get("matplotlib._pylab_helpers"):  # pyplot may be half imported
        figures.Gcf.destroy_all()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def pytest_collection_finish() -> None:
    """Thousands of tests and all modules stay to the end: no search for garbage looks at them."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 50)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> Iterator[None]:
    """Say in the end how many tests had no browser, and what to type."""
    yield
    skipped = terminalreporter.stats.get("skipped", [])
    if count := sum(MISSING in str(report.longrepr) for report in skipped):
        terminalreporter.write_line(
            f"{count} tests of the studio and the report were skipped: {MISSING}. "
            "To run them, type: sudo apt-get install chromium",
            yellow=True,
        )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def printed(capsys):
    """What a command prints as JSON."""
    from softreach.cli.app import run

    def of(*words):
        capsys.readouterr()
        assert run([*words, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return of
