"""How many activations reach a shown point: what the inverse finds, and the volume tells."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.inverse import solve_inverse
from softreach.rod.rods import tip_map
from softreach.studio.multiplicity import count_activations, uncounted
from softreach.studio.reach import Quality, Reach, shown_rows, stages
from softreach.studio.scene.clouds import key_html, sample_colors, sample_values
from softreach.studio.work import Dropped

SMALL = Quality(coarse_level=8, fine_level=13, fine_accuracy=0.01)
LEVEL = 13
FOLDED = ((75.0, 3.0), (36.0, 3.0), (0.0, 3.0), (54.0, 2.0))
"""Revolution and taper [deg] of designs whose map folds."""


def fine_reach(revolution: float, taper: float) -> Reach:
    arm = designs.minimal_trunk(revolution=np.radians(revolution), taper=np.radians(taper))
    return list(stages(arm, LEVEL, SMALL, lambda: None))[-1]


@pytest.fixture(scope="module")
def folded() -> Reach:
    return fine_reach(*FOLDED[1])


@pytest.mark.parametrize(
    ("revolution", "taper"),
    [FOLDED[0], *(pytest.param(*folded, marks=pytest.mark.large) for folded in FOLDED[1:])],
)
def test_places_counted_once_for_every_activation_make_up_the_volume(revolution, taper):
    # V = ∫ |det ∂r/∂γ| / m dγ over the box, if every place counts m activations.
    reach = fine_reach(revolution, taper)
    counts = sample_values(reach, LEVEL, "multiplicity")
    assert counts.min() >= 1
    assert counts.max() >= 2
    _, slopes = tip_map(reach.arm).tips_and_slopes(reach.cloud.activation.values)
    stretch = np.abs(np.linalg.det(slopes)) * np.prod(np.ptp(reach.arm.bounds, axis=1))
    volume, error = reach.exact.volume, reach.exact.volume_error
    assert (stretch / counts).mean() == pytest.approx(volume, abs=error + 0.003 * volume)


def test_away_from_folds_points_have_the_colors_of_what_the_inverse_finds(folded):
    rows = shown_rows(folded, 9)
    found = solve_inverse(folded.arm, folded.cloud.tip.values[rows])  # with its own tolerance
    worst = [one.conditions.max(initial=np.inf if not len(one) else 0.0) for one in found]
    regular = np.array(worst) < 100
    shown = sample_values(folded, 9, "multiplicity")
    assert regular.mean() > 0.5
    np.testing.assert_array_equal(shown[regular], found.counts[regular])


def test_the_key_has_the_color_and_the_share_of_each_number_of_activations(folded):
    counts = sample_values(folded, LEVEL, "multiplicity").values
    rgb, key = sample_colors(folded, LEVEL, "multiplicity")
    known = np.unique(counts)
    assert 1 < len(known) <= len(key.names)
    for count, name, color in zip(known, key.names, key.colors, strict=True):
        number, share = name.removesuffix(" %").split(": ")
        assert int(number) == count
        assert float(share) == pytest.approx(100 * (counts == count).mean(), rel=0.1)
        assert (rgb[counts == count] == color).all()
    assert "activations" in key_html(key)


def test_what_was_counted_before_it_was_stopped_is_kept(folded):
    reach = fine_reach(*FOLDED[1])
    rows = np.arange(1 << LEVEL)

    def stop(done: int) -> None:
        raise Dropped

    with pytest.raises(Dropped):
        count_activations(reach, rows[:5000], progress=stop)
    assert len(uncounted(reach, rows)) == len(rows) - 5000


def test_coarse_clouds_are_colored_by_activations_until_all_is_counted(folded):
    coarse = next(stages(folded.arm, LEVEL, SMALL, lambda: None))
    assert isinstance(sample_values(coarse, 8, "multiplicity"), str)
