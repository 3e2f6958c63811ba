"""Calls, functions and files of softreach that a repeated question passes through.

    python -m tools.flows [FLOW ...] [--files] [--functions N]

Each flow is asked once, so that all is compiled and prepared, and counted when it is asked again.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import threading
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

os.environ.setdefault("SOFTREACH_NUM_THREADS", "1")

import numpy as np

import softreach as sr

SOURCE = str(Path(sr.__file__).parent)

Flow = Callable[[], Callable[[], object]]
"""Sets the scene, and returns the question that is counted."""


@dataclass(frozen=True)
class Passage:
    """What a question passes through."""

    calls: Counter[CodeType]

    @property
    def files(self) -> int:
        """Number of files."""
        return len({code.co_filename for code in self.calls})

    def files_in(self, room: str) -> int:
        """Number of files of one room, such as "studio"."""
        folder = str(Path(SOURCE) / room)
        return len({c.co_filename for c in self.calls if c.co_filename.startswith(folder)})

    def names(self) -> list[str]:
        """The files, those called first before the others."""
        return list(dict.fromkeys(str(Path(c.co_filename).relative_to(SOURCE)) for c in self.calls))

    def most_called(self, count: int) -> list[str]:
        """The functions called most, with their calls."""
        return [
            f"{calls:10,} {Path(code.co_filename).relative_to(SOURCE)}:{code.co_qualname}"
            for code, calls in self.calls.most_common(count)
        ]


def passage(question: Callable[[], object]) -> Passage:
    """Count the calls of a question into the source of softreach, on all threads."""
    calls: Counter[CodeType] = Counter()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(SOURCE):
            calls[frame.f_code] += 1

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        question()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return Passage(calls)


def free_cloud() -> Callable[[], object]:
    """A cloud of 64 samples of an arm without loads."""
    arm = sr.designs.minimal_trunk()
    return lambda: sr.compute_cloud(arm, 64)


def new_cloud() -> Callable[[], object]:
    """A cloud of 64 samples of an arm that was never asked before."""
    lengths = itertools.count(1.0, 0.01)
    return lambda: sr.compute_cloud(sr.designs.minimal_trunk(length=next(lengths)), 64)


def loaded_configuration() -> Callable[[], object]:
    """The shape of an arm under a payload at one activation."""
    arm = sr.designs.lce_arm().replace(loads=sr.Loads(payload=0.001))
    return lambda: sr.configuration(arm, arm.bounds.mean(axis=1))


def loaded_cloud() -> Callable[[], object]:
    """A cloud of 64 samples of an arm under a tip force."""
    arm = sr.designs.lce_arm().replace(loads=sr.Loads(payload=0.001))
    return lambda: sr.compute_cloud(arm, 64)


def _five_bundles() -> sr.Manipulator:
    return sr.designs.redundant_trunk().split("longitudinal 1", 2)


def _inverse(arm: sr.Manipulator) -> Callable[[], object]:
    targets = sr.compute_cloud(arm, 64).tip.values[:4]
    return lambda: sr.solve_inverse(arm, targets)


def inverse_of_three() -> Callable[[], object]:
    """Four targets of three bundles."""
    return _inverse(sr.designs.minimal_trunk())


def inverse_of_four() -> Callable[[], object]:
    """Four targets of four bundles."""
    return _inverse(sr.designs.redundant_trunk())


def inverse_of_five() -> Callable[[], object]:
    """Four targets of five bundles."""
    return _inverse(_five_bundles())


def reach_by_flux() -> Callable[[], object]:
    """The reachable set of a map that is injective."""
    arm = sr.designs.minimal_trunk().with_bounds((-0.9, -0.3))
    return lambda: sr.reachable_set(arm)


def reach_by_raster() -> Callable[[], object]:
    """The reachable set of three bundles whose map folds."""
    arm = sr.designs.minimal_trunk()
    return lambda: sr.reachable_set(arm, accuracy=0.1)


def reach_by_search() -> Callable[[], object]:
    """The reachable set of five bundles."""
    arm = _five_bundles()
    return lambda: sr.reachable_set(arm, accuracy=0.1)


_OPEN = ExitStack()
"""Servers that a flow needs until all is counted."""


def _moved_slider(
    change: Callable[[Any, float], Any], *, widgets: bool = False
) -> Callable[[], object]:
    """A settled tab of the studio, with its widgets or not, whose state is changed to and fro."""
    from tests.studio.sockets import page

    from softreach.studio import Quality, Start, Studio, StudioState

    quality = Quality(coarse_level=14, fine_level=15, coarse_accuracy=0.05, fine_accuracy=0.02)
    state = StudioState(design=sr.designs.minimal_trunk()).showing(level=14)
    studio = _OPEN.enter_context(Studio(Start(state=state, quality=quality)))
    session = _OPEN.enter_context(page(studio))
    session.panels = session.panels if widgets else []
    values = itertools.cycle((0.02, 0.03))

    def question() -> None:
        value = next(values)
        session.update(lambda state: change(state, value), by_widget=True)
        assert session.settle()

    return question


def _tapered(state: Any, taper: float) -> Any:
    from softreach.arm.parameters import changed

    return state.replace(design=changed(state.design, {"taper": taper}))


def slider() -> Callable[[], object]:
    """One slider of a design in the studio, until its fine cloud is drawn."""
    return _moved_slider(_tapered)


def slider_with_widgets() -> Callable[[], object]:
    """The same with all that the widgets of the page follow."""
    return _moved_slider(_tapered, widgets=True)


def activation_slider() -> Callable[[], object]:
    """One slider of an activation in the studio, until the arm is drawn."""
    return _moved_slider(lambda s, pull: s.replace(activation=(-10 * pull, -0.2, -0.3)))


FLOWS: dict[str, Flow] = {
    "cloud": free_cloud,
    "cloud, new arm": new_cloud,
    "cloud, loaded": loaded_cloud,
    "configuration, loaded": loaded_configuration,
    "inverse, three bundles": inverse_of_three,
    "inverse, four bundles": inverse_of_four,
    "inverse, five bundles": inverse_of_five,
    "reach, flux": reach_by_flux,
    "reach, raster": reach_by_raster,
    "reach, search": reach_by_search,
    "slider": slider,
    "slider, with widgets": slider_with_widgets,
    "slider, activation": activation_slider,
}


def main() -> None:
    """Print a line for each flow."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flows", nargs="*", help=f"of {', '.join(FLOWS)}; all by default")
    parser.add_argument("--files", action="store_true", help="list the files in their order")
    parser.add_argument("--functions", type=int, default=0, help="list so many most called ones")
    options = parser.parse_args()
    print(f"{'flow':24} {'calls':>8} {'functions':>10} {'files':>6} {'studio':>6}")
    with _OPEN:
        for name in options.flows or FLOWS:
            try:
                question = FLOWS[name]()
            except NotImplementedError as reason:
                print(f"{name:24} {reason}")
                continue
            question()
            counted = passage(question)
            numbers = counted.calls.total(), len(counted.calls), counted.files
            print("{:24} {:8,} {:10} {:6}".format(name, *numbers), counted.files_in("studio"))
            if options.files:
                print(" → ".join(counted.names()))
            for line in counted.most_called(options.functions):
                print(line)


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
