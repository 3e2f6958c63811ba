"""Laws of the report: complete, continued where it stopped, whole in one file."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm.actuators.fiber import ring_integrals
from softreach.cli.app import run
from softreach.paper import reproduce, reproduce_paper
from softreach.paper.notebook import QUICK, Notebook, Verdict
from softreach.paper.reproduce import CLAIMS
from softreach.paper.sections import model, redundancy
from softreach.paper.sections.model import printed_deltas
from softreach.paper.sections.sweep import shapes
from softreach.support.errors import InvalidInput
from tests.browser import heard

TINY = replace(
    QUICK,
    designs=3,
    samples=5_000,
    alpha=0.2,
    panels=2,
    accuracy=0.1,
    redundant_samples=30_000,
    queries=500,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The report of very small clouds, by way of the command line."""
    out = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduce, "QUICK", TINY)
        assert run(["paper", "--out", str(out), "--quick"]) == 0
    return out


@pytest.fixture
def small(monkeypatch):
    """The same sizes in other tests."""
    monkeypatch.setattr(reproduce, "QUICK", TINY)


def notebook(folder, part):
    return json.loads((folder / "quick" / "figures" / f"{part}.json").read_text())


def checked(part, numbers, words):
    """The finding of the one claim whose statement holds these words."""
    (claim,) = [c for c in CLAIMS if c.part == part and words in c.says]
    return claim.check(numbers)


def test_every_figure_of_the_paper_is_there_as_png_and_pdf(folder):
    pictures = [p for part in reproduce.SECTIONS for p in notebook(folder, part)["pictures"]]
    labels = {label for label, _, _ in pictures}
    assert labels == {"1b", "1c", "1d", "2a", "2b", "3a", "3b", "3c", "4a", "4b-d", ""}
    for _, name, _ in pictures:
        for suffix, head in ((".png", b"\x89PNG"), (".pdf", b"%PDF-")):
            path = folder / "quick" / "figures" / f"{name}{suffix}"
            assert path.read_bytes().startswith(head)


def test_every_statement_finds_its_numbers(folder):
    for claim in CLAIMS:
        found = claim.check(notebook(folder, claim.part)["numbers"])
        assert re.search(r"\d", found.text), (claim.says, found.text)
        assert not re.search(r"\bnan\b|\binf\b", found.text), (claim.says, found.text)


def test_only_what_the_paper_leaves_out_stays_open(folder):
    left_open = [
        claim.says
        for claim in CLAIMS
        if claim.check(notebook(folder, claim.part)["numbers"]).verdict is Verdict.OPEN
    ]
    method, split = left_open
    assert "nor its software" in method
    assert "two independent longitudinal" in split


def test_what_does_not_depend_on_the_size_of_clouds_agrees(folder):
    for part, words, verdict in (
        ("model", "6.2-fold", Verdict.AGREES),
        ("model", "symmetric", Verdict.AGREES),
        ("model", "meet the longitudinal", Verdict.AGREES),
        ("misprints", "δ0", Verdict.AGREES),
        ("misprints", "δ3", Verdict.MISPRINT),
        ("misprints", "R1(0)", Verdict.MISPRINT),
        ("sweep", "increases with fiber helicity", Verdict.AGREES),
        ("uniqueness", "unique activation", Verdict.NEARLY),
        ("uniqueness", "Two fibers", Verdict.AGREES),
        ("misprints", "Θ̃2", Verdict.AGREES),
        ("misprints", "e_Θ", Verdict.MISPRINT),
        ("redundancy", "order of 1.0", Verdict.AGREES),
    ):
        assert checked(part, notebook(folder, part)["numbers"], words).verdict == verdict, words


def reversed_rows(values):
    return np.array(values)[::-1].tolist()


@pytest.mark.parametrize(
    ("words", "change", "verdict"),
    [
        ("6.2-fold", {"narrowing": 5}, Verdict.DIFFERS),
        ("symmetric", {"asymmetry": 1e-3}, Verdict.DIFFERS),
        ("R1(0)", {"refusal": "accepted"}, Verdict.AGREES),
        ("δ3", {"delta3": 1e-9}, Verdict.AGREES),
        ("δ3", {"delta3_corrected": 0.1}, Verdict.AGREES),
        ("Θ̃2", {"rotation": 0.1}, Verdict.DIFFERS),
        ("e_Θ", {"from_axis_deg": 80}, Verdict.AGREES),
        ("increases with fiber helicity", {"volume": reversed_rows}, Verdict.DIFFERS),
        ("UNR decreases", {"unreachability": reversed_rows}, Verdict.DIFFERS),
        ("make the clouds thicker", {"thickness": reversed_rows}, Verdict.DIFFERS),
        ("normal to the plane", {"aside": reversed_rows}, Verdict.DIFFERS),
        ("vice versa", {"curvature": reversed_rows}, Verdict.DIFFERS),
        ("closer to its tip", {"curvature": reversed_rows}, Verdict.DIFFERS),
        ("unique activation", {"activations": []}, Verdict.AGREES),
        ("unique activation", {"worst": 0.5}, Verdict.DIFFERS),
        ("Two fibers", {"area": 0.0}, Verdict.DIFFERS),
    ],
)
def test_verdicts_follow_the_numbers(folder, words, change, verdict):
    (part,) = {claim.part for claim in CLAIMS if words in claim.says}
    numbers = notebook(folder, part)["numbers"]
    changed = {k: v(numbers[k]) if callable(v) else v for k, v in change.items()}
    assert checked(part, numbers | changed, words).verdict == verdict


