"""Laws of exports: what a format's own reader finds is what was written, whole or not at all."""

import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import softreach as sr
from softreach.export import export_arm, export_cloud, export_mesh
from softreach.export.clouds import column_names
from softreach.support.errors import InvalidInput

meshio = pytest.importorskip("meshio")
trimesh = pytest.importorskip("trimesh")
csv = pytest.importorskip("pyarrow.csv")
parquet = pytest.importorskip("pyarrow.parquet")

COLUMNS = ["x", "y", "z", "gamma_left", "gamma_right", "gamma_longitudinal"]


@pytest.fixture(scope="module")
def cloud(trunk):
    return sr.compute_cloud(trunk, n=300, seed=5)


@pytest.fixture(scope="module")
def bent(trunk):
    return sr.configuration(trunk, [-1.2, -0.3, -0.8], stations=41)


@pytest.fixture(scope="module")
def expected(cloud):
    return dict(zip(COLUMNS, [*cloud.tip.values.T, *cloud.activation.values.T], strict=True))


@pytest.fixture(scope="module")
def ball():
    return trimesh.creation.icosphere(3, radius=0.4)


def left_over(folder, *known):
    return {p.name for p in folder.iterdir()} - set(known)


def test_a_cloud_is_a_tidy_table_of_one_row_a_sample(cloud, expected):
    table = sr.export.cloud_table(cloud)
    assert list(table.columns) == COLUMNS
    for name, values in expected.items():
        np.testing.assert_array_equal(table[name], values)
    assert table.attrs["seed"] == 5
    assert sr.Manipulator.from_toml(table.attrs["design"]) == sr.cloud.design_of(cloud)


class TestCloud:
    @pytest.mark.parametrize("suffix", ["csv", "parquet"])
    def test_tables_read_back_equal_and_described(self, suffix, cloud, expected, tmp_path):
        export_cloud(cloud, tmp_path / f"cloud.{suffix}")
        read = csv.read_csv if suffix == "csv" else parquet.read_table
        table = read(tmp_path / f"cloud.{suffix}")
        assert table.column_names == COLUMNS
        for name, values in expected.items():
            np.testing.assert_array_equal(table[name].to_numpy(), values)
        if suffix == "parquet":
            assert table.schema.metadata[b"design"].decode() == cloud.attrs["design"]
            assert table.schema.metadata[b"seed"] == b"5"
            assert table.schema.field("x").metadata[b"units"] == b"m"

    def test_csv_needs_no_pyarrow(self, cloud, tmp_path, monkeypatch):
        sizes = np.logspace(-12, 20, 300)[:, None] * [1, -1, 0]
        sizes[:2] = [[np.nan, 1e10, -0.0], [1e-4, 1e-6, 12.0]]
        some = cloud.assign(tip=(("sample", "axis"), sizes), status=("sample", np.arange(300) % 5))
        export_cloud(some, tmp_path / "with.csv", unit="mm")
        for name in ("pyarrow", "pyarrow.csv"):
            monkeypatch.setitem(sys.modules, name, None)
        export_cloud(some, tmp_path / "without.csv", unit="mm")
        files = ((tmp_path / name).read_text().splitlines() for name in ("with.csv", "without.csv"))
        heads, *rows = zip(*files, strict=True)
        assert len({head.replace('"', "") for head in heads}) == 1
        numbers = [[[float(x) for x in line.split(",")] for line in pair] for pair in rows]
        np.testing.assert_array_equal(*np.moveaxis(numbers, 1, 0))

    def test_arrays_read_back_equal_without_pickle(self, cloud, tmp_path):
        path = tmp_path / "cloud.npz"
        export_cloud(cloud, path)
        data = np.load(path)
        np.testing.assert_array_equal(data["tip"], cloud.tip)
        np.testing.assert_array_equal(data["activation"], cloud.activation)
        assert list(data["bundle"]) == ["left", "right", "longitudinal"]
        assert str(data["design"]) == cloud.attrs["design"]
        assert int(data["seed"]) == 5
        assert str(data["tip_units"]) == "m"

    def test_vtu_reads_back_equal(self, cloud, expected, tmp_path):
        export_cloud(cloud, tmp_path / "cloud.vtu")
        mesh = meshio.read(tmp_path / "cloud.vtu")
        np.testing.assert_array_equal(mesh.points, cloud.tip)
        for name in COLUMNS[3:]:
            np.testing.assert_array_equal(np.ravel(mesh.point_data[name]), expected[name])

    def test_ply_reads_back_equal_with_colors_and_design(self, cloud, expected, tmp_path):
        export_cloud(cloud, tmp_path / "cloud.ply")
        points = trimesh.load(tmp_path / "cloud.ply")
        np.testing.assert_array_equal(points.vertices, cloud.tip)
        gamma = np.abs(cloud.activation.values)
        np.testing.assert_array_equal(points.colors[:, :3], np.rint(255 * gamma / gamma.max()))
        data = meshio.read(tmp_path / "cloud.ply").point_data
        for name in COLUMNS[3:]:
            np.testing.assert_array_equal(data[name], expected[name])
        header = (tmp_path / "cloud.ply").read_bytes().partition(b"end_header")[0].decode("ascii")
        prefix = "comment design: "
        design = [k.removeprefix(prefix) for k in header.split("\n") if k.startswith(prefix)]
        assert design == cloud.attrs["design"].splitlines()
        assert "comment seed: 5" in header

    def test_blocks_do_not_show_in_the_result(self, cloud, tmp_path, monkeypatch):
        for suffix in ("ply", "csv"):
            whole, blocks = (tmp_path / f"{name}.{suffix}" for name in ("whole", "blocks"))
            export_cloud(cloud, whole)
            with monkeypatch.context() as patch:
                patch.setattr("softreach.export.clouds._BLOCK", 7)
                export_cloud(cloud, blocks)
            assert whole.read_bytes() == blocks.read_bytes()

    @pytest.mark.parametrize("suffix", ["ply", "csv", "parquet", "npz"])
    def test_a_cloud_without_samples_is_an_empty_file_of_its_kind(self, suffix, cloud, tmp_path):
        export_cloud(cloud.isel(sample=slice(0)), tmp_path / f"none.{suffix}")
        assert (tmp_path / f"none.{suffix}").stat().st_size > 0

    def test_other_datasets_are_refused(self, cloud, tmp_path):
        with pytest.raises(InvalidInput, match="tip, activation"):
            export_cloud(cloud.drop_vars("tip"), tmp_path / "cloud.csv")
        assert not left_over(tmp_path)


