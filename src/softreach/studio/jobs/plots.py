"""Jobs that compute the plots beside the scene; what is not shown is not computed."""

from __future__ import annotations

from softreach.studio.plots import PLOTS
from softreach.studio.plots.plot import Plot, Source
from softreach.studio.session import Job
from softreach.studio.work import StaleCheck


def _job_of(plot: type[Plot]) -> type[Job]:
    class ComputePlot(Job):
        """Computes one plot while it is shown."""

        depends_on = plot.depends_on
        shown_plot = plot.name

        def run(self, check: StaleCheck) -> None:
            """Compute it, and show each result."""
            check()
            session = self.session
            if plot.name in session.state.appearance.plots.shown:
                for result in plot.compute(session, check):
                    check()
                    session.figures.plots[plot.name] = result
                    session.show()

    return ComputePlot


_JOBS = {plot: _job_of(plot) for plot in PLOTS}
PLOT_JOBS = tuple(_JOBS.values())
"""One for each plot."""


def plots_from(source: Source) -> tuple[type[Job], ...]:
    """Jobs of the plots that are computed from something else than the state alone."""
    return tuple(job for plot, job in _JOBS.items() if source in plot.sources)
