"""The minimal and the redundant design."""

from __future__ import annotations

from softreach.paper.verdict import Finding, Numbers, Verdict, judged

__all__ = ["cost", "families", "front", "large", "small", "split", "uneven"]


def cost(n: Numbers) -> Finding:
    """Time of the larger cloud."""
    seconds = max(n["minimal_seconds"], n["redundant_seconds"])
    words = f"{n['samples']:,} points in {seconds:.2g} s on this machine"
    return judged(words, n["samples"] >= 2_000_000 and seconds < 600, seconds < 600)


def split(n: Numbers) -> Finding:
    """Where the two longitudinal fibers lie."""
    first, second = n["offsets_deg"]
    words = (
        "neither their places nor their extents are printed. We keep the extent of "
        f"{n['extent_deg']:g}° for each and put them side by side, at {first:g}° and {second:g}°"
    )
    return Finding(words, Verdict.OPEN)


def families(n: Numbers) -> Finding:
    """How many activations reach a place."""
    three, four = n["minimal"], n["redundant"]
    words = (
        f"three fibers: {three['solution_median']:.2f} activations reach a place (median over "
        f"inner cells); four: curves of activations, {four['solution_median']:.2f} long in the "
        f"median, below {four['solution_low']:.2f} in a twentieth of the cells, "
        f"{four['solution_largest']:.1f} at most"
    )
    return judged(words, abs(three["solution_median"] - 1) < 0.1 < four["solution_low"])


def uneven(n: Numbers) -> Finding:
    """Heterogeneity of the density."""
    three, four = n["minimal"]["heterogeneity"], n["redundant"]["heterogeneity"]
    words = f"the density varies by {four:.0%} of its mean, against {three:.0%}, beyond chance"
    return judged(words, four > three)


def front(n: Numbers) -> Finding:
    """Density and D̄ in front and behind."""
    found = n["redundant"]
    words = (
        f"{found['density_front']:.3g} points/m³ in front against {found['density_behind']:.3g} "
        f"behind; median D̄ {found['distance_front']:.2f} against {found['distance_behind']:.2f}"
    )
    dense = found["density_front"] > found["density_behind"]
    return judged(words, dense and found["distance_front"] > found["distance_behind"])


def small(n: Numbers) -> Finding:
    """D̄ of three fibers."""
    found = n["minimal"]
    words = f"median {found['median']:.3f}, 95 % below {found['quantiles']['0.95']:.3f}"
    return judged(words, found["quantiles"]["0.95"] < 0.5)


def large(n: Numbers) -> Finding:
    """D̄ of four."""
    found = n["redundant"]
    words = (
        f"median {found['median']:.3f}, 95 % below {found['quantiles']['0.95']:.3f}; above "
        f"{found['threshold']:g} in {found['redundant_volume']:.0%} of the volume, against "
        f"{n['minimal']['redundant_volume']:.0%}"
    )
    return judged(words, found["quantiles"]["0.95"] > 0.5 > n["minimal"]["quantiles"]["0.95"])
