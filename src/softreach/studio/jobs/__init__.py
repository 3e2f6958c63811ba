"""What follows from a change of the state: a job for each kind of work."""

from __future__ import annotations

from softreach.studio.jobs.arm import DrawArm
from softreach.studio.jobs.eye import FollowEye
from softreach.studio.jobs.free import DrawFree
from softreach.studio.jobs.inverse import SolveInverse
from softreach.studio.jobs.job import Job
from softreach.studio.jobs.keep import KeepState
from softreach.studio.jobs.map import DrawMap
from softreach.studio.jobs.path import FollowPath, PlayPath, WriteMovie
from softreach.studio.jobs.plots import PLOT_JOBS
from softreach.studio.jobs.pull import PullTip
from softreach.studio.jobs.reach import ComputeReach, DrawCloud, DrawSurfaces
from softreach.studio.jobs.reference import DrawReference
from softreach.studio.jobs.theme import SetTheme
from softreach.studio.state import StudioState

__all__ = [
    "JOBS",
    "ComputeReach",
    "DrawArm",
    "DrawCloud",
    "DrawFree",
    "DrawMap",
    "DrawReference",
    "DrawSurfaces",
    "FollowEye",
    "FollowPath",
    "Job",
    "KeepState",
    "PlayPath",
    "PullTip",
    "SetTheme",
    "SolveInverse",
    "WriteMovie",
    "what_follows",
]

JOBS: tuple[type[Job], ...] = (
    ComputeReach,
    DrawArm,
    DrawCloud,
    DrawFree,
    DrawSurfaces,
    SolveInverse,
    PullTip,
    DrawReference,
    DrawMap,
    *PLOT_JOBS,
    FollowPath,
    PlayPath,
    WriteMovie,
    FollowEye,
    SetTheme,
    KeepState,
)


def what_follows(old: StudioState | None, new: StudioState) -> frozenset[type[Job]]:
    """The jobs whose results a change makes stale; all of them if there was nothing before."""
    if old is None:
        return frozenset(JOBS)
    return frozenset(job for job in JOBS if job.depends_on(old) != job.depends_on(new))
