"""Jobs of the plots beside the scene; what is not shown is not computed."""

from __future__ import annotations

from softreach.studio.plots.along_arm import along_arm
from softreach.studio.plots.histogram import histogram_picture
from softreach.studio.plots.section import section_picture
from softreach.studio.plots.sweep import sweep, swept_control
from softreach.studio.plots.volumes import volume_curve_of
from softreach.studio.reach import Reach
from softreach.studio.session import Job
from softreach.studio.work import StaleCheck
from softreach.support.errors import InvalidInput

__all__ = [
    "CountActivations",
    "CutSection",
    "FollowArm",
    "MeasureVolumes",
    "SweepParameter",
]


class FollowArm(Job):
    """Curvature and strain along the arm, while its activations move."""

    depends_on = "design", "activation"
    only_with = "appearance.plots.along_arm"

    def run(self, check: StaleCheck) -> None:
        """Compute them; nothing for an arm that cannot be computed, which `ComputeReach` says."""
        check()
        session, state = self.session, self.session.state
        if state.appearance.plots.along_arm:
            try:
                session.figures.along_arm = along_arm(state.design, state.activation)
            except InvalidInput:
                session.figures.along_arm = None
            session.show()


class MeasureVolumes(Job):
    """V(α) of the cloud."""

    depends_on = ("appearance.level",)  # the cloud itself is told by `ComputeReach`
    only_with = "appearance.plots.volume_curve"

    def run(self, check: StaleCheck) -> None:
        """Triangulate the cloud, once it is complete."""
        check()
        session, look = self.session, self.session.state.appearance
        reach = _complete_reach(self)
        if look.plots.volume_curve and reach is not None:
            with session.working("V(α): triangulating the cloud"):
                session.figures.volume_curve = volume_curve_of(reach, look.level)
            session.show()


class SweepParameter(Job):
    """Volume against one parameter of the design."""

    depends_on = "design", "appearance.plots.parameter"
    only_with = "appearance.plots.sweep"

    def run(self, check: StaleCheck) -> None:
        """Compute one design after the other, and show each."""
        check()
        session, state = self.session, self.session.state
        control = swept_control(state.design, state.appearance.plots.parameter)
        if not state.appearance.plots.sweep or control is None:
            return
        known = session.figures.sweep
        wanted = state.design, control
        if known is not None and known.complete and (known.arm, known.control) == wanted:
            return
        for found in sweep(state.design, control, session.quality, check):
            check()
            session.figures.sweep = found
            session.show()


class CountActivations(Job):
    """Histograms of the activations of the samples that are shown."""

    depends_on = (
        "appearance.level", "appearance.slice", "appearance.dark", "activation", "target",
    )  # fmt: skip
    only_with = "appearance.plots.histogram"

    def run(self, check: StaleCheck) -> None:
        """Draw them, once the cloud is complete."""
        check()
        session, state = self.session, self.session.state
        look, reach = state.appearance, _complete_reach(self)
        if look.plots.histogram and reach is not None:
            solutions = None if session.answer is None else session.answer.activations
            session.figures.histogram = histogram_picture(
                reach, look.level, look.slice, state.activation, solutions, dark=look.dark
            )
            session.show()


class CutSection(Job):
    """The reachable set in the plane of the slice."""

    depends_on = "appearance.slice.axis", "appearance.slice.center", "appearance.dark"
    only_with = "appearance.plots.section"

    def run(self, check: StaleCheck) -> None:
        """Cut and draw it, once the exact set is complete."""
        check()
        session, look = self.session, self.session.state.appearance
        reach = _complete_reach(self)
        if look.plots.section and reach is not None:
            with session.working("cutting the reachable set"):
                session.figures.section = section_picture(reach, look.slice, check, dark=look.dark)
            session.show()


def _complete_reach(job: Job) -> Reach | None:
    """Reach of the design of the state, if it is complete; its job says when it is."""
    reach = job.session.reach
    wanted = reach is not None and reach.fine and reach.arm == job.session.state.design
    return reach if wanted else None
