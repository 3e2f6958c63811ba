"""`softreach atlas`: what it prints, draws and refuses."""

from __future__ import annotations

import pytest

from softreach.cli import atlas as atlas_command


@pytest.mark.slow
def test_every_figure_is_written_as_png_and_pdf(paper, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    atlas_command.figures(paper.encoding["source"], out=tmp_path, panels=2)
    capsys.readouterr()
    names = {"clouds", "hulls", "corners", "curvature", "map_volume", "map_exact_unreachability"}
    assert names <= {path.stem for path in tmp_path.glob("*.png")}
    assert {p.stem for p in tmp_path.glob("*.png")} == {p.stem for p in tmp_path.glob("*.pdf")}
