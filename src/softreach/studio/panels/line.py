"""A line of text in a panel, which is shown as it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softreach.studio import markup

if TYPE_CHECKING:
    from viser import GuiApi

__all__ = ["Line"]


class Line:
    """Text that changes; without any the line takes no room."""

    def __init__(self, gui: GuiApi, *parts: markup.Part) -> None:
        """Add the line where the panel is being built."""
        self._widget = gui.add_html(markup.paragraph(*parts), visible=bool(parts))

    def say(self, *parts: markup.Part) -> None:
        """Show text, some of it bold."""
        self.show(markup.paragraph(*parts))

    def warn(self, text: str) -> None:
        """Show in red what is wrong; "" for nothing."""
        self.show(markup.alert(text) if text else "")

    def show(self, content: str) -> None:
        """Show what `markup` made."""
        if self._widget.content != content:
            self._widget.content = content
        if self._widget.visible != bool(content):
            self._widget.visible = bool(content)

    def remove(self) -> None:
        """Take the line away."""
        self._widget.remove()
