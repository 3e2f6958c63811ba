"""The moving arm: dragged by its tip, by its activations, to a target, or along a path."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.export.clouds import path_csv
from softreach.inverse.path import Drag, PathStatus, end_text, track_path
from softreach.inverse.request import positions_in
from softreach.schema import input_symbols
from softreach.studio.captions import place_text, tip_text
from softreach.studio.fields import GRAY, Attribute, Fields, attempt, attribute
from softreach.studio.found import Found, Lag, Pull
from softreach.studio.jobs import Given, Job, Learned, Results
from softreach.studio.scene.drag import DragBall
from softreach.studio.scene.scene import DARK, MARK, pieces
from softreach.studio.session import Session
from softreach.studio.shown_parameters import three_digits
from softreach.studio.state import MOUSE, StudioState, TipPath, rod_of, solvable_rod, vector
from softreach.studio.widgets import TextKind, TypedField, numbers_in, vector_kind
from softreach.studio.work import all_cores
from softreach.support.errors import InvalidInput
from softreach.support.quantity import five_digits
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    import xarray as xr
    from viser import UploadedFile

    from softreach.inverse import Solution

_DRAG_HINT = "Drag the ball on the tip, or an arrow: the arm follows on its branch of solutions."
_KINDS = {"N": "tension", "Pa": "pressure"}  # kinds of inputs by their units
_MOST = 40  # sliders: a page with hundreds takes minutes to build
_HERE = "\N{CHECK MARK} "
_NEAR = 1e-4  # of the ranges of activations, within which the arm is in a solution
_POINTS = 24  # of the straight line to each place that is clicked
_OUT_OF_REACH = {1: "out of reach", 3: "reached only where the arm touches something"}
_FAMILY = 6  # shapes offered where infinitely many reach the target
_DECIMALS = 5  # of the place where a drag rests [L]: a hundredth of a pixel, and can be read
_RESIDUAL = 1e-8  # [L]
_STEP, _FRAMES = 0.05, 41  # [s] between points that are played; points of a planned path
_TARGET, _END, _NEAREST = 0.012, 0.014, 0.008  # radii [L]: smaller than the ball on the tip
_WAY = 0.15  # length of the line along the direction that is wanted [L]
_DIRECTION = TextKind(
    "three numbers, or nothing",
    lambda text: numbers_in(text, 3, "", 1.0) if text.strip() else (),
    lambda way: ", ".join(map(five_digits, way)),
)
_ABOUT_DIRECTION = "Where the tip should point at the target, as x, y, z; empty for anywhere"
_PALE = (240, 175, 205)  # of a path, where the arm does not follow it


def drag(panel: Fields) -> None:
    """Use of the mouse in the scene, and the ball on the tip that it may drag."""
    session = panel.session
    pull = lambda phase, wanted: {"pull": Pull(wanted, rests=phase == "end")}
    order = lambda *given: session.learn(pull(*given), quiet=True)  # only the latest is followed
    eye = lambda: np.array(session.camera.actual().position)
    ball = DragBall(session.client.scene, order, eye)
    about = "Use of the mouse in the scene, which it turns besides; a click is on a reached place"
    panel.dropdown("mouse", MOUSE, attribute("appearance.mouse"), about)

    def place(state: StudioState, found: Found) -> None:
        arm, look, lag = state.design, state.appearance, found.lag
        grasped = look.mouse == "tip" and look.arm and rod_of(arm).box.dimension > 0
        grasped = grasped and found.sample is None  # a marker may be on the tip
        radius = float(arm.profile.radius(arm.length)) / arm.length
        clear = state.path is not None
        ball.move(found.tip if grasped else None, radius, dark=look.dark, clear=clear)
        ends = None if lag is None else (lag.wanted, lag.dragged.tip / arm.length)
        short = lag.dragged.gap if lag is not None else 0.0
        ball.show_lag(ends, arm.length_unit.rounded(short, digits=".3g") if short else "")

    follows = "design", "appearance", "path", "found.tip", "found.sample", "found.lag"
    panel.follow(*follows, show=place)
    hint = lambda state, _: [_DRAG_HINT] * (state.appearance.mouse == "tip")
    panel.text("appearance.mouse", content=hint)


def activation(panel: Fields) -> None:
    """Activations of the bundles within their bounds, and the place of the tip."""
    follows = "design", "found.tip", "found.pointing", "found.posture"
    panel.text(*follows, content=tip_text)
    panel.anew("activation", "design", key=_slider_ends, build=_sliders)
    rest = "Sets every activation to 0, or the nearest to it"
    panel.change("Rest", lambda state: state.replace(activation=()), rest, **GRAY)


def _sliders(panel: Fields, ends: Sequence[tuple[str, float, float]]) -> None:
    def write(bundle: int, state: StudioState, value: float) -> StudioState:
        before = state.activation
        return state.replace(activation=(*before[:bundle], value, *before[bundle + 1 :]))

    for bundle, (label, low, high) in enumerate(ends[:_MOST]):
        if low == high:  # it is held
            continue
        hint = f"{label}: activation of a bundle, from {low:g} to {high:g}; 0 is at rest"
        step = 10.0 ** (math.floor(math.log10(high - low)) - 3)  # round
        at = Attribute(lambda state, k=bundle: state.activation[k], partial(write, bundle))
        around = three_digits(low, -1), three_digits(high)  # the state keeps to the bounds
        panel.slider(label, around, step, at, hint)
    if (hidden := len(ends) - _MOST) > 0:
        panel.say(f"{hidden} more bundles have no slider here.")


def _slider_ends(state: StudioState, _: Found) -> list[tuple[str, float, float]]:
    arm, ends = state.design, []
    numbers = input_symbols(arm), arm.input_names, arm.input_units, rod_of(arm).box.bounds
    for symbol, name, unit, (low, high) in zip(*numbers, strict=True):
        label = f"{_KINDS[unit]} of {name}" if unit in _KINDS else f"{symbol} {name}"
        ends.append((label + (unit != "1") * f" [{unit}]", low, high))
    return ends


def target(panel: Fields) -> None:
    """The target, and the activations that reach it, in the unit of the design."""
    unit = lambda state, _: state.design.length_unit
    panel.anew("reach a place", "design", key=unit, build=_target)


def _target(panel: Fields, unit: LengthUnit) -> None:
    session, arm = panel.session, panel.session.state.design
    panel.text("found.answer", content=_answer_text)
    kind = vector_kind(unit.name, lambda: session.state.design.length)
    straight = tuple(unit.of(arm.base.to_world([0.0, 0.0, arm.length])).tolist())
    field = TypedField(panel.gui, unit.label("target"), straight, "Where the tip should go", kind)
    aim = lambda _: attempt(session, lambda: session.aim(unit.size * np.array(field.value)))
    panel.kept(field).on_update(aim)

    def follow(state: StudioState, _: Found) -> None:
        if state.target is not None:
            field.value = tuple(unit.of(np.array(state.target)).tolist())

    panel.follow("target", show=follow)
    panel.typed("direction", attribute("direction"), _ABOUT_DIRECTION, lambda *_: _DIRECTION)
    panel.typed("within [deg]", attribute("cone"), "Angle from that direction that is allowed")
    present = lambda state: state.replace(direction=tuple(session.found.pointing.round(4).tolist()))
    panel.change("As it points now", present, "Keeps the direction of the tip", **GRAY)
    known = lambda _, found: found.answer is not None
    panel.anew("activations", "found.answer", build=_solutions, shown=known)
    about, off = "Takes target and solutions away", lambda state: state.replace(target=None)
    panel.change("Clear the target", off, about, "target", **GRAY)


def _solutions(panel: Fields, _: object) -> None:
    """A button for each solution, or for the nearest; one with a check mark is the present one."""
    answer = panel.session.found.answer
    for row in _shapes(answer) if answer is not None else ():
        text = ", ".join(f"{value:.4g}" for value in row)
        act = lambda row=row: take(panel.session, row)
        button = panel.button(text, act, "Moves the arm there")

        def mark(state: StudioState, _: Found, row: Any = row, button: Any = button) -> None:
            scales = np.maximum(np.ptp(rod_of(state.design).box.bounds, axis=1), 1e-12)
            is_here = len(scales) == len(row)  # else it is of a design before
            is_here = is_here and bool((np.abs(row - state.activation) <= _NEAR * scales).all())
            label = button.label.removeprefix(_HERE)
            button.label = _HERE * is_here + label

        panel.follow("design", "activation", show=mark)


def take(session: Session, activation: Any) -> None:
    """Move the arm to a solution; with surroundings on a way on which it touches nothing."""
    goal = tuple(activation.tolist())
    if _plans(session.state.design):
        session.learn({"goal": goal})
    else:
        session.update(lambda state: state.replace(activation=goal))


def _plans(arm: Manipulator) -> bool:
    return bool(arm.surroundings) and arm.loads is None


def _answer_text(state: StudioState, found: Found) -> list[str]:
    if (answer := found.answer) is None:
        return ["Every activation that reaches a place: drag the tip there, type it, or click."]
    arm, unit = state.design, state.design.length_unit
    place = place_text(answer.target / arm.length, arm)
    if not len(answer):
        certain = _OUT_OF_REACH.get(answer.status, "not reached, perhaps out of reach")
        near = place_text(answer.nearest / arm.length, arm)
        gap, off = unit.rounded(answer.gap, digits=".3g"), _angle_text(answer.direction_gap)
        return [f"{place} is {certain}. Nearest: {near}, position error {gap}{off}."]
    count = "1 activation reaches" if len(answer) == 1 else f"{len(answer)} activations reach"
    return [
        f"{count} {place}, position error {unit.rounded(answer.residuals.max(), digits='.1e')}"
        f"{_angle_text(answer.direction_errors.max())}. Press one "
        f"({', '.join(arm.input_names)}) to move the arm there; it is at the one with a check mark."
    ]


def _angle_text(angle: float) -> str:
    return "" if math.isnan(angle) else f", direction error {math.degrees(angle):.3g}°"


def _shapes(answer: Solution) -> np.ndarray:
    """The activations that reach the target, or those that bring the tip nearest to it."""
    return answer.activations if len(answer) else answer.nearest_activation[None]


def path(panel: Fields) -> None:
    """A path of the tip: loaded or clicked, followed, played and saved."""
    session = panel.session
    with panel.folder("follow a path"):
        about = "The tip follows a path as far as its branch of solutions goes"
        panel.say(f"{about}: load one, or click it.")
        read = lambda file: _read_path(session, file)
        panel.upload("Load a path (CSV)", read, "columns x, y, z [m]", mime_type=".csv,text/csv")
        about, off = "and what was found along it", lambda state: state.replace(path=None)
        panel.change("Remove the path", off, about, "path", **GRAY)
        panel.text("design", "path", "found.track", content=_path_text)
        with panel.folder("along it", lambda *known: len(_followed(*known)) > 0):
            plays = {"Play": lambda: session.follow("play"), "Stop": lambda: session.stop("play")}
            panel.choices("", plays, "the arm along the path, from the point that is chosen")
            at = lambda s, found: (s.path.at if s.path else 0, max(len(_followed(s, found)) - 1, 0))
            hint = "point of the path where the arm is"
            follows = "path", "found.track"

            def move(point: int) -> None:
                activations = _followed(session.state, session.found)
                session.update(lambda state: _at_point(state, activations, point))

            panel.steps("point", *follows, at=at, move=move, hint=hint)

            def save() -> None:
                if (track := _track(session.state, session.found)) is not None:
                    session.send("path.csv", path_csv(track).encode)

            tracked = lambda *known: _track(*known) is not None
            panel.button("Save the path (CSV)", save, "with its activations", tracked)


def _path_text(state: StudioState, found: Found) -> list[str]:
    if state.path is not None and state.path.activations:
        return ["A planned path, along which the arm touched nothing."]
    track = _track(state, found)
    text = "following ..." if track is None else end_text(track, state.design.length_unit)
    return [text] * (state.path is not None)


def _track(state: StudioState, found: Found) -> xr.Dataset | None:
    """What was found along the path that there is now."""
    track, path = found.track, state.path
    fits = track is not None and path is not None and track.sizes["point"] == len(path.points)
    return track if fits else None


def _followed(state: StudioState, found: Found) -> np.ndarray:
    """Activations at the points of the path as far as the arm follows it, shape (k, bundles)."""
    if state.path is not None and state.path.activations:
        return np.array(state.path.activations)
    if (track := _track(state, found)) is None:
        return np.empty((0, len(state.activation)))
    return track.activation.values[track.status.values == PathStatus.FOLLOWED]


def extend_path(session: Session, point: np.ndarray) -> None:
    """Lead the path straight on to a place [m]; the first begins at the tip."""
    state, path = session.state, session.state.path
    before = np.array(path.points) if path is not None else _tip(state)[None]
    start = state.activation if path is None else path.start
    more = np.linspace(before[-1], point, _POINTS + 1)[1:]
    longer = TipPath.through(np.concatenate([before, more]), start)
    session.update(lambda state: state.replace(path=longer))


def _read_path(session: Session, file: UploadedFile) -> None:
    points = positions_in(file.content, file.name)
    state = session.state
    near = np.linalg.norm(_tip(state) - points[0]) < 1e-3 * state.design.length
    read = TipPath.through(points, state.activation if near else None)
    session.update(lambda state: state.replace(path=read))


def _tip(state: StudioState) -> np.ndarray:
    """Place of the tip [m]; an arm without equilibrium is refused."""
    tip = solvable_rod(state.design).tips(np.array([state.activation]))[0]
    if not np.isfinite(tip).all():
        raise InvalidInput("activation", state.activation, "one with an equilibrium")
    return tip


def _solve(given: Given) -> Sequence[Learned]:
    from softreach.inverse import solve_inverse

    state, change = given.state, None
    if state.target is None:
        return [Learned({"answer": None})]
    solvable_rod(state.design)
    near = state.activation if len(state.activation) > 3 else None
    options: dict[str, Any] = {"near": near, "family": _FAMILY, "from_rest": True}
    options["free"] = bool(state.design.surroundings)
    if state.direction:
        options |= {"direction": state.direction, "cone": math.radians(state.cone)}
    answer = solve_inverse(state.design, [state.target], **options)[0]
    if given.found.takes_nearest and len(answer):
        distance = np.linalg.norm(answer.activations - state.activation, axis=1)
        best = tuple(answer.activations[np.argmin(distance)].tolist())
        if _plans(state.design):
            return [Learned({"answer": answer, "takes_nearest": False, "goal": best})]
        change = lambda now: now.replace(activation=best)
    return [Learned({"answer": answer, "takes_nearest": False}, change)]


def _draw_answer(given: Given) -> None:
    """The shapes that reach the target, a ball there, or a line to the nearest place in reach."""
    answer, design, scene = given.found.answer, given.state.design, given.scene
    scene.remove("/ghosts", "/target", "/gap")
    if answer is None:
        return
    target, nearest = answer.target / design.length, answer.nearest / design.length
    scene.api.add_icosphere("/target", _TARGET, MARK, position=target)
    if not len(answer):
        scene.lines("/gap", pieces(np.stack([target, nearest])), MARK, 0.004)
        scene.api.add_icosphere("/gap/nearest", _NEAREST, DARK, position=nearest)
    if (way := np.array(given.state.direction)).any():
        end = _WAY * way / np.linalg.norm(way)  # from the target, under which its node is
        scene.lines("/target/way", np.array([[np.zeros(3), end]]), MARK, 0.008)
        scene.api.add_icosphere("/target/way/end", _NEAREST, MARK, position=end)
    for k, activation in enumerate(_shapes(answer)):
        scene.draw_arm(design, activation.tolist(), f"/ghosts/{k}")


def _follow_tip(given: Given) -> Results:
    """Follow the latest place that a drag passes; where it rests, that is the target."""
    state, pull, drag = given.state, given.found.pull, given.found.drag
    if pull is None:
        return
    solvable_rod(state.design)
    if drag is None or drag.arm != state.design:
        drag = Drag(state.design)
    place = np.round(pull.place, _DECIMALS) if pull.rests else pull.place
    dragged = drag.to(state.activation, place * state.design.length)
    known: dict[str, Any] = {"drag": drag}
    if dragged is None:
        yield Learned(known)
    else:
        known |= {"held": (state.design, dragged), "lag": Lag(place, dragged)}
        target = vector(place * state.design.length) if pull.rests else None

        def moved(now: StudioState) -> StudioState:
            if now.design != state.design:
                raise InvalidInput("design", "changed", "unchanged while its tip is dragged")
            return now.replace(activation=dragged.activation, target=target)

        yield Learned(known, moved)
    if pull.rests:
        # another drag may have begun meanwhile
        rested = lambda now: replace(now, pull=None, lag=None) if now.pull is pull else now
        yield Learned(rested, ends_step=True)


def _follow(given: Given) -> Results:
    path = given.state.path
    yield Learned({"track": None})
    if path is not None and not path.activations:
        rod = solvable_rod(given.state.design)
        fits = path.start is not None and len(path.start) == rod.box.bundles
        start = rod.box.clip(np.array(path.start)) if fits else None
        track = track_path(rod, np.array(path.points), start, residual_over_length=_RESIDUAL)
        yield Learned({"track": track})


def _draw_path(given: Given) -> None:
    """The path, pale, and as far as the arm follows it, dark; a ball where that ends."""
    path, scene, length = given.state.path, given.scene, given.state.design.length
    scene.remove("/path")
    if path is None:
        return
    points, track = np.array(path.points), _track(given.state, given.found)
    done = points[: len(_followed(given.state, given.found))]
    if track is not None and 0 < len(done) < len(points):
        end = track.end_position.values
        done = np.concatenate([done, end[None]])
        scene.api.add_icosphere("/path/end", _END, DARK, position=end / length)
    for name, line, color in (("all", points, _PALE), ("followed", done, MARK)):
        scene.lines(f"/path/{name}", pieces(line / length), color, 0.006)


def _move_to_goal(given: Given) -> Results:
    """Along a planned path to an activation; where there is none, the reader is told."""
    from softreach.inverse import plan

    arm, goal = given.state.design, given.found.goal
    if goal is None or len(goal) != arm.inputs:
        return
    with all_cores:
        planned = plan(arm, given.state.activation, goal).activation.values
    ways = np.append(0.0, np.cumsum(np.abs(np.diff(planned, axis=0)).sum(axis=1)))
    even = np.linspace(0.0, ways[-1], _FRAMES)
    rows = np.stack([np.interp(even, ways, each) for each in planned.T], axis=1)
    path = TipPath.through(rod_of(arm).tips(rows), activations=rows)
    yield Learned(change=lambda now: now.replace(path=path) if now.design == arm else now)
    yield from _played(given, rows, 0)


def _play(given: Given) -> Results:
    path, activations = given.state.path, _followed(given.state, given.found)
    start = path.at if path is not None and path.at < len(activations) - 1 else 0
    yield from _played(given, activations, start)


def _played(given: Given, activations: np.ndarray, start: int) -> Results:
    for point in range(start, len(activations)):
        given.check()
        yield Learned(change=lambda now, k=point: _at_point(now, activations, k))
        time.sleep(_STEP)


def _at_point(state: StudioState, activations: np.ndarray, point: int) -> StudioState:
    """The arm at a point of its path; the state as it is if the path is another one by now."""
    if state.path is None or point >= min(len(state.path.points), len(activations)):
        return state
    path = replace(state.path, at=point)
    return state.replace(path=path, activation=tuple(activations[point].tolist()))


_AIM: Any = {"wanted": "target", "makes": "answer takes_nearest", "draws": "/ghosts /target /gap"}
_OF_PATH: dict[str, Any] = {"wanted": "path", "makes": "track", "doing": "following the path"}
JOBS = (
    # The activations that reach the target, and their shapes
    Job("inverse", "design target direction cone", _solve, _draw_answer, **_AIM),
    # The arm follows its dragged tip on its branch; where that rests, every branch is looked for
    Job("drag", "found.pull", _follow_tip, makes="pull lag"),
    Job("path", "design path.points path.start", _follow, _draw_path, **_OF_PATH),
    Job("play", "", _play),
    # The arm moves to a solution between what is around it
    Job("goal", "found.goal", _move_to_goal, wanted="found.goal", doing="planning a free path"),
)
