"""Data and numbers that a calibration cannot use: one clear line, or a result that says so."""

import re

import numpy as np
import pandas as pd
import pytest

import softreach as sr
from softreach.arm import LinearTaper, Manipulator, Material, Ring, Section
from softreach.calibration.free_numbers import free_numbers
from softreach.support.errors import InvalidInput, NotPossible, SoftreachWarning, no_warnings
from tests.calibration.arms import (
    MODULUS,
    hanging_tentacle,
    measured,
    on_the_bench,
    pulled_wire,
    random_inputs,
)

ARM = hanging_tentacle()
FREE = [MODULUS, "pose"]


@pytest.fixture(scope="module")
def good():
    """A table of which all is right."""
    return pd.DataFrame(measured(on_the_bench(ARM)))


def refusal(data, free=FREE, arm=ARM, **options):
    """The line by which a calibration refuses."""
    with no_warnings(), pytest.raises((InvalidInput, NotPossible)) as caught:
        sr.calibrate(arm, data, free=free, rivals=False, **options)
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 600
    return text


def with_cell(data, row, column, value):
    """The table with another value in a cell."""
    data = data.astype(float)
    data.loc[row, column] = value
    return data


OTHER = {"half": "tool", "tool": "half"}
TABLES = {
    "tensions in mm": (
        lambda d: d.rename(columns={"t 1_N": "t 1_mm"}),
        "column t 1_mm is in m, and must be in N",
    ),
    "no such input": (lambda d: d.drop(columns="t 2_N"), "1 column in N for t 2"),
    "no place": (lambda d: d[["t 1_N", "t 2_N", "t 3_N"]], "the data has no columns of places"),
    "nothing seen": (
        lambda d: d.assign(**{c: np.nan for c in d if "mm" in c}),
        "no marker was seen",
    ),
    "one name twice": (lambda d: pd.concat([d, d[["t 1_N"]]], axis=1), "two columns of this name"),
    "mm called m": (lambda d: d.rename(columns=lambda c: c.replace("mm", "m")), "look at the unit"),
    "one sample": (lambda d: d[:1], "at most 6 numbers, as many as the data has"),
    "mirrored": (lambda d: d.assign(half_x_mm=-d.half_x_mm, tool_x_mm=-d.tool_x_mm), "right-hand"),
    "exchanged": (
        lambda d: d.rename(columns={"t 2_N": "t 3_N", "t 3_N": "t 2_N"}),
        "the inputs t 2 and t 3",
    ),
    "exchanged markers": (
        lambda d: d.rename(columns=lambda c: OTHER.get(c[:4], c[:4]) + c[4:]),
        "the markers half and tool seem to be exchanged",
    ),
    "pushes": (lambda d: with_cell(d, 4, "t 2_N", -3), "t 2_N in row 4 = -3 N: must be at least 0"),
    "huge": (lambda d: with_cell(d, 3, "t 1_N", 1e300), "t 1_N in row 3 = 1e+300 N: must be near"),
    "far": (lambda d: with_cell(d, 6, "tool_y_mm", 1e300), "tool_y_mm in row 6 = 1e+300 mm"),
}


@pytest.mark.parametrize(("damaged", "said"), TABLES.values(), ids=TABLES)
def test_a_table_that_cannot_be_used_is_refused_in_one_line(damaged, said, good):
    assert said in refusal(damaged(good))


FILES = {
    "empty": (b"", "No columns"),
    "a header": (b"t 1_N,t 2_N\n", "at least one row"),
    "bytes": (bytes(range(128)), "character 0 is NUL"),
    "a picture": (b"\x89PNG\r\n\x1a\n\xff\xfe", "text in UTF-8"),
    "ragged": (b"a,b\n1,2\n1,2,3\n", "row 1 of poses.csv = 3 cells: must be 2"),
}


@pytest.mark.parametrize(("content", "said"), FILES.values(), ids=FILES)
def test_a_file_that_is_no_table_is_refused_in_one_line(content, said, tmp_path):
    path = tmp_path / "poses.csv"
    path.write_bytes(content)
    assert said in refusal(path)


@pytest.mark.parametrize("kind", ["gz", "bz2", "xz", "zip"])
def test_a_compressed_table_that_was_cut_is_refused_in_one_line(kind, good, tmp_path):
    path = tmp_path / f"poses.csv.{kind}"
    good.to_csv(path, index=False)
    sr.calibration.read_measurements(hanging_tentacle(), path)
    path.write_bytes(path.read_bytes()[:-20])
    assert "a table in CSV or Parquet" in refusal(path)


def test_a_row_that_was_cut_short_and_a_column_named_twice_are_refused(good, tmp_path):
    path, text = tmp_path / "poses.csv", good.to_csv(index=False)
    lines = text.splitlines()
    lines[4] = lines[4].rpartition(",")[0]
    path.write_text("\n".join(lines))
    assert "row 3 of poses.csv = 8 cells: must be 9" in refusal(path)
    path.write_text(text.replace("tool_x_mm", "half_x_mm", 1))
    assert "two columns of this name" in refusal(path)


OPTIONS = {
    "no such file": (dict(data="missing.csv"), "a file that exists"),
    "no such run": (dict(run="runn"), "run = runn: must be a column"),
    "no such column": (dict(inputs={"t 1": "t 1_n"}), 'did you mean "t 1_N"'),
    "no such input": (dict(inputs={"u 1": "t 1_N"}), "one of t 1, t 2, t 3"),
    "no such marker": (dict(markers={"disk3": "tool"}), "one of half, tool"),
    "all held out": (dict(hold_out=1.0), "hold_out = 1"),
    "prior of no number": (dict(prior={"taper": 1.0}), "must be a free number: "),
    "twice": (dict(free=[MODULUS, "rings*modulus"]), "given once"),
    "does nothing": (dict(free=[MODULUS, "rings[0].material.density"]), "leave out those"),
    "two units": (dict(free=["t.distance = t.offset"]), "of the same unit"),
}


