"""An arm without loads as one file of C: tip, frame and Jacobian, without allocation.

Formulas are those of the kernels, written down by `formulas`; loops and tables are written here.
"""

from __future__ import annotations

import re
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.kernels.rod.jacobian import step_column, weights_at
from softreach.kernels.rod.magnus import act, exponent
from softreach.kernels.rod.tips import NODE_ROWS, node_twist
from softreach.models.formulas import function_in_c
from softreach.rod.free import FreeRod
from softreach.rod.rods import ArmMap, all_inputs, as_tip_map
from softreach.support.arguments import as_text
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible
from softreach.support.files.formats import FileFormat, Formats
from softreach.support.files.text import write_text

if TYPE_CHECKING:
    from softreach.models.inverse_table import InverseTable

SOURCE: Formats = {".h": FileFormat(), ".c": FileFormat()}  # Formats of `write_c`

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
        InvalidInput: `tol` is out of range, `name` is none of C, or there is no such marker; or the
            table is that of another arm.
        NotPossible: The arm has loads and there is no lookup, or its bundles do not follow from its
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
        parts += [_sizes(table), _tables(known, table), _formulas(), _WALKS]
    elif lookup is None:
        raise NotPossible("C has no kinematics of arms under loads: give it a lookup table")
    parts += [] if lookup is None else [_lookup(lookup)]
    text = "\n".join([*parts, "#endif", ""])
    return text.replace("NAME", name).replace("UPPER", name.upper())


