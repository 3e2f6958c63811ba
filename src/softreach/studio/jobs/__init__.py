"""Jobs of a session: what follows from a change of its state."""

from softreach.studio.jobs.goals import CHECK_NEEDS, DRAW_SAMPLE, FIT_ARM
from softreach.studio.jobs.move import DRAG_TIP, FOLLOW_PATH, PLAY_PATH, SOLVE_INVERSE
from softreach.studio.jobs.reach import (
    COMPUTE_REACH,
    DIFFERENTIATE_VOLUME,
    DRAW_CLOUD,
    DRAW_SECTION,
    DRAW_SURFACE,
    SWEEP_VOLUME,
)
from softreach.studio.jobs.scene import (
    DRAW_ARM,
    DRAW_FREE,
    DRAW_REFERENCE,
    FOLLOW_CAMERA,
    SET_THEME,
)

JOBS = (
    COMPUTE_REACH, DIFFERENTIATE_VOLUME, DRAW_CLOUD, DRAW_SURFACE,
    DRAW_ARM, FOLLOW_CAMERA, SET_THEME, DRAW_FREE, DRAW_REFERENCE,
    SOLVE_INVERSE, DRAG_TIP, FOLLOW_PATH, PLAY_PATH,
    DRAW_SAMPLE, FIT_ARM, CHECK_NEEDS, DRAW_SECTION, SWEEP_VOLUME,
)  # fmt: skip
"""Every kind of work that a tab has done for it."""
