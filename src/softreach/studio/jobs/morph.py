"""Job of a movie from one design to another, as a GIF, or as a video that the page records."""

from __future__ import annotations

import base64
import io
import time

import numpy as np
from numpy.typing import NDArray

from softreach.plot.morph_movie import morph_frames
from softreach.plot.path_movie import gif
from softreach.studio import markup
from softreach.studio.jobs.path import view_from
from softreach.studio.session import AskedJob, Session
from softreach.studio.state import StudioState
from softreach.studio.widgets import Line
from softreach.studio.work import StaleCheck
from softreach.support.errors import InvalidInput

_PIXELS = {"GIF": 480, "MP4": 720}
_QUALITY = 90
_RECORDED = 10.0  # [s] in which a page has taken the frames up


class WriteMorph(AskedJob):
    """The design on its way from one state to another, as an animation."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.between: tuple[StudioState, StudioState] | None = None
        """The states at its ends."""
        self.format = "GIF"
        """One of "GIF" and "MP4"."""
        self.frames: Line | None = None
        """Line of the panel that hands frames to the page."""

    def do(self, check: StaleCheck) -> None:
        """Draw and send it; says how far it is, and can be canceled."""
        if self.between is None:
            raise InvalidInput("movie", "without designs", "between two snapshots")
        session, (first, last), kind = self.session, self.between, self.format

        def progress(share: float) -> None:
            check()
            session.report(f"drawing the movie, {100 * share:.0f} %")

        drawn = morph_frames(
            first.design,
            last.design,
            (first.activation, last.activation),
            pixels=_PIXELS[kind],
            view=view_from(session.camera.usual()),
            progress=progress,
        )
        check()
        if kind == "GIF":
            movie = gif(drawn)
            session.client.send_file_download("designs.gif", movie, save_immediately=True)
            session.say(f"designs.gif is written: {len(movie) / 1e6:.1f} MB.")
        elif self.frames is not None:
            self.frames.show(markup.movie("designs", [_webp(frame) for frame in drawn]))
            session.say("The page records the video, in a few seconds: leave it in front.")
            time.sleep(_RECORDED)
            self.frames.show("")


def _webp(frame: NDArray[np.uint8]) -> str:
    """A frame as an address that a page shows."""
    from PIL import Image as images

    file = io.BytesIO()
    images.fromarray(frame).save(file, "WEBP", quality=_QUALITY, method=2)
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}"
