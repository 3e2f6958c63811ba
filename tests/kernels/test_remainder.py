"""Bounds beyond the quadratic part are what corners of boxes say."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from softreach.kernels.rod.remainder import cubic_errors


@pytest.mark.parametrize("bundles", [1, 3, 4, 6])
def test_bounds_are_those_of_the_worst_corner(bundles):
    rng = np.random.default_rng(bundles)
    root, twice = rng.normal(size=(bundles, bundles)), rng.uniform(size=(bundles, bundles))
    turns, stretches, turned_stretches = root @ root.T, *rng.uniform(size=(2, bundles))
    half, cell = rng.uniform(size=(40, bundles)), rng.integers(0, 5, 40)
    longest, turned = rng.uniform(size=(2, 5))
    out = np.empty(40)
    forms = turns, twice, stretches, turned_stretches, 0.3, 0.7
    cubic_errors(half, cell, longest, turned, forms, out)
    for h, long, t, bound in zip(half, longest[cell], turned[cell], out, strict=True):
        corners = np.array(list(product((-1.0, 1.0), repeat=bundles))) * h
        a = t * np.sqrt(max(d @ turns @ d for d in corners))
        b = h @ twice @ h
        expected = long * (0.3 * a**3 + 0.7 * a * b)
        expected += a**2 * turned_stretches @ h + b * stretches @ h
        assert bound == pytest.approx(expected, rel=1e-12)