@given(st.lists(st.text(max_size=8), max_size=6))
@example(["a_b_2", "a b", "a_b"])
def test_column_names_are_different_and_safe_in_every_language(names):
    columns = column_names(names)
    assert len(set(columns)) == len(names)
    assert all(column.isidentifier() and column.isascii() for column in columns)


class TestMesh:
    @pytest.mark.filterwarnings("ignore::softreach.support.errors.SoftreachWarning")
    @pytest.mark.parametrize("suffix", ["ply", "stl", "obj", "glb"])
    def test_an_alpha_shape_that_touches_itself_can_be_printed(self, suffix, rng, tmp_path):
        hull = sr.concave_hull(rng.random((1500, 3)), alpha=0.09)
        assert not trimesh.Trimesh(hull.vertices, hull.faces).is_watertight
        export_mesh(hull, tmp_path / f"hull.{suffix}")
        mesh = trimesh.load(tmp_path / f"hull.{suffix}", force="mesh")
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(hull.volume, rel=1e-3)

    def test_vtu_keeps_vertices_and_faces(self, ball, tmp_path):
        export_mesh((ball.vertices, ball.faces), tmp_path / "hull.vtu")
        mesh = meshio.read(tmp_path / "hull.vtu")
        np.testing.assert_array_equal(mesh.points, ball.vertices)
        np.testing.assert_array_equal(mesh.cells_dict["triangle"], ball.faces)

    @pytest.mark.parametrize(("suffix", "digits"), [("ply", 15), ("obj", 11)])
    def test_vertices_are_exact_where_the_format_is(self, suffix, digits, ball, tmp_path):
        export_mesh(ball, tmp_path / f"hull.{suffix}")
        mesh = trimesh.load(tmp_path / f"hull.{suffix}", process=False)
        np.testing.assert_allclose(mesh.vertices, ball.vertices, atol=10.0**-digits)
        np.testing.assert_array_equal(mesh.faces, ball.faces)

    def test_gltf_stands_upright_in_its_own_axes(self, tmp_path):
        """What points along our z points along y, which is up there."""
        box = trimesh.creation.box(bounds=[[0, 0, 0], [1, 2, 3]])
        export_mesh(box, tmp_path / "box.glb")
        bounds = trimesh.load(tmp_path / "box.glb").bounds
        np.testing.assert_allclose(bounds, [[0, 0, -2], [1, 3, 0]], atol=1e-6)

    def test_nothing_to_write_is_refused(self, tmp_path):
        with pytest.raises(InvalidInput, match="one triangle"):
            export_mesh((np.zeros((3, 3)), np.zeros((0, 3), int)), tmp_path / "hull.ply")


class TestArm:
    def test_obj_and_gltf_hold_named_closed_parts_in_their_colors(self, trunk, bent, tmp_path):
        for suffix in ("obj", "glb"):
            export_arm(trunk, bent, tmp_path / f"arm.{suffix}")
        assert not left_over(tmp_path, "arm.obj", "arm.glb")
        lines = (tmp_path / "arm.obj").read_text().splitlines()
        names = [line[2:] for line in lines if line.startswith("o ")]
        assert names == ["body", "left", "right", "longitudinal"]
        parts = trimesh.load(tmp_path / "arm.glb").geometry
        assert list(parts) == names
        assert all(part.is_watertight for part in parts.values())
        colors = [parts[n].visual.material.baseColorFactor[:3].argmax() for n in names[1:]]
        assert colors == [0, 1, 2]  # red, green, blue

    @pytest.mark.parametrize("suffix", ["ply", "stl", "obj", "glb"])
    def test_all_formats_hold_the_same_solid(self, suffix, trunk, bent, tmp_path):
        export_arm(trunk, bent, tmp_path / "arm.vtu")
        export_arm(trunk, bent, tmp_path / f"arm.{suffix}")
        plain = meshio.read(tmp_path / "arm.vtu")
        reference = trimesh.Trimesh(plain.points, plain.cells_dict["triangle"], process=False)
        mesh = trimesh.load(tmp_path / f"arm.{suffix}", force="mesh", process=False)
        assert mesh.volume == pytest.approx(reference.volume, rel=1e-5)
        assert set(np.unique(plain.cell_data["part"][0])) == {0, 1, 2, 3}

    def test_a_bundle_called_body_is_a_part_of_its_own(self, trunk, bent, tmp_path):
        first, *others = trunk.actuators
        arm = trunk.replace(actuators=(first.replace(name="body"), *others))
        export_arm(arm, bent, tmp_path / "arm.glb")
        names = set(trimesh.load(tmp_path / "arm.glb").geometry)
        assert names == {"body", "body (1)", "right", "longitudinal"}
