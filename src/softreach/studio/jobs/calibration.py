"""Jobs of a calibration: the markers of a sample over the arm, and the fit of free numbers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.calibration import Calibration, calibrate
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.measurements import Measurements
from softreach.calibration.model import MarkerModel
from softreach.studio.jobs.reach import FollowCamera
from softreach.studio.session import AskedJob, Job
from softreach.studio.state import StudioState
from softreach.studio.work import StaleCheck
from softreach.support.errors import no_warnings

Array = NDArray[np.float64]


@dataclass(eq=False)
class Bench:
    """Measured poses in a tab, the sample that is shown, and what was fitted to them."""

    data: Measurements
    arm: Manipulator
    """The design that they were read for."""
    sample: int = 0
    distances: Array | None = None
    """From the measured to the predicted markers of the sample [m]; None if it is not shown."""
    result: Calibration | None = None

    def fits(self, arm: Manipulator) -> bool:
        """True of an arm with the inputs and the markers of the one that the data were read for."""
        return _columns(arm) == _columns(self.arm)

    def posed(self, state: StudioState) -> StudioState:
        """The state with the inputs of the sample, as far as its bounds go."""
        return state.replace(activation=tuple(self.data.inputs[self.sample].tolist()))

    def fitted(self, design: Manipulator) -> Manipulator | None:
        """The calibrated arm; None without a fit that began with this design."""
        result = self.result
        return result.arm if result is not None and result.start == design else None


def _columns(arm: Manipulator) -> tuple[object, ...]:
    return arm.input_names, arm.input_units, [marker.name for marker in arm.markers]


class DrawSample(Job):
    """Measured and predicted markers of a sample, while the arm has its inputs."""

    depends_on = "design", "activation"

    def run(self, check: StaleCheck) -> None:
        check()
        session, state, bench = self.session, self.session.state, self.session.bench
        if bench is None:
            return
        if bench.fits(state.design) and bench.posed(state).activation == state.activation:
            self._draw(bench, state)
        else:
            bench.distances = None
            session.scene.remove("/sample")
        session.follow(FollowCamera)
        session.show()

    def _draw(self, bench: Bench, state: StudioState) -> None:
        session, design = self.session, state.design
        arm = bench.fitted(design) or design
        sample = bench.data.of(np.array([bench.sample]))
        # The inputs of a sample may be beyond the bounds of the design.
        model = MarkerModel.of(free_numbers(arm, ["pose"]), sample)
        predicted, measured = model.of_arm(arm).places[0], sample.places[0]
        bench.distances = np.linalg.norm(predicted - measured, axis=1)
        with session.drawing, session.client.atomic():
            session.scene.draw_sample(measured / design.length, predicted / design.length)
            if arm == design:
                session.scene.remove("/sample/arm")
            else:
                same = state.replace(design=arm).activation
                session.scene.draw_arm(arm, same, "/sample/arm", design.length)


class FitArm(AskedJob):
    """Fits free numbers of the design to all samples; says how far it is, and can be canceled."""

    free: tuple[str, ...] = ()

    def do(self, check: StaleCheck) -> None:
        session, bench = self.session, self.session.bench
        if bench is None:
            return
        steps = count(1)

        def progress(_: int) -> None:
            check()
            session.report(f"calibrating, step {next(steps)}")

        with session.working("calibrating"), no_warnings():
            result = calibrate(session.state.design, bench.data, free=self.free, progress=progress)
        check()
        bench.result = result
        session.follow(DrawSample)
        session.show()
