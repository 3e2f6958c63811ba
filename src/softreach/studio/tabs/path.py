"""Path of the tip: loaded or clicked, followed, played and saved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.export.clouds import path_csv
from softreach.inverse.path import PathStatus
from softreach.inverse.request import positions_in
from softreach.studio.fields import attempt, bind_button
from softreach.studio.figures import track_picture
from softreach.studio.files import LARGEST
from softreach.studio.jobs.path import at_point
from softreach.studio.settings import MOST_POINTS, TipPath
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.widgets import Line, PictureFrame, show_where
from softreach.support.errors import InvalidInput
from softreach.support.files.text import text_of

if TYPE_CHECKING:
    import xarray as xr
    from viser import GuiApi, UploadedFile

    from softreach.arm.manipulator import Manipulator
    from softreach.studio.session import Session

_HINT = "The tip follows a path as far as its branch of solutions goes: load one, or click it."
_POINTS = 24  # of the straight line to each place that is clicked


class PathPanel:
    """The path of a tab."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session, self._gui = session, gui
        self._shown: xr.Dataset | None = None
        self._revision = -1
        with tab, gui.add_folder("follow a path"):
            Line(gui, _HINT)
            self._path_widgets(gui)
            self._text = Line(gui)
            self._walk = gui.add_folder("along it", visible=False)
            with self._walk:
                self._walk_widgets(gui)
        bind_button(self._clear, session, lambda: self._take(None))
        bind_button(self._play, session, self._played)
        bind_button(self._save, session, self._save_csv)
        self._load.on_upload(lambda _: attempt(session, lambda: self._read(self._load.value)))
        self._at.on_update(self._moved)

    def _path_widgets(self, gui: GuiApi) -> None:
        self._load = gui.add_upload_button(
            "Load a path (CSV)",
            mime_type=".csv,text/csv",
            hint="columns x, y, z [m]",
        )
        self._clear = gui.add_button(
            "Remove the path", hint="and what was found along it", color="gray", visible=False
        )

    def _walk_widgets(self, gui: GuiApi) -> None:
        self._play = gui.add_button_group(
            "", ("Play", "Stop"), hint="the arm along the path, from the point that is chosen"
        )
        self._at = gui.add_slider("point", 0, 1, 1, 0, hint="point of the path where the arm is")
        graph = gui.add_folder("activations along the path")
        self._timeline = PictureFrame(gui, graph)
        self._save = gui.add_button("Save the path (CSV)", hint="with its activations")

    def show(self, session: Session) -> None:
        """Say how far the arm follows, and where it is."""
        track, path = session.found.track, session.state.path
        show_where(path is not None, self._clear)
        if path is None or track is None or track.sizes["point"] != len(path.points):
            self._shown, self._walk.visible = None, False
            self._text.say(*(("following ...",) if path is not None else ()))
            return
        if track is not self._shown:
            self._shown = track
            self._list(track)
        if self._at.value != path.at and session.revision != self._revision:
            self._revision, self._at.value = session.revision, min(path.at, int(self._at.max))

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Lead the path to the place under the cursor, if the mouse adds points to it."""
        session = self._session
        if session.state.appearance.mouse != "path":
            return False
        place = session.picked_place(origin, direction)
        if place is not None:
            attempt(session, lambda: self._extend(place))
        return True

    def _list(self, track: xr.Dataset) -> None:
        count = int((track.status == PathStatus.FOLLOWED).sum())
        arm = self._session.state.design
        self._text.say(end_text(track, arm))
        self._walk.visible = count > 0
        if count == 0:
            return
        self._at.max = max(count - 1, 1)
        if count > 1:
            self._timeline.show(track_picture(track, arm).image)

    def _take(self, path: TipPath | None) -> None:
        self._session.update(lambda state: state.replace(path=path))

    def _extend(self, point: np.ndarray) -> None:
        state, path = self._session.state, self._session.state.path
        before = np.array(path.points) if path is not None else _tip(state)[None]
        start = state.activation if path is None else path.start
        more = np.linspace(before[-1], point, _POINTS + 1)[1:]
        self._take(TipPath.through(np.concatenate([before, more]), start))

    def _read(self, file: UploadedFile) -> None:
        points = positions_in(text_of("file", file.name, file.content, LARGEST), file.name)
        if not 2 <= len(points) <= MOST_POINTS:
            raise InvalidInput(file.name, f"{len(points)} points", f"2 to {MOST_POINTS} points")
        state = self._session.state
        tip = _tip(state)
        near = np.linalg.norm(tip - points[0]) < 1e-3 * state.design.length
        self._take(TipPath.through(points, state.activation if near else None))

    def _moved(self, event: Any) -> None:
        if event.client_id is None or self._shown is None:
            return
        activations, session = self._shown.activation.values, self._session
        attempt(
            session,
            lambda: session.update(lambda state: at_point(state, activations, int(self._at.value))),
        )

    def _played(self) -> None:
        if self._play.value == "Play":
            self._session.follow("play")
        else:
            self._session.stop("play")

    def _save_csv(self) -> None:
        if self._shown is not None:
            content = path_csv(self._shown).encode()
            self._session.client.send_file_download("path.csv", content, save_immediately=True)


def end_text(track: xr.Dataset, arm: Manipulator) -> str:
    """End of a path that is followed, and the reason for it, in words.

    Args:
        track: Result of `track_path`.
        arm: The design.
    """
    count, points = int((track.status == PathStatus.FOLLOWED).sum()), track.sizes["point"]
    end, way = track.attrs["end"], arm.length_unit.rounded(float(track.end_length))
    if end == "no_start":
        return "The first point is not reached: out of reach, or not from this activation."
    followed = f"{count} of {points} points are followed"
    reasons = {
        "": f"All {points} points are followed: {way} of path.",
        "fold": f"{followed}, {way} of path: there the branch turns back (a fold).",
        "unstable": f"{followed}, {way} of path: there the arm loses its stability.",
        "bound": (
            f"{followed}, {way} of path: there {track.attrs['end_bundle']} is at its "
            f"{track.attrs['end_bound']} bound."
        ),
    }
    return reasons[end]


def _tip(state: StudioState) -> np.ndarray:
    """Place of the tip [m]; an arm without equilibrium is refused."""
    tip = solvable_rod(state.design).tips(np.array([state.activation]))[0]
    if not np.isfinite(tip).all():
        raise InvalidInput("activation", state.activation, "one with an equilibrium")
    return tip
