"""What the paper says, sentence by sentence, and how each is held against what was computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["CLAIMS", "Claim", "Finding", "Verdict"]

Array = NDArray[np.float64]
Numbers = Mapping[str, Any]


class Verdict(StrEnum):
    """How a statement fares."""

    AGREES = "agrees"
    NEARLY = "nearly"
    DIFFERS = "differs"
    MISPRINT = "misprint"


class Finding(NamedTuple):
    """What came out."""

    text: str
    verdict: Verdict


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and its check."""

    section: str
    """Where it stands."""
    says: str
    """The statement, in the paper's words or nearly so."""
    part: str
    """The part of the report that computes what it needs."""
    how: str
    """How it is checked."""
    check: Callable[[Numbers], Finding]
    """From the part's numbers to what came out."""


def _found(text: str, agrees: bool, nearly: bool = False) -> Finding:
    verdict = Verdict.AGREES if agrees else Verdict.NEARLY if nearly else Verdict.DIFFERS
    return Finding(text, verdict)


class _Sweep:
    """The atlas's numbers over (revolution, taper), and where they rise."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers = numbers
        self.revolution = numbers["revolution_deg"]
        self.taper = numbers["taper_deg"]

    def __getitem__(self, name: str) -> Array:
        return np.array(self.numbers[name], float)

    def place(self, flat: int | np.intp) -> str:
        """A design by its number."""
        i, j = divmod(int(flat), len(self.taper))
        return f"Ω = {self.revolution[i]:.4g}°, φ = {self.taper[j]:.4g}°"


def _rises(values: Array, axis: int) -> str:
    """How many steps along an axis go up."""
    step = np.diff(values, axis=axis)
    return f"{int((step > 0).sum())} of {step.size}"


def _narrowing(n: Numbers) -> Finding:
    return _found(f"{n['narrowing']:.2f}-fold", round(n["narrowing"], 1) == 6.2)


def _meeting(n: Numbers) -> Finding:
    words = f"at Z = L the edges of the sectors are {abs(n['gap_deg']):.2g}° apart"
    return _found(words, abs(n["gap_deg"]) < 1.0)


def _symmetry(n: Numbers) -> Finding:
    words = f"exchanging the helical activations mirrors the tip to within {n['asymmetry']:.1e} L"
    return _found(words, n["asymmetry"] < 1e-9)


def _radius(n: Numbers) -> Finding:
    volumes = ", ".join(f"{r}: {v:.3f}" for r, v in n["volumes"].items())
    words = (
        f"refused: {n['refusal']}. Read as R1 = {n['ratio']:g} R2. Exact V/L³ by ratio: {volumes}"
    )
    return Finding(words, Verdict.MISPRINT)


def _deltas(n: Numbers) -> Finding:
    worst = max(n["delta0"], n["delta1"])
    return _found(f"equal to the integrals to {worst:.0e}", worst < 1e-9)


def _delta3(n: Numbers) -> Finding:
    words = (
        f"as printed it is off by a factor of {1 + n['delta3_least']:.3g} at least; with the 3 "
        f"before the T terms alone it equals the integral to {n['delta3_mended']:.0e}"
    )
    return Finding(words, Verdict.MISPRINT)


def _angle(n: Numbers) -> Finding:
    words = (
        f"with Appendix B and Ω = 108° the helical fibers have α = {n['helical_angle_deg']:.3g}° "
        f"and the longitudinal one {n['longitudinal_deg']:.2g}°, as section 2 has it: α is "
        "measured from the axis, not from e_Θ"
    )
    return Finding(words, Verdict.MISPRINT)


def _size(n: Numbers) -> Finding:
    words = f"{n['designs']} clouds of {n['samples']:,} points"
    return _found(words, n["designs"] == 256 and n["samples"] == 400_000)


def _cost(n: Numbers) -> Finding:
    seconds = max(n["minimal_seconds"], n["redundant_seconds"])
    words = f"{n['samples']:,} points in {seconds:.2g} s on this machine"
    return _found(words, seconds < 60)


def _widening(n: Numbers) -> Finding:
    spread = _Sweep(n)["spread"]
    grows = [(np.diff(spread, axis=k) > 0).mean() for k in (0, 1)]
    words = (
        f"the mean distance from that plane grows in {_rises(spread, 0)} steps of Ω, but in only "
        f"{_rises(spread, 1)} of φ: taper adds to it without helicity, from {spread[0, 0]:.3f} to "
        f"{spread[0, -1]:.3f} L, and takes from it with, from {spread[-1, 0]:.3f} to "
        f"{spread[-1, -1]:.3f} L at the largest Ω"
    )
    return _found(words, min(grows) == 1.0, grows[0] > 0.5 and spread[0, -1] > spread[0, 0])


def _thickness(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    share = sweep["exact_volume"] / sweep["exact_volume"].max()
    words = (
        f"at Ω = {sweep.revolution[0]:.3g}° designs fill {share[0].min():.0%} to "
        f"{share[0].max():.0%} of the largest volume, at Ω = {sweep.revolution[-1]:.4g}° "
        f"{share[-1].min():.0%} to {share[-1].max():.0%}"
    )
    thicker = bool(share[0].max() < share[-1].min())
    return _found(words, thicker and share[0].max() < 0.1, thicker)


def _behind(n: Numbers) -> Finding:
    behind = _Sweep(n)["behind"]
    words = (
        f"the share of the volume behind the arm (y > 0) grows with φ from {behind[-1, 0]:.0%} to "
        f"{behind[-1, -1]:.0%} at the largest Ω; without helicity it goes from {behind[0, 0]:.0%} "
        f"to {behind[0, -1]:.0%}"
    )
    rises = behind[:, -1] > behind[:, 0]
    return _found(words, bool(rises.all()), bool(rises[-1]))


def _growth(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    exact, cloud = sweep["exact_volume"], sweep["volume"]
    words = (
        f"the exact volume grows in {_rises(exact, 0)} steps of Ω, that of the α-shapes in "
        f"{_rises(cloud, 0)}"
    )
    return _found(words, bool((np.diff(exact, axis=0) > 0).all()))


def _maximum(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    cloud, exact = sweep["volume"], sweep["exact_volume"]
    words = (
        f"α-shapes of radius {n['alpha']:g} L: {cloud.max():.3f} at {sweep.place(cloud.argmax())}; "
        f"exact: {exact.max():.3f} at {sweep.place(exact.argmax())}. The α-shape depends on a "
        "radius that the paper does not state and reads low"
    )
    best = sweep.taper[int(cloud.argmax()) % len(sweep.taper)]
    return _found(words, abs(cloud.max() - 0.67) < 0.01 and abs(best - 2) < 0.3, best > 1)


def _optimum(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    best = np.array(sweep.taper)[sweep["exact_volume"].argmax(axis=1)]
    words = f"the best φ lies between {best.min():.3g}° and {best.max():.3g}°, depending on Ω"
    return _found(words, best.max() > best.min())


def _decline(n: Numbers) -> Finding:
    unr = _Sweep(n)["exact_unreachability"]
    steps = [np.diff(unr, axis=k) for k in (0, 1)]
    worst = max(float(step.max()) for step in steps)
    words = (
        f"exact UNR rises in {_rises(unr, 0)} steps of Ω and {_rises(unr, 1)} of φ, by "
        f"{max(worst, 0):.4f} at most; from {unr[0, 0]:.3f} to {unr[-1, -1]:.3f}"
    )
    return _found(words, worst <= 0, worst < 0.01)


def _hulls(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    off = sweep["volume"] / sweep["exact_volume"] - 1
    words = f"α-shapes are {off.min():+.1%} to {off.max():+.1%} off the exact volume"
    return _found(words, bool(np.abs(off).max() < 0.1), bool(np.abs(np.median(off)) < 0.1))


def _curvatures(n: Numbers) -> tuple[Array, Array, dict[float, int]]:
    plain, tapered = np.array(n["curvature"])
    return plain, tapered, {q: k for k, q in enumerate(n["quantiles"])}


def _curling(n: Numbers) -> Finding:
    plain, tapered, at = _curvatures(n)
    middle = tapered[:, at[0.5]]
    words = (
        f"median κL of the tapered design rises from {middle[0]:.1f} to {middle[-1]:.1f} along the "
        f"distal half; of the untapered one from {plain[0, at[0.5]]:.1f} to "
        f"{plain[-1, at[0.5]]:.1f}"
    )
    return _found(words, bool((np.diff(middle) > 0).all()))


def _spread(n: Numbers) -> Finding:
    plain, tapered, at = _curvatures(n)
    plain_range, tapered_range = (c[:, at[0.95]] - c[:, at[0.05]] for c in (plain, tapered))
    ratio = tapered_range / plain_range
    words = (
        f"the middle 90 % of κL spans {ratio[0]:.1f} times as much at midlength and "
        f"{ratio[-1]:.1f} times at the tip"
    )
    return _found(words, bool(ratio.min() > 1))


def _cover(n: Numbers) -> Finding:
    plain, tapered, at = _curvatures(n)
    low, high = tapered[-1, at[0.0]], tapered[-1, at[1.0]]
    covered = low <= plain[-1, at[0.05]] and plain[-1, at[0.95]] <= high
    beyond = [q for q in at if tapered[-1, at[q]] > plain[-1, at[1.0]]]
    words = (
        f"at the tip the tapered design spans κL from {low:.2g} to {high:.3g}, the untapered one "
        f"from {plain[-1, at[0.0]]:.2g} to {plain[-1, at[1.0]]:.3g}; the tapered one exceeds all "
        f"of that in at least {1 - min(beyond, default=1.0):.0%} of its configurations"
    )
    return _found(words, bool(covered and beyond))


def _dependence(n: Numbers) -> Finding:
    many = list(n["volumes"])[-1]
    pairs = zip(n["radii"], n["volumes"][many], strict=True)
    values = ", ".join(f"{v:.3f} at {r:g} L" for r, v in pairs)
    words = (
        f"{int(many):,} points give {values}; the exact volume is {n['exact']:.4f} ± "
        f"{n['exact_error']:.0e} L³"
    )
    return Finding(words, Verdict.NEARLY)


def _unique(n: Numbers) -> Finding:
    share = np.array(n["share"], float)
    activations = "; ".join(
        "(" + ", ".join(f"{g:.3f}" for g in row) + ")" for row in n["activations"]
    )
    tip = ", ".join(f"{x:.3f}" for x in n["tip"])
    words = (
        f"{n['paper_share']:.2%} of the volume is reached by more than one activation at Ω = 108°, "
        f"φ = 2°, up to {n['worst']:.1%} at Ω = {n['revolution_deg']:.4g}°, "
        f"φ = {n['taper_deg']:.3g}°; below 0.1 % in {int((share < 1e-3).sum())} of {share.size} "
        f"designs. There γ = {activations} all reach ({tip}) m"
    )
    return _found(words, n["worst"] < 1e-6, n["worst"] < 0.1)


def _dimension(n: Numbers) -> Finding:
    words = f"dimension {n['dimension_of_two']} for two fibers, {n['dimension_of_one']} for one"
    return _found(words, n["dimension_of_two"] == 2 and n["dimension_of_one"] == 1)


def _split(n: Numbers) -> Finding:
    words = (
        "where the two lie is not printed; split in place, each keeping its extent, they are "
        + ("those of" if n["split_like_ours"] else "other than those of")
        + " our redundant design"
    )
    return _found(words, n["split_like_ours"])


def _families(n: Numbers) -> Finding:
    three, four = n["minimal"], n["redundant"]
    words = (
        f"three fibers: {three['solution_median']:.2f} activations reach a place (median over "
        f"cells); four: curves of activations, {four['solution_median']:.2f} long in the median, "
        f"{four['solution_largest']:.1f} at most"
    )
    return _found(words, four["solution_largest"] > 0)


def _small(n: Numbers) -> Finding:
    found = n["minimal"]
    words = f"median {found['median']:.3f}, 95 % below {found['quantiles']['0.95']:.3f}"
    return _found(words, found["quantiles"]["0.95"] < 0.5)


def _large(n: Numbers) -> Finding:
    found = n["redundant"]
    words = (
        f"median {found['median']:.3f}, 95 % below {found['quantiles']['0.95']:.3f}; above "
        f"{found['threshold']:g} in {found['redundant_volume']:.0%} of the volume, against "
        f"{n['minimal']['redundant_volume']:.0%}"
    )
    return _found(words, found["quantiles"]["0.95"] > 0.5 > n["minimal"]["quantiles"]["0.95"])


def _uneven(n: Numbers) -> Finding:
    three, four = n["minimal"]["heterogeneity"], n["redundant"]["heterogeneity"]
    words = f"the density varies by {four:.0%} of its mean, against {three:.0%}, beyond chance"
    return _found(words, four > three)


def _front(n: Numbers) -> Finding:
    found = n["redundant"]
    words = (
        f"{found['density_front']:.3g} points/m³ in front against {found['density_behind']:.3g} "
        f"behind; median D̄ {found['distance_front']:.2f} against {found['distance_behind']:.2f}"
    )
    dense = found["density_front"] > found["density_behind"]
    return _found(words, dense and found["distance_front"] > found["distance_behind"], dense)


def _claims() -> Iterator[Claim]:
    """All statements, in the paper's order."""
    yield Claim(
        "2",
        "R2(0) = L/16, R1(0) = L/12, and ν = 1/2",
        "misprints",
        "A design with these radii is built; exact volumes for other ratios at Ω = 108°, φ = 2°.",
        _radius,
    )
    yield Claim(
        "3",
        "N can be as large as 2·10⁶, at a computational cost of only several minutes",
        "redundancy",
        "Both clouds of that size are computed and timed.",
        _cost,
    )
    yield Claim(
        "3",
        "A 16 × 16 sweep of Ω ∈ [0°, 108°] and φ ∈ [0°, 3°], 400,000 activations each",
        "sweep",
        "The same sweep.",
        _size,
    )
    yield Claim(
        "3",
        "At Ω = 108° the helical fibers meet the longitudinal fiber at the distal end",
        "model",
        "Angles of the sectors at Z = L from Appendix B.",
        _meeting,
    )
    yield Claim(
        "3",
        "φ = 3° yields approximately a 6.2-fold decrease in the outer radius",
        "model",
        "R2(0) / R2(L).",
        _narrowing,
    )
    yield Claim(
        "3",
        "All designs are symmetric about the plane through the longitudinal fiber",
        "model",
        "Tips of activations with the helical ones exchanged, at the corners of the atlas.",
        _symmetry,
    )
    yield Claim(
        "3",
        "Increasing fiber helicity or tapering expands the reach normal to the plane of symmetry",
        "sweep",
        "Root mean square of x over the cells of L/20 that hold a tip.",
        _widening,
    )
    yield Claim(
        "3",
        "Larger revolutions make the clouds thicker; those at Ω = 0° are closely two-dimensional",
        "sweep",
        "Exact volumes relative to the largest.",
        _thickness,
    )
    yield Claim(
        "3",
        "Higher tapering extends the reach behind, on the helical-fiber side",
        "sweep",
        "Cells of L/20 that hold a tip.",
        _behind,
    )
    yield Claim(
        "4",
        "All concave hulls represent the clouds accurately; their volume is a good approximation",
        "sweep",
        "α-shape against exact volume over all designs.",
        _hulls,
    )
    yield Claim(
        "4",
        "We use the α-shapes method (neither its radius nor its software is stated)",
        "volume",
        "V(α) of one cloud from one triangulation, against the exact reachable set.",
        _dependence,
    )
    yield Claim(
        "4",
        "The cloud volume generally increases with fiber helicity",
        "sweep",
        "Neighboring designs along Ω.",
        _growth,
    )
    yield Claim(
        "4",
        "At φ* = 2° the normalized volume is maximal, V/L³ ≈ 0.67",
        "sweep",
        "Largest volume of the sweep.",
        _maximum,
    )
    yield Claim(
        "4",
        "The precise location of this maximum depends on the design parameters",
        "sweep",
        "Best φ at each Ω, exact volumes.",
        _optimum,
    )
    yield Claim(
        "4",
        "UNR decreases when either the fiber helicity or the tapering angle increases",
        "sweep",
        "Neighboring designs along Ω and φ, exact volumes.",
        _decline,
    )
    yield Claim(
        "4",
        "The tapered design produces increasingly higher curvatures closer to its tip",
        "sweep",
        "Curvature of all configurations at six stations, φ = 3° against 0° at Ω = 108°.",
        _curling,
    )
    yield Claim(
        "4",
        "The range of curvatures is significantly widened",
        "sweep",
        "Quantiles at the same stations.",
        _spread,
    )
    yield Claim(
        "4",
        "The tapered design can generate most curvatures of the non-tapered one, not vice versa",
        "sweep",
        "Ranges and quantiles at the tip.",
        _cover,
    )
    yield Claim(
        "5, 6",
        "Three-fiber designs offer a unique activation for every point in their workspace",
        "uniqueness",
        "Multiplicity of the exact reachable set of every design; an example by the exact inverse.",
        _unique,
    )
    yield Claim(
        "5",
        "Two fibers reach a two-dimensional surface, one fiber a one-dimensional curve",
        "uniqueness",
        "Reachable sets of the minimal design without its other fibers.",
        _dimension,
    )
    yield Claim(
        "5",
        "The longitudinal fiber is split into two independent longitudinal fibers",
        "redundancy",
        "Splitting the fiber of the minimal design.",
        _split,
    )
    yield Claim(
        "5",
        "With four fibers several activation quadruplets reach the same position",
        "redundancy",
        "Size of the family of activations per place, by the coarea formula.",
        _families,
    )
    yield Claim(
        "5",
        "The end-point density of the redundant design is more heterogeneous",
        "redundancy",
        "Counts in cells of L/20, less what chance explains.",
        _uneven,
    )
    yield Claim(
        "5",
        "The front, where the longitudinal fibers are, is denser and more redundant",
        "redundancy",
        "Mean density of cells and median D̄ of points with y < 0 against y > 0.",
        _front,
    )
    yield Claim(
        "5",
        "For the minimal design the values of D̄ are generally small",
        "redundancy",
        "D̄ at r = L/60 for as many points as the paper's figure.",
        _small,
    )
    yield Claim(
        "5",
        "Mean distance values on the order of 1.0 are highly indicative of redundancy",
        "redundancy",
        "The same for the redundant design.",
        _large,
    )
    yield Claim(
        "App. A",
        "δ0 and δ1 = δ2",
        "misprints",
        "The printed formulas against the integrals over the cross-section that they stand for.",
        _deltas,
    )
    yield Claim(
        "App. A",
        "δ3 = 3 / (cφ² cα² √(cφ² - cα²)) [(T ...) cφ² + 6 cα (S(R2) - S(R1))]",
        "misprints",
        "The same; at other places of the 3 as well.",
        _delta3,
    )
    yield Claim(
        "App. C",
        "α is the angle between the fiber direction and e_Θ",
        "misprints",
        "α that gives the stated Ω by Appendix B.",
        _angle,
    )


CLAIMS = tuple(_claims())
"""Every statement that is checked."""