def write_c(arm: Manipulator, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write the text of `c` to a file.

    Args:
        arm: The design.
        path: The file; it is replaced only when the new one is complete.
        overwrite: Whether it may replace a file.

    Raises:
        InvalidDesign: As `c`.
        NotPossible: As `c`.
        InvalidInput: Something else is there.
        NotWritten: It cannot be written.
    """
    write_text(path, c(arm), overwrite=overwrite)


def _table(known: ArmMap) -> Array:
    """Tables of the steps by inputs, base first, shape (step, row, input + 1)."""
    rod, driving = known.rod, known.inputs.driving
    assert isinstance(rod, FreeRod)
    bundles = rod.box.bundles
    of_bundles, constant = rod.table[..., :bundles], rod.table[..., -1:]
    if driving is None:
        return np.concatenate([of_bundles, constant], axis=-1)
    if not driving.is_affine:
        raise NotPossible(
            "C has no tendons driven by length or held by guides, and no drives with dead zones or "
            "slack tendons: leave them out"
        )
    return np.concatenate(
        [of_bundles @ driving.gains, constant + of_bundles @ driving.offsets[:, None]], axis=-1
    )


def _head(known: ArmMap) -> str:
    from softreach import __version__

    arm, box = known.arm, known.box
    names = zip(map(_plain, arm.input_names), arm.input_units, strict=True)
    lines = [
        f"   {k}: {label} [{unit}], {low:g} to {high:g}"
        for k, ((label, unit), (low, high)) in enumerate(zip(names, box.bounds, strict=True))
    ]
    return "\n".join(
        [
            f"/* An arm of {arm.length:g} m, by softreach {__version__}. SI units, world frame.",
            f"   Tips are exact to {known.tol:g} L while activations are within their bounds:",
            *lines,
            "*/\n#ifndef UPPER_H\n#define UPPER_H\n",
            "#if defined(__GNUC__)\n#define UPPER_API static __attribute__((unused))",
            "#else\n#define UPPER_API static\n#endif\n",
            f"#define UPPER_INPUTS {box.bundles}\n",
            array_in_c("UPPER_API const double NAME_low[UPPER_INPUTS]", box.low),
            array_in_c("UPPER_API const double NAME_high[UPPER_INPUTS]", box.high),
        ]
    )


def _sizes(table: Array) -> str:
    return f"#define UPPER_STEPS {table.shape[0]}\n#define UPPER_ROWS {table.shape[1]}\n"


def _plain(label: str) -> str:
    """A name that ends no comment."""
    return label.encode("ascii", "replace").decode().replace("*/", "")


def array_in_c(head: str, values: Array) -> str:
    """An initialized array with this head, of numbers that C reads back to the last bit."""
    digits = ".9g" if values.dtype == np.float32 else ""
    numbers = [format(value, digits) for value in values.ravel().tolist()]
    lines = [", ".join(numbers[k : k + _A_LINE]) for k in range(0, len(numbers), _A_LINE)]
    return f"{head} = {{\n    " + ",\n    ".join(lines) + "\n};\n"


def _tables(known: ArmMap, table: Array) -> str:
    """Steps from base to tip, rows as in `kernels.rod.tips.pack`; point and base."""
    rod, base = known.rod, known.pose
    assert isinstance(rod, FreeRod)
    constants = {
        "table[UPPER_STEPS * UPPER_ROWS * (UPPER_INPUTS + 1)]": table,
        "point[3]": rod.offset,
        "base[3]": np.array(base.position),
        "axes[9]": np.array(base.rotation),
    }
    heads = {f"UPPER_API const double NAME_{head}": value for head, value in constants.items()}
    return "".join(array_in_c(head, value) for head, value in heads.items())


def _formulas() -> str:
    """Exponent of a step, how it moves points and turns directions, and its derivative."""
    w, v = "const double w[6]", "const double v[15]"
    parts = {
        f"exponent({v}, double w[6])": (_exponent, {"v": NODE_ROWS}, "w"),
        f"move({w}, double p[3])": (act, {"w": 6, "p": 3}, "p"),
        f"turn({w}, double d[3])": (_turn, {"w": 6, "d": 3}, "d"),
        f"column({v}, const double t[15], {w}, double x[6])": (
            _column,
            {"v": NODE_ROWS, "t": NODE_ROWS, "w": 6, "x": 6},
            "x",
        ),
    }
    return "\n".join(
        function_in_c(f"static void NAME_{head}", *part) for head, part in parts.items()
    )


def _nodes(v):
    base, middle, tip = v[0:4], v[4:8], v[8:12]
    return (
        node_twist(base[0], base[1], base[2], base[3], v[12]),
        node_twist(middle[0], middle[1], middle[2], middle[3], v[13]),
        node_twist(tip[0], tip[1], tip[2], tip[3], v[14]),
    )


def _exponent(v):
    base, middle, tip = _nodes(v)
    return exponent(base, middle, tip)


def _turn(w, d):
    return act((w[0], w[1], w[2], 0.0, 0.0, 0.0), d)


def _column(v, t, w, x):
    return step_column(_nodes(v), (v[0], v[4], v[8]), weights_at(t), w, x)


def _lookup(lookup: InverseTable) -> str:
    nx, ny, nz = lookup.rows.shape
    sizes = f"#define UPPER_NX {nx}\n#define UPPER_NY {ny}\n#define UPPER_NZ {nz}\n"
    sizes += "/* Largest distance of a tip from its place [m] */\n"
    sizes += f"#define UPPER_ERROR {lookup.error!r}\n"
    grid, count = "[UPPER_NX * UPPER_NY * UPPER_NZ]", len(lookup.activations)
    arrays = {
        "double NAME_origin[3]": lookup.origin,
        "double NAME_spacing[1]": np.array([lookup.spacing]),
        f"int NAME_rows{grid}": lookup.rows,
        f"unsigned char NAME_cells{grid}": lookup.cells,
        f"float NAME_nodes[{count} * UPPER_INPUTS]": lookup.activations,
    }
    parts = [array_in_c(f"UPPER_API const {head}", value) for head, value in arrays.items()]
    return "".join([sizes, *parts, _LOOKUP])


_LOOKUP = """
/* Activations for a place [m], 1 where the table has an answer: the tip is UPPER_ERROR from the
   place at most. Else 0, and the activations are left as they are. */
UPPER_API int NAME_lookup(const double place[3], double activations[UPPER_INPUTS])
{
    const int size[3] = {UPPER_NX, UPPER_NY, UPPER_NZ};
    double share[3], weight, sum[UPPER_INPUTS] = {0.0};
    int i, j, corner, at[3];
    for (i = 0; i < 3; i++) {
        share[i] = (place[i] - NAME_origin[i]) / NAME_spacing[0];
        if (!(share[i] >= 0.0 && share[i] < size[i] - 1))
            return 0;
        at[i] = (int)share[i];
        share[i] -= at[i];
    }
    if (!NAME_cells[(at[0] * UPPER_NY + at[1]) * UPPER_NZ + at[2]])
        return 0;
    for (corner = 0; corner < 8; corner++) {
        const int x = corner >> 2, y = (corner >> 1) & 1, z = corner & 1;
        const int row = NAME_rows[((at[0] + x) * UPPER_NY + at[1] + y) * UPPER_NZ + at[2] + z];
        weight = (x ? share[0] : 1.0 - share[0]) * (y ? share[1] : 1.0 - share[1])
               * (z ? share[2] : 1.0 - share[2]);
        for (j = 0; j < UPPER_INPUTS; j++)
            sum[j] += weight * NAME_nodes[row * UPPER_INPUTS + j];
    }
    for (j = 0; j < UPPER_INPUTS; j++) {
        activations[j] = sum[j] < NAME_low[j] ? NAME_low[j] : sum[j];
        activations[j] = activations[j] > NAME_high[j] ? NAME_high[j] : activations[j];
    }
    return 1;
}
"""

_WALKS = """/* Rows of the table of step k: their column j, or their values at an activation. */
static void NAME_lengths(double v[15])
{
#if UPPER_ROWS == 12
    v[12] = v[0];
    v[13] = v[4];
    v[14] = v[8];
#else
    (void)v;
#endif
}

static void NAME_weights(int k, int j, double t[15])
{
    int row;
    for (row = 0; row < UPPER_ROWS; row++)
        t[row] = NAME_table[(k * UPPER_ROWS + row) * (UPPER_INPUTS + 1) + j];
    NAME_lengths(t);
}

static void NAME_values(int k, const double *activations, double v[15])
{
    int row, j;
    const double *weight = NAME_table + k * UPPER_ROWS * (UPPER_INPUTS + 1);
    for (row = 0; row < UPPER_ROWS; row++, weight += UPPER_INPUTS + 1) {
        v[row] = weight[UPPER_INPUTS];
        for (j = 0; j < UPPER_INPUTS; j++)
            v[row] += weight[j] * activations[j];
    }
    NAME_lengths(v);
}

/* From the frame of the base to the world: a direction, which may be one column of a matrix. */
static void NAME_to_world(const double d[3], double *out, int stride)
{
    int i;
    for (i = 0; i < 3; i++)
        out[i * stride] = NAME_axes[3 * i] * d[0] + NAME_axes[3 * i + 1] * d[1]
                        + NAME_axes[3 * i + 2] * d[2];
}

static void NAME_place(const double p[3], double tip[3])
{
    int i;
    NAME_to_world(p, tip, 1);
    for (i = 0; i < 3; i++)
        tip[i] += NAME_base[i];
}

/* The tip [m] at activations. */
UPPER_API void NAME_tip(const double activations[UPPER_INPUTS], double tip[3])
{
    double v[15], w[6], p[3] = {NAME_point[0], NAME_point[1], NAME_point[2]};
    int k;
    for (k = UPPER_STEPS - 1; k >= 0; k--) {
        NAME_values(k, activations, v);
        NAME_exponent(v, w);
        NAME_move(w, p);
    }
    NAME_place(p, tip);
}

/* The tip [m] and the directors d1, d2, d3 of its section, as rows. */
UPPER_API void NAME_frame(const double activations[UPPER_INPUTS], double tip[3],
                          double directors[9])
{
    double v[15], w[6], p[3] = {NAME_point[0], NAME_point[1], NAME_point[2]};
    double d[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    int k, i;
    for (k = UPPER_STEPS - 1; k >= 0; k--) {
        NAME_values(k, activations, v);
        NAME_exponent(v, w);
        NAME_move(w, p);
        for (i = 0; i < 3; i++)
            NAME_turn(w, d[i]);
    }
    NAME_place(p, tip);
    for (i = 0; i < 3; i++)
        NAME_to_world(d[i], directors + 3 * i, 1);
}

/* The tip [m] and its derivatives by the activations, three rows of UPPER_INPUTS numbers. */
UPPER_API void NAME_jacobian(const double activations[UPPER_INPUTS], double tip[3],
                             double jacobian[3 * UPPER_INPUTS])
{
    double v[15], t[15], w[6], p[3] = {NAME_point[0], NAME_point[1], NAME_point[2]};
    double x[UPPER_INPUTS][6] = {{0.0}}, d[3];
    int k, j;
    for (k = UPPER_STEPS - 1; k >= 0; k--) {
        NAME_values(k, activations, v);
        NAME_exponent(v, w);
        NAME_move(w, p);
        for (j = 0; j < UPPER_INPUTS; j++) {
            NAME_weights(k, j, t);
            NAME_column(v, t, w, x[j]);
        }
    }
    NAME_place(p, tip);
    for (j = 0; j < UPPER_INPUTS; j++) {
        d[0] = x[j][3] + x[j][1] * p[2] - x[j][2] * p[1];
        d[1] = x[j][4] + x[j][2] * p[0] - x[j][0] * p[2];
        d[2] = x[j][5] + x[j][0] * p[1] - x[j][1] * p[0];
        NAME_to_world(d, jacobian + j, UPPER_INPUTS);
    }
}
"""
