"""An arm for other programs: its body and every bundle as closed surfaces with names and colors."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

from softreach.arguments import checked, dataset, flag, path, whole
from softreach.arm.manipulator import a_manipulator
from softreach.arm.skin import inside
from softreach.arm_shape import arm_surface, bundle_surfaces
from softreach.export.surface import Part, write_parts
from softreach.palette import bundle_color

if TYPE_CHECKING:
    import xarray as xr

    from softreach.arm.manipulator import Manipulator

__all__ = ["export_arm"]

_CLEAR = 0.45  # opacity of a body that has something inside


@checked(
    arm=a_manipulator,
    configuration=dataset("position", "directors", "extension", "Z", what="a configuration"),
    path=path,
    sides=whole(3, 10_000),
    overwrite=flag,
)
def export_arm(
    arm: Manipulator,
    configuration: xr.Dataset,
    path: str | PathLike[str],
    *,
    sides: int = 64,
    overwrite: bool = False,
) -> None:
    """Write a deformed arm as .ply, .stl, .obj, .glb, .vtu or .vtk, chosen by the suffix.

    The body is a closed tube, translucent in .glb and .ply where something lies inside. A bundle
    that fills a sector is a closed skin as wide as its extent, half sunk into the outside of its
    ring; a tendon is a thin tube, a chamber a tube of its radius. Parts are called ``body`` and by
    the names of the bundles.

    Args:
        arm: The design.
        configuration: One configuration of that arm [m].
        path: The file; it is replaced only when the new one is complete.
        sides: Corners of each section of the body.
        overwrite: Whether it may replace any file, and not only a surface of that format.

    Raises:
        InvalidInput: Unknown suffix, several configurations, or something else is there.
        MissingExtra: The format needs a library that is not installed.
        NotWritten: It cannot be written.
    """
    body = arm_surface(arm, configuration, sides)
    opacity = _CLEAR if any(inside(arm)) else 1.0
    parts = [Part("body", body.vertices, body.faces, opacity=opacity)]
    for index, skin in enumerate(bundle_surfaces(arm, configuration)):
        name = _part_name(arm.bundle_names, index)
        parts.append(Part(name, skin.vertices, skin.faces, bundle_color(index)))
    write_parts(parts, path, overwrite=overwrite)


def _part_name(names: tuple[str, ...], index: int) -> str:
    """The bundle's name, with its number where another part has that name."""
    taken = ("body", *names[:index])
    return names[index] if names[index] not in taken else f"{names[index]} ({index + 1})"
