"""A place in a panel for a picture that changes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from viser import GuiApi

__all__ = ["PictureFrame"]


class PictureFrame:
    """Empty until there is a picture."""

    def __init__(self, gui: GuiApi, container: Any) -> None:
        """Take the place."""
        self._gui, self._container = gui, container
        self._widget: Any = None
        self._shown: NDArray[np.uint8] | None = None

    def show(self, image: NDArray[np.uint8]) -> None:
        """Show a picture, RGB from 0 to 255, shape (rows, columns, 3)."""
        if image is self._shown:
            return
        self._shown = image
        if self._widget is None:
            with self._container:
                self._widget = self._gui.add_image(image, format="png")
        else:
            self._widget.image = image
