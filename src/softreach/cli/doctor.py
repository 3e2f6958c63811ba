"""`softreach doctor`: the machine and the installation, for a report of a fault."""

from __future__ import annotations

import os
import platform
import re
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

import softreach
from softreach.cli.console import console
from softreach.cli.options import AsJson


def doctor(*, json: AsJson = False) -> None:
    """Print versions, cores, memory and caches, to go with the report of a fault.

    Example: softreach doctor
    """
    from softreach.support.memory import free_memory
    from softreach.support.parallel import thread_count

    rows = {
        "softreach": (softreach.__version__, ""),
        "installed in": (str(Path(softreach.__file__).parent), ""),
        "Python": (platform.python_version(), ""),
        "system": (platform.platform(), ""),
        "cores": (os.cpu_count(), ""),
        "threads used": (thread_count(), ""),
        "free memory": (round(free_memory() / 1e9, 1), "GB"),
        "kernels are kept in": (_kernel_cache(), ""),
        "screen": (_screen(), ""),
    }
    rows |= {name: (_version(name), "") for name in _requirements()}
    console.rows("this machine and this installation", rows, json)


def _kernel_cache() -> str:
    """Folder of compiled kernels, which is asked of the kernels themselves."""
    from softreach.kernels.compiler import not_kept
    from softreach.kernels.rod import tips

    if not_kept:
        return f"nowhere: {not_kept[0]}"
    return str(getattr(getattr(tips._tips, "_cache", None), "cache_path", "nowhere: not compiled"))


def _screen() -> str:
    if platform.system() in ("Windows", "Darwin"):
        return "yes"
    return "yes" if {"DISPLAY", "WAYLAND_DISPLAY"} & {*os.environ} else "none: headless"


def _requirements() -> list[str]:
    """Packages that softreach and its extras need, each once."""
    names = re.findall(r"^[\w.-]+", "\n".join(requires("softreach") or []), re.MULTILINE)
    return [name for name in dict.fromkeys(names) if name != "softreach"]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
