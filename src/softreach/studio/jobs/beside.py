"""Jobs of other designs in the scene: the arm without its loads, and that of a snapshot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.studio.jobs.reach import draw_axes
from softreach.studio.reach import Reach, beside, stages
from softreach.studio.session import Job
from softreach.studio.work import StaleCheck

_LEVEL = 16


class DrawFree(Job):
    """The reach of a loaded arm without its loads, faint behind the loaded one."""

    depends_on = "unloaded", "appearance.slice"
    only_with = "design.loads"

    def run(self, check: StaleCheck) -> None:
        session, state = self.session, self.session.state
        free, known = state.unloaded, session.reach
        if state.design.loads is None:
            session.free = None
        elif session.free is None or session.free.arm != free or not session.free.fine:
            if known is not None and known.fine and known.arm == free:
                session.free = known  # the loads have just been put on
            else:
                quality = session.quality
                small = replace(quality, fine_level=quality.coarse_level)
                for reach in stages(free, min(_LEVEL, quality.coarse_level), small, check):
                    check()
                    session.free = reach
                    self._draw()
        self._draw()

    def _draw(self) -> None:
        session = self.session
        with session.drawing, session.client.atomic():
            session.scene.draw_free(session.free, session.state.appearance.slice)
            draw_axes(session)
        session.show()


class DrawReference(Job):
    """The reach of the design of a snapshot, around this one's or beside it."""

    depends_on = (
        "reference", "side_by_side",
        "appearance.level", "appearance.color", "appearance.slice",
    )  # fmt: skip
    only_with = "reference"

    def run(self, check: StaleCheck) -> None:
        session, state = self.session, self.session.state
        reference = state.reference
        if reference is None:
            session.reference = None
            with session.drawing:
                session.scene.remove("/reference")
        elif session.reference is None or session.reference.arm != reference:
            session.reference = self._reach_of(reference, check)
        if session.reference is not None:
            shift = beside(session.reference) if session.state.side_by_side else np.zeros(3)
            name = session.snapshots.name_of(session.reference.arm)
            with session.drawing, session.client.atomic():
                session.scene.draw_reference(session.reference, state.appearance, shift, name)
            session.follow(DrawReferenceArm)
        session.show()

    def _reach_of(self, reference: Manipulator, check: StaleCheck) -> Reach:
        known = self.session.reach
        if known is not None and known.fine and known.arm == reference:
            return known
        *_, fine = stages(reference, _LEVEL, self.session.quality, check)
        return fine


class DrawReferenceArm(Job):
    """The arm of that design beside this one, in the same activation."""

    depends_on = "reference", "activation", "appearance.arm"
    only_with = "side_by_side"

    def run(self, check: StaleCheck) -> None:
        check()
        session, state = self.session, self.session.state
        reference = session.reference
        with session.drawing:
            if reference is not None and state.side_by_side and state.appearance.arm:
                same = state.replace(design=reference.arm).activation
                session.scene.draw_reference_arm(reference.arm, same, beside(reference))
            else:
                session.scene.remove("/reference/arm")
