"""Surfaces and arms for other programs: parts with a name and a color."""

from collections.abc import Sequence
from importlib import import_module
from io import BufferedWriter
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.skin import arm_surface, bundle_surfaces, inside
from softreach.export.formats import write_by_suffix, write_ply, write_vtu
from softreach.geometry.surface import SurfaceMesh, joined, parted
from softreach.schema import a_configuration
from softreach.support.arguments import as_flag, as_given, as_integer, as_path
from softreach.support.arrays import Array, Faces, as_faces, as_points
from softreach.support.errors import InvalidInput
from softreach.support.files.formats import FileFormat
from softreach.support.lazy import Dataset
from softreach.support.palette import BODY, Color, bundle_color
from softreach.support.units import LengthUnit, as_unit

_Z_UP_TO_Y_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
_CLEAR = 0.45  # opacity of a body that has something inside


class Part(NamedTuple):
    """One surface of a scene."""

    name: str
    vertices: Array  # In the unit of the scene, shape (v, 3)
    faces: Faces  # Shape (f, 3)
    color: Color = BODY
    opacity: float = 1.0


class Scene(NamedTuple):
    """Surfaces that belong together."""

    parts: Sequence[Part]
    unit: LengthUnit


def export_mesh(
    mesh_or_hull: SurfaceMesh | tuple[ArrayLike, ArrayLike],
    path: str | PathLike[str],
    *,
    unit: str | LengthUnit = "m",
    overwrite: bool = False,
) -> None:
    """Write a triangle mesh as .ply, .stl, .obj, .glb or .vtu, chosen by the suffix.

    A closed surface that touches itself along edges is parted there, by a thousandth of their
    length, so that it can be printed. STL and GLB keep single precision. glTF has y up: a GLB
    holds our coordinates under one node that turns z up into y up. All but VTU say the unit;
    `Mesh.load` reads it, but other readers of GLB take all for meters.

    Args:
        mesh_or_hull: An object with vertices [m] and faces, or the pair of them.
        path: The file; it is replaced only when the new one is complete.
        unit: Of lengths in the file: "m", "cm", "mm" or "in".
        overwrite: Whether it may replace any file, and not only a surface of that format.

    Raises:
        InvalidInput: Unknown suffix or unit, no triangles to write, or something else is there.
        MissingExtra: The format needs a library that is not installed.
        NotWritten: It cannot be written.
    """
    pair: Any = mesh_or_hull
    if not isinstance(pair, tuple | type) and hasattr(pair, "vertices") and hasattr(pair, "faces"):
        pair = pair.vertices, pair.faces
    if not isinstance(pair, tuple) or len(pair) != 2:
        allowed = "an object with vertices [m] and faces, or the pair of them"
        raise InvalidInput("mesh_or_hull", as_given(mesh_or_hull), allowed)
    vertices = as_points("mesh_or_hull.vertices", pair[0])
    faces = as_faces("mesh_or_hull.faces", pair[1], len(vertices))
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    written = as_unit(unit)
    if not len(faces):
        raise InvalidInput("mesh.faces", "none", "at least one triangle")
    _write_parts([Part("surface", vertices, faces)], path, written, overwrite=overwrite)


def _write_parts(parts: Sequence[Part], path: str, unit: LengthUnit, *, overwrite: bool) -> None:
    scaled = []
    for part in parts:
        vertices, faces = parted(part.vertices, part.faces)
        scaled.append(part._replace(vertices=unit.of(vertices), faces=faces))
    write_by_suffix(path, SURFACE_FILES, Scene(scaled, unit), overwrite=overwrite)


