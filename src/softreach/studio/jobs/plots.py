"""Jobs that compute the plots beside the scene; what is not shown is not computed."""

from __future__ import annotations

from softreach.studio.plots import PLOTS
from softreach.studio.plots.plot import Plot
from softreach.studio.session import Job
from softreach.studio.work import StaleCheck


def _job_of(plot: type[Plot]) -> type[Job]:
    class ComputePlot(Job):
        depends_on = plot.depends_on
        shown_plot = plot.name

        def run(self, check: StaleCheck) -> None:
            check()
            session = self.session
            if plot.name in session.state.appearance.plots.shown:
                for result in plot.compute(session, check):
                    check()
                    session.figures.plots[plot.name] = result
                    session.show()

    return ComputePlot


PLOT_JOBS = tuple(map(_job_of, PLOTS))
"""One for each plot."""
REACH_JOBS = tuple(job for plot, job in zip(PLOTS, PLOT_JOBS, strict=True) if plot.of_reach)
"""Those of plots that are computed from the reach, not from the state alone."""