def test_a_step_smaller_than_its_errors_is_no_growth(folder):
    numbers = notebook(folder, "sweep")["numbers"]
    unsure = numbers | {"aside_error": np.ones((3, 3)).tolist()}
    found = checked("sweep", unsure, "normal to the plane")
    assert "grows in 0 of 6 (6 within the errors) steps" in found.text
    assert found.verdict is Verdict.DIFFERS


def test_volumes_beyond_planes_are_within_their_errors():
    """Of Ω = 108° and φ = 3°, where counts of cells gave 0.107: a set to 1e-3, with cut cells."""
    numbers = shapes(np.radians([108.0]), np.radians([3.0]), 5e-2)
    for name, right in (("aside", 0.1254), ("behind", 0.3639), ("thickness", 0.193)):
        value, error = (numbers[key][-1][-1] for key in (name, f"{name}_error"))
        assert abs(value - right) < error < 0.05 * right


def test_what_only_the_full_sizes_test_is_marked_so_in_a_quick_run(folder):
    text = (folder / "quick" / "report.html").read_text()
    found = re.findall(f"<td>({'|'.join(Verdict)})</td>", text)
    assert found.count("not tested") == sum(claim.full for claim in CLAIMS) > 5
    assert "differs" not in found


def test_a_part_computed_by_itself_is_that_of_a_whole_run_to_the_last_bit(folder, tmp_path):
    """As when a run is killed and resumed; all but the seconds that it took."""
    whole = notebook(folder, "model")
    Notebook(tmp_path, "model", whole["key"]).fill(model.model, TINY)
    again = json.loads((tmp_path / "model.json").read_text())
    assert again | {"seconds": 0.0} == whole | {"seconds": 0.0}
    figure = "figure_1c_architectures.pdf"
    before = (folder / "quick" / "figures" / figure).read_bytes()
    assert (tmp_path / figure).read_bytes() == before


def test_both_activations_of_the_example_reach_the_same_tip(folder):
    from softreach.arm.designs import minimal_trunk
    from softreach.rod.kinematics import tip_positions

    found = notebook(folder, "uniqueness")["numbers"]
    arm = minimal_trunk(*np.radians([found["revolution_deg"], found["taper_deg"]]))
    tips = tip_positions(arm, found["activations"], tol=1e-9)
    assert len(tips) > 1
    assert np.ptp(found["activations"], axis=0).max() > 0.1
    np.testing.assert_allclose(tips, [found["tip"]] * len(tips), rtol=0, atol=2e-6)


def test_a_finished_report_is_only_written_again(folder, small, monkeypatch):
    before = (folder / "quick" / "report.html").read_text()
    for name, section in reproduce.SECTIONS.items():
        monkeypatch.setattr(section, name, None)  # nothing to call
    assert reproduce_paper(folder, quick=True, overwrite=True).read_text() == before


def test_an_interrupted_report_keeps_its_finished_parts(tmp_path, small, monkeypatch):
    calls = []

    def part(name, fails=False):
        def compute(settings, notes):
            calls.append(name)
            if fails:
                raise KeyboardInterrupt
            return {name: 1.0}

        return SimpleNamespace(**{name: compute})

    monkeypatch.setattr(reproduce, "CLAIMS", ())
    monkeypatch.setattr(reproduce, "SECTIONS", {"a": part("a"), "b": part("b", fails=True)})
    with pytest.raises(KeyboardInterrupt):
        reproduce_paper(tmp_path, quick=True)
    monkeypatch.setattr(reproduce, "SECTIONS", {"a": part("a"), "b": part("b")})
    reproduce_paper(tmp_path, quick=True, overwrite=True)
    assert calls == ["a", "b", "b"]
    monkeypatch.setattr(reproduce, "QUICK", replace(TINY, seed=1))  # other sizes: all again
    reproduce_paper(tmp_path, quick=True, overwrite=True)
    assert calls == ["a", "b", "b", "a", "b"]


def test_the_report_opens_offline_without_a_missing_picture_and_prints(folder, browser, tmp_path):
    report, printed_pdf = folder / "quick" / "report.html", tmp_path / "report.pdf"
    page = browser.new_page()
    trouble, requests = heard(page)
    page.goto(report.as_uri())
    widths = page.evaluate("[...document.images].map(image => image.naturalWidth)")
    overflow = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    rows = page.locator("tbody tr").count()
    page.pdf(path=str(printed_pdf), prefer_css_page_size=True)
    page.close()
    assert trouble == []
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
    assert len(widths) > 12
    assert min(widths) > 100
    assert overflow <= 0
    assert rows >= len(CLAIMS)
    assert printed_pdf.read_bytes().startswith(b"%PDF")


tapers, angles = st.floats(0.02, 0.5), st.floats(0.05, 1.2)


@given(st.floats(0.3, 0.95), tapers, angles, st.sampled_from([-1, 1]), st.floats(0, 0.5))
def test_printed_appendix_a_is_the_integrals_but_for_delta3(ratio, taper, angle, hand, nu):
    if abs(taper - angle) < 0.02:
        return
    exact = ring_integrals(ratio, taper, hand * angle, nu)
    delta0, delta1, delta3, corrected = printed_deltas(ratio, taper, hand * angle, nu)
    assert delta0 == pytest.approx(4 * exact.axial, rel=1e-6)
    assert delta1 == pytest.approx(6 * exact.bending, rel=1e-6)
    assert corrected == pytest.approx(6 * exact.torsion, rel=1e-6)
    assert abs(delta3) > 2 * abs(corrected)


def test_an_atlas_that_was_removed_is_asked_for_and_does_not_come_back(tmp_path):
    notes = Notebook(tmp_path / "figures", "uniqueness", {})
    with pytest.raises(InvalidInput, match="must be an atlas written by build_atlas"):
        redundancy.uniqueness(TINY, notes)
    assert not (tmp_path / "atlas.zarr").exists()
