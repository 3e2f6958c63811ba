"""An arm without loads as one file of C: tip, frame and Jacobian, without allocation.

Formulas are those of the kernels, written down by `formulas`; loops and tables are written here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.kernels.rod.jacobian import step_column, weights_at
from softreach.kernels.rod.magnus import act, exponent
from softreach.kernels.rod.tips import BEND_ROWS, node_twist
from softreach.models.formulas import function_in_c
from softreach.rod.free import FreeRod
from softreach.rod.rods import ArmMap, all_inputs, as_tip_map
from softreach.support.arguments import as_text
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible

if TYPE_CHECKING:
    from softreach.models.inverse_table import InverseTable

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")
_A_LINE = 8  # numbers


def c(
    arm: Manipulator,
    *,
    name: str = "arm",
    tol: float = 1e-6,
    point: str | None = None,
    lookup: InverseTable | None = None,
) -> str:
    """The kinematics of an arm without loads as one file of C99, header and source at once.

    All functions are `static`, allocate nothing, need no library and take bounded time; lengths
    are in m, activations in the units of the inputs, in their order, and places in the world.
    `NAME_tip(activations, tip)`, `NAME_frame(activations, tip, directors)` with d1, d2, d3 as rows,
    `NAME_jacobian(activations, tip, jacobian)` with ∂r/∂γ by rows, and, with a lookup,
    `NAME_lookup(place, activations)`, which returns 1 where the table has an answer and else 0. Of
    an arm under loads there is the lookup alone.

    Args:
        arm: The design.
        name: With which all names of the file begin.
        tol: Largest tip error, in L, of all activations within the bounds.
        point: Name of the marker that counts as the tip; by default that of the design.
        lookup: Table of the inverse of this arm.

    Returns:
        The text of the file.

    Raises:
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
        InvalidInput: `tol` is out of range, `name` is none of C, there is no such marker, or the
            table is that of another arm.
        NotPossible: The arm has loads and there is no lookup, or activations do not follow from the
            inputs by a linear map, as of tendons driven by length, of guides and of dead zones.
    """
    arm = a_manipulator("arm", arm)
    if not _NAME.fullmatch(as_text("name", name)):
        raise InvalidInput("name", name, "a name of C: letters, digits and _")
    known = all_inputs(as_tip_map(arm, tol, point=point))
    if lookup is not None and lookup.arm != known.arm:
        raise InvalidInput("lookup", lookup, "a table of this arm and this point")
    parts = [_head(known)]
    if arm.loads is None:
        table = _table(known)
        parts += [_tables(known, table), _formulas(table.shape[1]), _WALKS]
    elif lookup is None:
        raise NotPossible("C has no kinematics of arms under loads: give it a lookup table")
    parts += [] if lookup is None else [_lookup(lookup)]
    text = "\n".join([*parts, "#endif\n"])
    return text.replace("NAME", name).replace("UPPER", name.upper())


def _table(known: ArmMap) -> Array:
    """Tables of the steps by inputs, base first, shape (step, row, input + 1)."""
    rod, driving = known.rod, known.inputs.driving
    assert isinstance(rod, FreeRod)
    columns, rest = rod.table[..., : rod.box.bundles], rod.table[..., -1:]
    if driving is not None:
        if not driving.is_affine:
            raise NotPossible(
                "C has no tendons driven by length or held by guides, and no dead zones of drives: "
                "leave them out"
            )
        columns, rest = columns @ driving.gains, rest + columns @ driving.offsets[:, None]
    return np.concatenate([columns, rest], axis=-1)


def _head(known: ArmMap) -> str:
    from softreach import __version__

    arm, box = known.arm, known.box
    names = [name.encode("ascii", "replace").decode().replace("*/", "") for name in box.names]
    rows = zip(names, arm.input_units, box.bounds, strict=True)
    bundles = [f"   {n} [{u}], {low:g} to {high:g}\n" for n, u, (low, high) in rows]
    return f"""/* An arm of {arm.length:g} m, by softreach {__version__}. SI units, world frame.
   Tips are exact to {known.tol:g} L while activations are within their bounds:
{"".join(bundles)}*/
#ifndef UPPER_H
#define UPPER_H
#define UPPER_INPUTS {box.bundles}
""" + _arrays({"double NAME_low[]": box.low, "double NAME_high[]": box.high})


def _arrays(arrays: Mapping[str, Array]) -> str:
    """Constant arrays by what declares them, of numbers that C reads back to the last bit."""
    text = ""
    for head, values in arrays.items():
        digits = ".9g" if values.dtype == np.float32 else ""
        numbers = [format(value, digits) for value in values.ravel().tolist()]
        lines = [", ".join(numbers[k : k + _A_LINE]) for k in range(0, len(numbers), _A_LINE)]
        text += f"static const {head} = {{\n" + ",\n".join(lines) + "\n};\n"
    return text


def _tables(known: ArmMap, table: Array) -> str:
    """Steps from base to tip, rows as in `kernels.rod.tips.pack`; point and base."""
    assert isinstance(known.rod, FreeRod)
    arrays = {
        "double NAME_table[]": table,
        "double NAME_point[3]": known.rod.offset,
        "double NAME_base[3]": np.array(known.pose.position),
        "double NAME_axes[9]": np.array(known.pose.rotation),
    }
    sizes = f"#define UPPER_STEPS {table.shape[0]}\n#define UPPER_ROWS {table.shape[1]}\n"
    return sizes + _arrays(arrays)


def _formulas(rows: int) -> str:
    """Exponent of a step, how it moves points and turns directions, and its derivative."""
    sizes = {"v": rows, "t": rows, "w": 6, "x": 6, "p": 3}
    parts = {  # what they change comes last
        "exponent": (lambda v: exponent(*_nodes(v)), "v", "w"),
        "move": (act, "wp", "p"),
        "turn": (lambda w, d: act((*w[:3], 0.0, 0.0, 0.0), d), "wp", "p"),
        "column": (_column, "vtwx", "x"),
    }
    text = ""
    for name, (formula, inputs, out) in parts.items():
        given = [f"const double {each}[{sizes[each]}]" for each in inputs if each != out]
        head = f"static inline void NAME_{name}({', '.join(given)}, double {out}[{sizes[out]}])"
        text += function_in_c(head, formula, {each: sizes[each] for each in inputs}, out)
    return text


def _nodes(v):
    lengths = v[12:15] if len(v) > BEND_ROWS else (v[0], v[4], v[8])
    return (
        node_twist(v[0], v[1], v[2], v[3], lengths[0]),
        node_twist(v[4], v[5], v[6], v[7], lengths[1]),
        node_twist(v[8], v[9], v[10], v[11], lengths[2]),
    )


def _column(v, t, w, x):
    return step_column(_nodes(v), (v[0], v[4], v[8]), weights_at(t), w, x)


def _lookup(lookup: InverseTable) -> str:
    nx, ny, nz = lookup.rows.shape
    arrays = {
        "double NAME_origin[3]": lookup.origin,
        "int NAME_rows[]": lookup.rows,
        "unsigned char NAME_cells[]": lookup.cells,
        "float NAME_nodes[]": lookup.activations,
    }
    sizes = f"#define UPPER_NX {nx}\n#define UPPER_NY {ny}\n#define UPPER_NZ {nz}\n"
    sizes += f"#define UPPER_SPACING {lookup.spacing!r} /* m, between nodes */\n"
    sizes += f"#define UPPER_ERROR {lookup.error!r} /* m, from a tip to its place at most */\n"
    return sizes + _arrays(arrays) + _LOOKUP


_LOOKUP = """/* Activations for a place [m], and 1, where the table has an answer; else 0. */
static inline int NAME_lookup(const double place[3], double activations[UPPER_INPUTS])
{
    const int size[3] = {UPPER_NX, UPPER_NY, UPPER_NZ};
    double share[3];
    int at[3];
    for (int i = 0; i < 3; i++) {
        share[i] = (place[i] - NAME_origin[i]) / UPPER_SPACING;
        if (!(share[i] >= 0.0 && share[i] < size[i] - 1))
            return 0;
        at[i] = (int)share[i];
        share[i] -= at[i];
    }
    if (!NAME_cells[(at[0] * UPPER_NY + at[1]) * UPPER_NZ + at[2]])
        return 0;
    for (int j = 0; j < UPPER_INPUTS; j++)
        activations[j] = 0.0;
    for (int corner = 0; corner < 8; corner++) {
        const int x = corner >> 2, y = (corner >> 1) & 1, z = corner & 1;
        const int row = NAME_rows[((at[0] + x) * UPPER_NY + at[1] + y) * UPPER_NZ + at[2] + z];
        const double weight = (x ? share[0] : 1.0 - share[0]) * (y ? share[1] : 1.0 - share[1])
                              * (z ? share[2] : 1.0 - share[2]);
        for (int j = 0; j < UPPER_INPUTS; j++)
            activations[j] += weight * NAME_nodes[row * UPPER_INPUTS + j];
    }
    for (int j = 0; j < UPPER_INPUTS; j++) {
        activations[j] = activations[j] < NAME_low[j] ? NAME_low[j] : activations[j];
        activations[j] = activations[j] > NAME_high[j] ? NAME_high[j] : activations[j];
    }
    return 1;
}
"""

_WALKS = """/* A vector in the world of one in the frame of the base. */
static inline void NAME_to_world(const double d[3], double out[3])
{
    const double *a = NAME_axes;
    for (int i = 0; i < 3; i++, a += 3)
        out[i] = a[0] * d[0] + a[1] * d[1] + a[2] * d[2];
}