@pytest.mark.parametrize(("options", "said"), OPTIONS.values(), ids=OPTIONS)
def test_options_that_mean_nothing_are_refused_in_one_line(options, said, good):
    assert said in refusal(**{"data": good, "free": FREE, **options})


def test_poses_without_any_motion_tell_neither_stiffness_nor_pose():
    still = measured(on_the_bench(ARM), inputs=np.zeros((9, 3)))
    assert "move a marker" in refusal(still, [MODULUS])
    assert "tell apart" in refusal(measured(on_the_bench(ARM), inputs=np.ones((9, 3))))


def test_only_the_ratio_of_stiffness_and_weight_shows_where_no_force_is_known():
    """Muscles contract by what they are told, however stiff the arm is."""
    fiber = sr.FiberArchitecture(name="f", extent=np.radians(40), bundles=3, revolution=0.0)
    silicone = Material(young_modulus=3e5, density=1100.0)
    arm = Manipulator(
        profile=LinearTaper(length=0.3, outer_radius=0.015),
        section=Section(rings=(Ring(inner_ratio=0.6, material=silicone),)),
        actuators=(fiber,),
        loads=sr.Loads(),
        markers=ARM.markers,
    ).with_bounds((-0.5, 0.0))
    data = {name.removesuffix("_N"): values for name, values in measured(arm, 4).items()}
    both = [MODULUS, "rings[0].material.density"]
    assert "leave out one, such as" in refusal(data, both, arm)
    result = sr.calibrate(arm, data, free=both, prior={both[1]: 20.0}, rivals=False)
    assert result.sigma[both[1]] == pytest.approx(20.0, rel=0.05)


def test_an_outlier_of_a_meter_is_named_and_hardly_moves_the_numbers(good):
    data = good.astype(float).copy()
    data.loc[5, "tool_x_mm"] += 1000.0
    result = sr.calibrate(ARM, data, free=FREE, rivals=False)
    assert result.outliers.tolist() == [5]
    assert re.search("fitted error .* mm rms", result.verdict.sentence)
    assert "in rows (counted from 0): 5" in str(result)
    assert result.values[MODULUS] == pytest.approx(3.3e5, rel=0.03)


def test_a_wildcard_takes_one_name_of_each_number():
    free = free_numbers(ARM, ["markers.half.*", "t.*distance*"]).names
    assert free[0] == "markers.half.station_over_length"
    assert free[1:4] == tuple(f"markers.half.offset[{k}]" for k in range(3))
    assert free[4:] == ("t.distance",)


def test_one_sample_says_nothing_of_how_sure_a_number_is(good):
    with pytest.warns(SoftreachWarning, match="does not determine rings"):
        result = sr.calibrate(ARM, good[:1], free=[MODULUS], rivals=False)
    assert result.sigma[MODULUS] == np.inf
    assert "which the data does not determine" in str(result)


def test_a_number_that_ran_away_is_warned_of_and_has_no_error_of_0():
    """Tendons that do not stretch, fitted by their stiffness."""
    tendon = pulled_wire().actuators[1]
    arm = pulled_wire().replace(actuators=(tendon,))
    stiff = arm.replace(actuators=(tendon.replace(tendon_stiffness=None),))
    data = measured(stiff, noise=2e-3, seed=-1, inputs=0.3 * random_inputs(stiff, 10))
    name = "s2.tendon_stiffness"
    with pytest.warns(SoftreachWarning) as caught:
        result = sr.calibrate(arm, data, free=["pose.z", name], rivals=False)
    texts = [str(each.message) for each in caught]
    assert any(re.search(r"became \S+ times what the design says", text) for text in texts)
    # It was 0: the pseudo-inverse drops a number that moves so little.
    assert result.sigma[name] > 0.1 * result.values[name]


def test_fewer_samples_than_would_tell_are_said_to_be_few(good):
    result = sr.calibrate(ARM, good[:4], free=FREE)
    assert result.verdict.limit == "data"
    assert "too few samples" in str(result)


def test_a_number_that_wants_to_leave_its_range_ends_there_with_a_warning():
    long = sr.Tendon(name="t", distance=0.009, bundles=3, activation_bounds=(0.0, 3.0))
    arm = ARM.replace(actuators=(long.replace(end_over_length=0.95),))
    data = measured(ARM.replace(actuators=(long,)), noise=1e-3, seed=3)
    stiffer = {"t.end_over_length": (1.2, 1e-3)}
    with pytest.warns(SoftreachWarning, match=r"end at a bound of their range: t\.end_over_length"):
        result = sr.calibrate(
            arm, data, free=["t.end_over_length", "pose"], prior=stiffer, rivals=False
        )
    assert result.values["t.end_over_length"] == pytest.approx(1.0)
    assert "at its bound" in str(result)


def test_copied_samples_and_a_marker_that_was_never_seen_are_warned_of(good):
    twice = pd.concat([good, good]).assign(tool_y_mm=np.nan)
    with (
        pytest.warns(SoftreachWarning, match="20 samples repeat others"),
        pytest.warns(SoftreachWarning, match="never seen are left out: tool"),
    ):
        result = sr.calibrate(ARM, twice, free=FREE, rivals=False)
    assert result.data.marker_names == ("half",)


def test_a_place_that_is_missing_leaves_the_rest_of_its_sample(good):
    data = good.astype(float).copy()
    data.loc[3, "tool_y_mm"] = np.nan
    result = sr.calibrate(ARM, data, free=FREE, rivals=False)
    assert result.train.number == 2 * len(good) - 1
