"""Laws of the page of plain files: its numbers and surfaces are those that were computed."""

import base64
import io
import json
import re

import numpy as np
import pytest

from softreach.atlas import DesignSpace
from softreach.cli.app import run
from softreach.geometry.surface import Surface
from softreach.studio.static import write_static
from softreach.support.errors import InvalidInput
from softreach.workspace import reachable_set

pytest.importorskip("matplotlib.pyplot")
pytest.importorskip("skimage")


def grid(trunk, tapers=(2.0, 4.0), revolutions=(72.0, 108.0)) -> DesignSpace:
    """Designs of which those with a taper of 4° have no tip."""
    return DesignSpace.grid(trunk, taper=np.radians(tapers), revolution=np.radians(revolutions))


@pytest.fixture(scope="module")
def written(trunk, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    return write_static(grid(trunk), folder, unit="cm", title="</script>& trunk")


def sheet(written) -> dict:
    """What the sliders of a page know of its designs."""
    return json.loads(re.search(r'id="sheet">(.*?)</script>', written.page.read_text(), re.S)[1])


def drawn(written, file: str) -> dict:
    """What the file of a design gives to the page."""
    text = (written.page.parent / "designs" / f"{file}.js").read_text()
    return json.loads(re.search(r'receive\("\w+", (.*)\);', text)[1])


def places(part: dict) -> np.ndarray:
    low, high = np.array(part["box"])
    steps = np.frombuffer(base64.b64decode(part["xyz"]), "<u2").reshape(-1, 3)
    return low + steps / 65535 * (high - low)


def test_numbers_on_the_page_are_those_of_the_reachable_set_and_gaps_say_why(written, trunk):
    space = grid(trunk)
    for number in (0, 1):
        reached = reachable_set(space.design(number))
        numbers = sheet(written)["designs"][number]["numbers"]
        for name in ("volume", "unreachability", "convex_volume"):
            value, error, _ = numbers[name]
            assert value == getattr(reached, name)
            assert error == getattr(reached, f"{name}_error")
        assert numbers["volume"][2].endswith("liters")
        assert numbers["volume"][2].startswith(f"{1e3 * reached.volume:.1f}")
    gaps = [design["gap"] for design in sheet(written)["designs"][2:]]
    assert len(gaps) == written.gaps == 2
    assert all(gap.startswith("taper_deg = 4: leaves no tip") for gap in gaps)


def test_places_are_those_of_the_surface_within_a_hundredth_of_the_length(written, trunk):
    design = drawn(written, sheet(written)["designs"][1]["file"])
    surface = next(part for part in design["parts"] if part["surface"])
    corners = np.frombuffer(base64.b64decode(surface["faces"]), "<u2")
    assert 5_000 < len(corners) / 3 < 15_000
    assert corners.max() < len(places(surface))
    rounding = float(re.search(r"rounded to (\S+) cm", design["note"])[1])
    computed = reachable_set(grid(trunk).design(1)).sheets()
    mesh = Surface(vertices=places(surface) / 100, faces=corners.reshape(-1, 3))
    distance = 100 * mesh.distance(computed.vertices[::7])
    assert np.quantile(distance, 0.99) < 0.01 * 100
    step = np.ptp(design["box"], axis=0).max() / 65535
    assert rounding == pytest.approx(step, rel=0.5)


def test_no_file_names_a_host_or_ends_its_script_and_none_is_large(written):
    page = written.page.read_text()
    assert page.count("<script") == 4
    assert "default-src 'none'" in page
    for path in written.page.parent.rglob("*.*"):
        text = path.read_text()
        assert "://" not in text
        assert "fetch(" not in text
        assert len(text) < 20e6 / 64  # that 8 by 8 of them stay below 20 MB
    assert written.size == sum(path.stat().st_size for path in written.page.parent.rglob("*.*"))


def test_files_of_others_stay_and_are_refused_where_they_are_in_the_way(trunk, tmp_path, capsys):
    (tmp_path / "index.html").write_text("<!doctype html><title>My page</title>")
    command = ["studio", "--static", str(tmp_path), "--vary", "taper_deg=0,1"]
    assert run(command) == 2
    assert "index.html: must be a new name" in capsys.readouterr().err
    assert "My page" in (tmp_path / "index.html").read_text()
    assert not (tmp_path / "designs").exists()


def test_a_grid_of_gaps_alone_and_one_of_too_many_designs_are_refused(trunk, tmp_path):
    with pytest.raises(InvalidInput, match="leaves no tip"):
        write_static(grid(trunk, tapers=(4.0, 5.0)), tmp_path / "a")
    with pytest.raises(InvalidInput, match="1,000 at most"):
        write_static(grid(trunk, tapers=np.linspace(0, 1, 1001)), tmp_path / "a")
    assert not (tmp_path / "a" / "index.html").exists()


def test_a_slider_changes_picture_and_numbers_in_a_browser_without_a_network(written, browser):
    from matplotlib.image import imread

    context = browser.new_context(viewport={"width": 900, "height": 600}, offline=True)
    page, trouble, requests = context.new_page(), [], []
    page.on("console", lambda message: trouble.append(message.text))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))

    def seen(number: int) -> tuple[np.ndarray, str]:
        page.wait_for_function(f"document.body.dataset.shown === '{number}'")
        page.evaluate("new Promise(done => requestAnimationFrame(done))")
        picture = imread(io.BytesIO(page.locator("#space").screenshot()))[..., :3]
        return picture, page.locator("#numbers").inner_text()

    page.goto(written.page.as_uri() + "#taper_deg=2&revolution_deg=108")
    here, volume = seen(1)
    page.get_by_role("slider", name="revolution").press("ArrowLeft")
    there, other = seen(0)
    address = page.evaluate("location.hash")
    page.get_by_role("slider", name="taper").press("ArrowRight")
    seen(2)
    gap = page.locator("#message").inner_text()
    context.close()
    assert "loading" not in volume + other
    assert volume != other
    assert (np.ptp(here, axis=-1) > 0.2).sum() > 5_000
    assert (np.abs(there - here).max(axis=-1) > 0.1).sum() > 2_000
    assert address == "#taper_deg=2&revolution_deg=72"
    assert "leaves no tip" in gap
    assert all(url.startswith("file:") for url in requests)
    assert [text for text in trouble if "GL Driver Message" not in text] == []
