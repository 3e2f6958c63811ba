"""Fields of a tab: a panel declares once what it shows of the state and of what is known.

What is declared names what it follows: "design" or "appearance.slice" of the state, "found.tip" of
what is known, "tab.busy" of the session. Fields also write what a person changes into the state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from operator import attrgetter, is_
from typing import Any, NamedTuple

from softreach.studio.found import Found, in_session
from softreach.studio.markup import Part, paragraph
from softreach.studio.session import Change, Session
from softreach.studio.shown_parameters import typed_unit
from softreach.studio.state import LARGEST, StudioState, vector
from softreach.studio.widgets import Ends, Line, Slider, TextKind, TypedField, number_kind, unit_in
from softreach.support.errors import SoftreachError
from softreach.support.files.text import text_of

Action = Callable[[], object]
Names = Mapping[Any, str]
Options = Callable[[StudioState], Names]
Kind = Callable[[str, Callable[[], float]], TextKind]
"""What is typed, by its unit and by L [m], which may be typed as one."""
Build = Callable[["Fields", Any], object]  # declares fields for a key
Shown = Callable[[StudioState, Found], Any]  # something of the state and of what is known
Where = Shown | str
"""True where something is shown, or the path of what is true there; "" for everywhere."""
GRAY: Any = {"color": "gray"}  # looks of a button that is not the first of its group


class Attribute(NamedTuple):
    """A value of the state, or of what is found, that a field shows and changes."""

    read: Callable[[Any], Any]
    write: Callable[[Any, Any], Any]
    of: str = "state"
    follows: str = ""  # path of all that decides the value; "" for any part of the owner


def attribute(path: str) -> Attribute:
    """The value at a path in the state, such as "appearance.slice.center"."""
    name, _, rest = path.partition(".")
    part = attribute(rest) if rest else None

    def write(owner: Any, value: Any) -> Any:
        return replace(owner, **{name: part.write(getattr(owner, name), value) if part else value})

    return Attribute(attrgetter(path), write, follows=path)


def of_design(read: Callable[[Any], Any], write: Callable[[Any, Any], Any]) -> Attribute:
    """A value of the design, and the design with another one."""
    made = lambda state, value: state.replace(design=write(state.design, value))
    return Attribute(lambda state: read(state.design), made, follows="design")


def in_unit(read: Callable[[Any], Any], write: Callable[[Any, Any], Any], size: float) -> Attribute:
    """A value of a design in a unit of some size, 0 for that of lengths that are typed."""
    scale = lambda arm: size or typed_unit(arm).size
    shown = lambda arm: _over(read(arm), scale(arm))
    return of_design(shown, lambda arm, value: write(arm, _times(value, scale(arm))))


def _times(value: Any, scale: float) -> Any:
    return vector(scale * v for v in value) if isinstance(value, tuple) else scale * value


def _over(value: Any, scale: float) -> Any:
    over = lambda number: number if scale == 1.0 else float(f"{number / scale:.10g}")
    return vector(map(over, value)) if isinstance(value, tuple) else over(value)


class Fields:
    """Widgets of a panel. A refused value stays in its field, and the reason stands below it."""

    def __init__(self, session: Session) -> None:
        self.session, self.gui = session, session.client.gui
        self.message: Line | None = None
        """Where refusals of widgets stand that have no line of their own; else above all tabs."""
        self.words: Callable[[SoftreachError], str] = str  # says a refusal in words
        self._followers: list[list[Any]] = []
        """Each reads what it follows, what that was when it was shown last, and shows it."""
        self._anew: list[Fields] = []
        self._bindings: list[_Binding] = []
        self._widgets: list[Any] = []
        self._depth = 0
        self._refused: Any = None

    def show(self) -> None:
        """Show again what has changed."""
        session = self.session
        for follower in self._followers:
            read, known, show = follower
            now = read(session)
            if not all(map(is_, now, known)):
                follower[1] = now
                show(session.state, session.found)
        for fields in self._anew:
            fields.show()

    def remove(self) -> None:
        """Take all widgets away."""
        self._bindings.clear()
        for widget in self._widgets:
            widget.remove()

    def follow(self, *paths: str, show: Callable[[StudioState, Found], object]) -> None:
        """Call this at first, and whenever what stands at one of these paths is another object."""
        read = attrgetter("client", *map(in_session, paths))
        self._followers.append([read, (object(),), show])

    def say(self, *parts: Part) -> None:
        """Text that stays."""
        self.kept(Line(self.gui, *parts))

    def text(self, *paths: str, content: Callable[[StudioState, Found], Sequence[Part]]) -> Line:
        """A line of text that follows; without parts it takes no room."""
        return self.html(*paths, content=lambda *known: paragraph(*content(*known)))

    def html(self, *paths: str, content: Callable[[StudioState, Found], str]) -> Line:
        """Something of `markup` that follows."""
        line = self.kept(Line(self.gui))
        self.follow(*paths, show=lambda *known: line.show(content(*known)))
        return line

    @contextmanager
    def folder(self, label: str, shown: Where = "", *, expanded: bool = True) -> Iterator[Any]:
        """A folder for what is declared inside the block."""
        folder = self._seen_where(self.gui.add_folder(label, expand_by_default=expanded), shown)
        self._depth += 1
        with folder:
            yield folder
        self._depth -= 1

    def anew(
        self, label: str, *paths: str, key: Shown = lambda *_: object(), build: Build, **looks: Any
    ) -> None:
        """A folder whose fields are made anew where their key differs, by default always."""
        known, number = object(), len(self._anew)
        self._anew.append(Fields(self.session))
        with self.folder(label, **looks) as folder:
            pass

        def fit(state: StudioState, found: Found) -> None:
            nonlocal known
            if (now := key(state, found)) != known:
                self._anew[number].remove()
                self._anew[number], known = Fields(self.session), now
                with folder:
                    build(self._anew[number], now)

        self.follow(*paths, show=fit)

    def checkbox(self, label: str, at: Attribute, hint: str) -> Any:
        """Add a check box."""
        return self.bind(self.gui.add_checkbox(label, self._read(at), hint=hint), at)

    def dropdown(self, label: str, options: Names | Options, at: Attribute, hint: str) -> Any:
        """Add a menu; options say what each value is called, if need be in each state."""
        offered = options if callable(options) else lambda _: options
        at = at._replace(follows="state") if callable(options) else at
        names = offered(self.session.state)
        labels, shown = tuple(names.values()), names[self._read(at)]
        widget = self.gui.add_dropdown(label, labels, initial_value=shown, hint=hint)
        return self.bind(widget, at, offered)

    def slider(self, label: str, ends: Ends, step: float, at: Attribute, hint: str) -> Slider:
        """Add a slider beside a field for the same number."""
        kind = self._kind(number_kind, label)
        return self.bind(Slider(self.gui, label, ends, step, self._read(at), hint, kind), at)

    def typed(self, label: str, at: Attribute, hint: str, kind: Kind = number_kind) -> TypedField:
        """Add a field for a number, or for what else is typed."""
        of_unit = self._kind(kind, label)
        return self.bind(TypedField(self.gui, label, self._read(at), hint, of_unit), at)

    def steps(
        self, label: str, *paths: str, at: Shown, move: Callable[[int], object], hint: str
    ) -> None:
        """Add a slider over whole numbers, whose value and last number follow."""
        slider, session = self.kept(self.gui.add_slider(label, 0, 1, 1, 0, hint=hint)), self.session

        def show(state: StudioState, found: Found) -> None:
            value, last = at(state, found)
            slider.max, slider.value, slider.visible = max(last, 1), value, last > 0

        last = lambda: at(session.state, session.found)[1]
        slider.on_update(self._by_hand(lambda: move(min(int(slider.value), last()))))
        self.follow(*paths, show=show)

    def button(self, label: str, act: Action, hint: str, shown: Where = "", **looks: Any) -> Any:
        """Add a button that acts."""
        button = self._seen_where(self.gui.add_button(label, hint=hint, **looks), shown)
        button.on_click(lambda _: attempt(self.session, act))
        return button

    def change(self, label: str, to: Change, hint: str, shown: Where = "", **looks: Any) -> None:
        """Add a button that changes the state."""
        self.button(label, lambda: self.apply(to), hint, shown, **looks)

    def choices(self, label: str, actions: Mapping[str, Action], hint: str) -> None:
        """Add a row of buttons."""
        row = self.kept(self.gui.add_button_group(label, tuple(actions), hint=hint))
        row.on_click(lambda _: attempt(self.session, actions[row.value]))

    def upload(self, label: str, read: Callable[[Any], object], hint: str, **looks: Any) -> None:
        """Add a button that asks for a file."""
        button = self.kept(self.gui.add_upload_button(label, hint=hint, **looks))
        button.on_upload(lambda _: attempt(self.session, lambda: read(button.value)))

    def bind(self, widget: Any, at: Attribute, options: Options | None = None) -> Any:
        """Bind a widget, and return it."""
        # Events run at once and in any order: each reads what the widget holds by then, so that the
        # last one has it right. Widgets that we set ourselves also send events, without a client.
        binding = _Binding(self.session, widget, at, options)
        act = self.session.learn if at.of == "found" else lambda change: self.apply(change, widget)
        widget.on_update(self._by_hand(lambda: act(binding.write)))
        self._bindings.append(binding)
        self.follow(at.follows or at.of, "tab.revision", show=lambda *_: binding.follow())
        return self.kept(widget)

    def _by_hand(self, action: Action) -> Callable[[Any], object]:
        """What acts where a person moved a widget, and not where the program did."""
        return lambda event: event.client_id is not None and attempt(self.session, action)

    def apply(self, change: Change, widget: Any = None) -> None:
        """Change the state, or say below the widget why that cannot be."""
        session, before = self.session, self._refused
        place, refusal = widget if isinstance(widget, TypedField) else self.message, ""
        dragged = isinstance(widget, Slider)
        try:
            session.update(change, by_widget=widget is not None, goes_on=dragged)
        except SoftreachError as error:
            refusal = self.words(error)
            if place is None:
                session.fail(error)
        with session.lock:
            for line in {before, place} - {None}:
                line.warn(refusal if line is place else "")
            self._refused = place if refusal else None
            if not refusal and (widget is None or before not in (None, place)):
                for binding in self._bindings:  # what was refused is given up
                    binding.follow(anyway=True)

    def _kind(self, kind: Kind, label: str) -> TextKind:
        return kind(unit_in(label), lambda: self.session.state.design.length)

    def _read(self, at: Attribute) -> Any:
        return at.read(getattr(self.session, at.of))

    def kept(self, widget: Any) -> Any:
        """Take this widget away with the others; return it."""
        if not self._depth:  # a folder takes along what is in it
            self._widgets.append(widget)
        return widget

    def _seen_where(self, widget: Any, shown: Where) -> Any:
        def follow(state: StudioState, found: Found) -> None:
            is_so = shown(state, found) if callable(shown) else read(self.session)
            widget.visible = bool(is_so)

        paths = ("state", "found") if callable(shown) else (shown,)
        read = attrgetter(*map(in_session, paths))
        if shown:
            self.follow(*paths, show=follow)
        return self.kept(widget)


class _Binding:
    def __init__(
        self, session: Session, widget: Any, at: Attribute, options: Options | None
    ) -> None:
        self._session, self._widget, self._at, self._options = session, widget, at, options
        self._revision = session.revision
        self._seen = at.read(getattr(session, at.of))
        """Value of the state when the widget last showed it."""
        self._held = widget.value  # value of the widget when it was last read or set

    def write(self, owner: Any) -> Any:
        """The state with what the widget holds; what it only shows rounded is left as it is."""
        value, known = self._widget.value, self._at.read(owner)
        self._held = value
        if self._options is not None:
            names = self._options(self._session.state)
            value = {name: value for value, name in names.items()}.get(value, known)
        if value == known:  # as of a menu whose option is of a design before
            return owner
        new = self._at.write(owner, value)
        self._seen = self._at.read(new)
        return new

    def follow(self, *, anyway: bool = False) -> None:
        session, widget = self._session, self._widget
        value = shown = self._at.read(getattr(session, self._at.of))
        anyway = anyway or value != self._seen or session.revision != self._revision
        is_ahead = widget.value != self._held  # of a hand whose event waits for another change
        if self._options is not None:
            names = self._options(session.state)
            shown = names[value]
            if tuple(widget.options) != tuple(names.values()):
                is_ahead = is_ahead and widget.value in names.values()
                widget.options, anyway = tuple(names.values()), True
        self._seen, self._revision = value, session.revision
        if anyway and not is_ahead:
            if widget.value != shown:
                widget.value = shown
            self._held = widget.value


def attempt(session: Session, action: Action) -> None:
    """Act, and show the reader what is wrong if that fails: a person sees no log."""
    try:
        action()
    except Exception as error:
        session.fail(error)


def file_text(name: str, content: bytes) -> str:
    """The text in a file that a person opens; `name` is what errors call it."""
    return text_of("file", name, content, LARGEST)
