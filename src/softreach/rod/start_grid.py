"""Where to begin the search for an equilibrium: between those on a grid over the activation box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.loaded.grid_values import interpolate
from softreach.rod.activation_box import ActivationBox

__all__ = ["StartGrid", "grid_sizes"]

Array = NDArray[np.float64]

_NODES = {1: 33, 2: 33, 3: 17, 4: 9}
"""Nodes per free bundle: at most a few thousand equilibria, some ten milliseconds."""


def grid_sizes(box: ActivationBox) -> tuple[int, ...] | None:
    """Nodes for every bundle, or None for more free bundles than a grid can hold."""
    nodes = _NODES.get(box.dimension)
    if nodes is None:
        return None
    return tuple(nodes if free else 1 for free in box.is_free)


@dataclass(frozen=True, eq=False)
class StartGrid:
    """Frames of the tip at the nodes of a grid."""

    box: ActivationBox
    sizes: tuple[int, ...]
    frames: Array
    """What `Equilibria.frame` holds, of the nodes."""

    @classmethod
    def over(
        cls, box: ActivationBox, sizes: tuple[int, ...], find: Callable[[Array], Array]
    ) -> StartGrid:
        """Solve at the nodes.

        Args:
            box: The activations within bounds.
            sizes: Nodes for every bundle.
            find: Frames of activations (n, bundles).
        """
        ends = zip(box.low, box.high, sizes, strict=True)
        axes = np.meshgrid(*(np.linspace(*end) for end in ends), indexing="ij")
        return cls(box, sizes, find(np.stack(axes, axis=-1).reshape(-1, box.bundles)))

    def at(self, gamma: Array) -> Array:
        """Frames to begin from."""
        sizes = np.array(self.sizes)
        found = np.empty((len(gamma), self.frames.shape[1]))
        interpolate(self.frames, gamma, self.box.low, (sizes - 1) / self.box.scales, sizes, found)
        return found