/* From tip to base; d are directors, x twists (omega, v) by the activations, each if not null. */
static inline void NAME_walk(const double *activations, double *tip, double *p, double (*d)[3],
                             double (*x)[6])
{
    for (int i = 0; i < 3; i++)
        p[i] = NAME_point[i];
    for (int k = UPPER_STEPS - 1; k >= 0; k--) {
        double v[UPPER_ROWS], t[UPPER_ROWS], w[6];
        const int columns = UPPER_INPUTS + 1;
        const double *rows = NAME_table + k * UPPER_ROWS * columns;
        for (int row = 0; row < UPPER_ROWS; row++) {
            v[row] = rows[row * columns + UPPER_INPUTS];
            for (int j = 0; j < UPPER_INPUTS; j++)
                v[row] += rows[row * columns + j] * activations[j];
        }
        NAME_exponent(v, w);
        NAME_move(w, p);
        for (int i = 0; d && i < 3; i++)
            NAME_turn(w, d[i]);
        for (int j = 0; x && j < UPPER_INPUTS; j++) {
            for (int row = 0; row < UPPER_ROWS; row++)
                t[row] = rows[row * columns + j];
            NAME_column(v, t, w, x[j]);
        }
    }
    NAME_to_world(p, tip);
    for (int i = 0; i < 3; i++)
        tip[i] += NAME_base[i];
}

