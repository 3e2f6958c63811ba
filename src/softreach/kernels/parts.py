"""Parts that kernels call: handed over as they are written, and compiled where they are called.

Numba compiles a callee as if it were called from Python as well: it wraps it, optimizes it, turns
it into machine code, and then optimizes it again with each caller. A part stops after lowering, in
a library that its callers link. What they inline is optimized with them alone; the rest once by
itself too, as it runs slower otherwise (`design/cold_start.md`).

All of this rests on names that Numba keeps to itself. `missing` says which of them this version of
Numba lacks; then `compiler` compiles plainly: the same numbers to rounding, a slower first run.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from functools import cache
from typing import Any, Literal, cast

from llvmlite import binding
from numba.core.caching import FunctionCache
from numba.core.codegen import CPUCodegen, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime import _nrt_python  # pyright: ignore[reportAttributeAccessIssue]
from numba.core.typed_passes import NativeLowering

_PRIVATE: tuple[tuple[Any, tuple[str, ...]], ...] = (
    (JITCodeLibrary, ("_finalize_dynamic_globals", "_get_module_for_linking", "_finalized")),
    (JITCodeLibrary, ("_codegen", "_final_module", "_linking_libraries", "_reload_init")),
    (CPUCodegen, ("_module_pass_manager",)),
    (CPUDispatcher, ("add_overload", "get_call_template", "get_overload")),
    (DefaultPassBuilder, ("define_nopython_pipeline",)),
    (NativeLowering, ("run_pass",)),
    (FunctionCache, ("_load_overload", "_guard_against_spurious_io_errors")),
    (_nrt_python, ("c_helpers",)),
)


def missing() -> list[str]:
    """Private names of Numba that parts need and this version lacks.

    An attribute counts as present if its class has it or any of its constructors sets it.
    """
    return [
        f"{owner.__name__}.{name}"
        for owner, names in _PRIVATE
        for name in names
        if not hasattr(owner, name)
        and not any(name in _names_in_constructor(base) for base in getattr(owner, "__mro__", ()))
    ]


def _names_in_constructor(owner: type) -> tuple[str, ...]:
    return getattr(vars(owner).get("__init__"), "__code__", missing.__code__).co_names


class _PartLibrary(JITCodeLibrary):
    """Code to be linked, of which its callers make machine code."""

    inlined = False
    """True if callers must inline it: then it is optimized with them, else once, by itself."""

    def finalize(self) -> None:
        """Link what the part calls itself."""
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        if not self.inlined:  # once; Numba does it twice, the first time for counted references
            passes, builder = self._codegen._module_pass_manager()
            passes.run(self._final_module, builder)
        self._finalize_dynamic_globals()
        self._finalized = True


class _Key:
    """Stands for a part where Numba keeps the entry point of what is compiled."""


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    _name = "softreach_part_lowering"

    def run_pass(self, state: Any) -> Literal[True]:
        state.flags.no_compile = True
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.inlined = state.flags.forceinline
        super().run_pass(state)
        key, lowered = _Key(), state["cr"]
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        return True


class _PartCompiler(CompilerBase):
    """Numba's passes, the last of which does not compile."""

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_PartLowering, text) if step is NativeLowering else (step, text)
            for step, text in passes.passes
        ]
        passes.finalize()
        return [passes]


class _Pause:
    """Stops the collection of cyclic garbage, of which a compiler makes none worth the search."""

    def __init__(self) -> None:
        self._lock, self._depth, self._resume = threading.Lock(), 0, False

    def __enter__(self) -> None:
        with self._lock:
            if self._depth == 0:
                self._resume = gc.isenabled()
                gc.disable()
            self._depth += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0 and self._resume:
                gc.enable()


_PAUSE = _Pause()


@cache
def _prepare_target() -> None:
    """Let Numba load what any kernel needs, without SciPy's linear algebra.

    Numba imports that, for a tenth of a second, only to see that it is there. It asks again where a
    function multiplies matrices; no kernel of ours does.
    """
    from numba.np import linalg

    ensure, linalg.ensure_blas = linalg.ensure_blas, _installed_with_softreach
    try:
        cast(Any, cpu_target.target_context).refresh()
    finally:
        linalg.ensure_blas = ensure


def _installed_with_softreach() -> None:
    """SciPy is there."""


@cache
def _name_symbols() -> None:
    """Tell the linker what machine code of kernels calls in Numba's runtime, and no compiler."""
    for name, address in _nrt_python.c_helpers.items():
        binding.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def loaded(kept: FunctionCache, sig: Any, target_context: Any) -> Any:
    """Cached machine code for one set of types; None if it must be compiled.

    Numba would first declare to itself every function that it can compile, for a tenth of a second.
    It asks for this under its own lock, so that one thread at a time loads these declarations.
    """
    _name_symbols()
    with kept._guard_against_spurious_io_errors():
        overload = kept._load_overload(sig, target_context)
        if overload is not None:
            return overload
    _prepare_target()
    return None


class KernelDispatcher(CPUDispatcher):
    """A function that is called from Python."""

    def compile(self, sig: Any) -> Any:
        """Compile for one set of types, or load what is cached."""
        with _PAUSE:
            return super().compile(sig)


class _Part(CPUDispatcher):
    """A function as part of those that call it; Python cannot."""

    def add_overload(self, cres: Any) -> None:
        """Keep what was lowered, but not for callers in Python."""
        self.overloads[tuple(cres.signature.args)] = cres


class PartedDispatcher(KernelDispatcher):
    """A function that is compiled whole for callers in Python and is a part of other kernels."""

    def __init__(self, function: Callable[..., Any], *, targetoptions: dict[str, Any]) -> None:
        """Nothing is compiled before the first call."""
        super().__init__(function, targetoptions=targetoptions)
        alone = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self._part = _Part(
            function, targetoptions=targetoptions | alone, pipeline_class=_PartCompiler
        )

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """The types of a call in a kernel."""
        return self._part.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """The overload that a kernel calls."""
        return self._part.get_overload(sig)
