"""Free rods on a GPU: the tables and the parts of the kernels are those of the CPU."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from threading import Lock

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.free import FreeRod
from softreach.rod.tip_map import TipOutputs, TipStatus, position_slopes
from softreach.support.arrays import Array
from softreach.support.errors import NotPossible, check_installed
from softreach.support.lazy import lazy

_ONE_AT_A_TIME = Lock()  # kernels of several threads would only share the memory of the GPU


@cache
def device_name() -> str:
    """Name of the GPU.

    Raises:
        MissingExtra: numba-cuda is not installed.
        NotPossible: There is no GPU, or no driver for it.
    """
    from numba import config

    if config.ENABLE_CUDASIM:  # pyright: ignore[reportAttributeAccessIssue]
        return "simulator of CUDA"
    check_installed("numba_cuda")
    from numba import cuda

    if not cuda.is_available():
        raise NotPossible(
            "device = cuda: this process sees no GPU of NVIDIA with a driver; look at what "
            'nvidia-smi prints, or compute on the CPU with device = "cpu"'
        )
    return str(cuda.get_current_device().name)


def check_device_memory(needed: float) -> None:
    """Refuse what takes more memory than is free on the GPU [bytes].

    Raises:
        NotPossible: There is less.
    """
    from numba import cuda

    if needed > (free := cuda.current_context().get_memory_info()[0]):
        raise NotPossible(
            f"this needs {needed / 1e9:.2f} GB of memory on the GPU, of which {free / 1e9:.2f} GB "
            'are free: end what else runs there, or compute on the CPU with device = "cpu"'
        )


@dataclass(frozen=True, repr=False)
class CudaRod(FreeRod):
    """A free rod whose tips and derivatives are computed on a GPU; its shapes, on the CPU.

    Raises:
        NotPossible: The GPU has too little memory, or the arm has loads.
    """

    @classmethod
    def of(cls, inner: Manipulator, tol: float) -> CudaRod:
        """The rod of an arm, if a GPU can have it."""
        if inner.loads is not None:
            raise NotPossible(
                "device = cuda: arms under loads are computed on the CPU, where the search for an "
                "equilibrium carries many rods side by side; leave out the loads or the device"
            )
        return cls(inner, tol)

    @property
    def block(self) -> int:
        return 1 << 20

    @property
    def device(self) -> str:
        return device_name()

    @lazy
    def packed(self) -> Array:
        """The table of the steps without the columns that pad it, shape (step, row, bundle + 1)."""
        return np.ascontiguousarray(self.table[:, :, [*range(self.box.bundles), -1]])

    def _prepare(self) -> None:
        self.packed  # noqa: B018

    def fill(self, gamma: Array, out: TipOutputs) -> None:
        """Put tips, and what else is wanted, into place: theory (25), (29) and (31)."""
        tips, slopes, twists, status, directions = out
        with _ONE_AT_A_TIME:
            check_device_memory(8.0 * gamma.shape[0] * (3 + 7 * gamma.shape[1]))
            self._run(gamma, self.offset, tips, slopes if twists is None else twists)
            if directions is not None:  # d3, by which a point farther out is away
                farther = self.offset + np.array([0.0, 0.0, self.length])
                self._run(gamma, farther, directions, None)
        if directions is not None:
            np.divide(directions - tips, self.length, out=directions)
        if slopes is not None and twists is not None:
            position_slopes(tips, twists, slopes)
        if status is not None:
            status[:] = TipStatus.STABLE

    def _run(self, gamma: Array, start: Array, tips: Array, moves: Array | None) -> None:
        from numba import cuda

        from softreach.kernels.rod import cuda as kernels

        kernel = kernels.walk(gamma.shape[1], moves is not None)
        outputs = [tips, np.empty((0, 3, 0)) if moves is None else moves]
        given = [cuda.to_device(np.ascontiguousarray(a)) for a in (self.packed, gamma, start)]
        made = [cuda.device_array(values.shape) for values in outputs]
        kernel[-(-len(gamma) // kernels.THREADS), kernels.THREADS](*given, *made)
        for source, target in zip(made, outputs[: 1 + (moves is not None)], strict=False):
            target[...] = source.copy_to_host()