/* The tip [m] at activations. */
static inline void NAME_tip(const double *activations, double tip[3])
{
    double p[3];
    NAME_walk(activations, tip, p, 0, 0);
}

/* The tip [m] and the directors d1, d2, d3 of its section, as rows. */
static inline void NAME_frame(const double *activations, double tip[3], double rows[9])
{
    double p[3], d[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    NAME_walk(activations, tip, p, d, 0);
    for (int i = 0; i < 3; i++)
        NAME_to_world(d[i], rows + 3 * i);
}

/* The tip [m] and its derivatives by the activations, three rows of UPPER_INPUTS numbers. */
static inline void NAME_jacobian(const double *activations, double tip[3], double *slopes)
{
    double p[3], x[UPPER_INPUTS][6] = {{0.0}}, moved[3];
    NAME_walk(activations, tip, p, 0, x);
    for (int j = 0; j < UPPER_INPUTS; j++) {
        const double *w = x[j], d[3] = {w[3] + w[1] * p[2] - w[2] * p[1],
            w[4] + w[2] * p[0] - w[0] * p[2], w[5] + w[0] * p[1] - w[1] * p[0]};
        NAME_to_world(d, moved);
        for (int i = 0; i < 3; i++)
            slopes[i * UPPER_INPUTS + j] = moved[i];
    }
}
"""