def export_arm(
    arm: Manipulator,
    configuration: Dataset,
    path: str | PathLike[str],
    *,
    sides: int = 64,
    unit: str | LengthUnit = "m",
    overwrite: bool = False,
) -> None:
    """Write a deformed arm as .ply, .stl, .obj, .glb or .vtu, chosen by the suffix.

    The body is a closed tube, translucent in .glb and .ply where something lies inside. A bundle
    that fills a sector is a closed skin as wide as its extent, half sunk into the outside of its
    ring; a tendon is a thin tube, a chamber a tube of its radius, and disks at guides, closed too,
    belong to the body. Parts are called ``body`` and by the names of the bundles in OBJ (objects),
    GLB (nodes), and numbered in VTU; their colors are in all but STL and VTU.

    Args:
        arm: The design.
        configuration: One configuration of that arm [m].
        path: The file; it is replaced only when the new one is complete.
        sides: Corners of each section of the body.
        unit: Of lengths in the file: "m", "cm", "mm", "in" or "L".
        overwrite: Whether it may replace any file, and not only a surface of that format.

    Raises:
        InvalidInput: Unknown suffix or unit, several configurations, or something else is there.
        MissingExtra: The format needs a library that is not installed.
        NotWritten: It cannot be written.
    """
    arm, configuration = a_manipulator("arm", arm), a_configuration("configuration", configuration)
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    written = as_unit(unit, arm.length)
    body = arm_surface(arm, configuration, as_integer("sides", sides, 3, 10_000))
    opacity = _CLEAR if any(inside(arm)) else 1.0
    parts = [Part("body", body.vertices, body.faces, opacity=opacity)]
    for index, skin in enumerate(bundle_surfaces(arm, configuration)):
        name, taken = arm.bundle_names[index], ("body", *arm.bundle_names[:index])
        name = name if name not in taken else f"{name} ({index + 1})"
        parts.append(Part(name, skin.vertices, skin.faces, bundle_color(index)))
    _write_parts(parts, path, written, overwrite=overwrite)


def _write_ply(scene: Scene, file: BufferedWriter) -> None:
    surface = joined(scene.parts)
    colors = np.concatenate([_colors(part) for part in scene.parts])
    columns = dict(zip("xyz", surface.vertices.T, strict=True))
    columns |= dict(zip(("red", "green", "blue", "alpha"), colors.T, strict=True))
    write_ply(file, len(surface.vertices), [columns], {"units": scene.unit.name}, surface.faces)


def _write_stl(scene: Scene, file: BufferedWriter) -> None:
    meshes = [_colored(part) for part in scene.parts]
    binary = import_module("trimesh").util.concatenate(meshes).export(file_type="stl")
    file.write(_said_unit(scene).encode().ljust(80) + binary[80:])


def _write_obj(scene: Scene, file: BufferedWriter) -> None:
    trimesh = import_module("trimesh")
    meshes = trimesh.Scene([_colored(part) for part in scene.parts])
    # exact enough for an arm of a millimeter; a name of ours, not an address, in the first line
    options = {"include_normals": False, "digits": 12, "header": _said_unit(scene)}
    file.write(trimesh.exchange.obj.export_obj(meshes, **options).encode())


def _write_glb(scene: Scene, file: BufferedWriter) -> None:
    trimesh = import_module("trimesh")
    meshes = trimesh.Scene(base_frame="world", metadata={"about": _said_unit(scene)})
    # as a node and not in the numbers, so that a reader gets back the vertices we have
    meshes.graph.update(frame_to="z_up", frame_from="world", matrix=_Z_UP_TO_Y_UP)
    for part in scene.parts:
        look = {
            "metallicFactor": 0.0,
            "roughnessFactor": 0.6,
            "doubleSided": True,
            "baseColorFactor": [*part.color, part.opacity],
            "alphaMode": "BLEND" if part.opacity < 1 else None,
        }
        material = trimesh.visual.material.PBRMaterial(name=part.name, **look)
        visual = trimesh.visual.TextureVisuals(material=material)
        mesh = trimesh.Trimesh(part.vertices, part.faces, visual=visual, process=False)
        names = {"node_name": part.name, "geom_name": part.name}
        meshes.add_geometry(mesh, parent_node_name="z_up", **names)
    file.write(meshes.export(file_type="glb"))


def _write_vtu(scene: Scene, file: BufferedWriter) -> None:
    surface = joined(scene.parts)
    number = np.repeat(np.arange(len(scene.parts)), [len(part.faces) for part in scene.parts])
    write_vtu(file, surface.vertices, [("triangle", surface.faces)], cell_data={"part": [number]})


def _said_unit(scene: Scene) -> str:
    return f"softreach, lengths in {scene.unit.name}"


def _colored(part: Part) -> Any:
    look = {"vertex_colors": _colors(part), "metadata": {"name": part.name}, "process": False}
    return import_module("trimesh").Trimesh(part.vertices, part.faces, **look)


def _colors(part: Part) -> NDArray[np.uint8]:
    color = np.rint(255 * np.array([*part.color, part.opacity])).astype(np.uint8)
    return np.tile(color, (len(part.vertices), 1))


_BY_TRIMESH = {".stl": _write_stl, ".obj": _write_obj, ".glb": _write_glb}
SURFACE_FILES = {".ply": FileFormat(write=_write_ply)}
SURFACE_FILES |= {x: FileFormat(("trimesh",), write) for x, write in _BY_TRIMESH.items()}
SURFACE_FILES |= {".vtu": FileFormat(("meshio",), _write_vtu)}
