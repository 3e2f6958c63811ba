"""The order in which points enter a triangulation: random rounds, each along a Hilbert curve.

A random eighth of the points goes first, an eighth of that before it, and so on (biased randomized
insertion order), which keeps the expected work low for any input; along the curve each point lies
close to the one before, so that walks are short and memory is reused.

References:
    Amenta, Choi, Rote (2003), Incremental constructions con BRIO, SoCG, 211-219.
    Skilling (2004), Programming the Hilbert curve, AIP Conference Proceedings 707, 381-387.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict

BITS = 16  # per axis; the round stands above the 48 bits of the curve
ROUNDS = 6
QUANTILES = 1024


def insertion_order(points, members=None, early=None):
    """Order in which to insert points (n, 3), or increasing members; those of a mask `early` first.

    A part keeps the order of the whole.
    """
    members = np.arange(len(points)) if members is None else members
    early = np.ones(len(points), np.bool_) if early is None else early
    if len(members) == 0:
        return members
    places = np.empty((len(members), 3), np.uint16)
    for axis in range(3):
        places[:, axis] = _crowding_scale(points[:, axis], members)
    keys = np.empty(len(members), np.uint64)
    _sort_keys(places, members, early, keys)
    return members[np.argsort(keys, kind="stable")]


def _crowding_scale(x, members):
    """Coordinates mapped to [0, 2^BITS), half by length, half by rank for the sake of outliers."""
    sample = np.sort(x[:: max(1, len(x) // QUANTILES)])
    spread = sample[-1] - sample[0]
    level = np.linspace(0.0, 1.0, len(sample))
    if spread > 0:
        level = 0.5 * level + 0.5 * (sample - sample[0]) / spread
    return np.interp(x[members], sample, level * (2**BITS - 1)).astype(np.uint16)


@strict
def _sort_keys(places, members, early, keys):
    """Write one integer per point: its round, then its place on the Hilbert curve."""
    for i in range(len(places)):
        x, y, z = np.uint32(places[i, 0]), np.uint32(places[i, 1]), np.uint32(places[i, 2])
        late = np.uint64(ROUNDS - _round_from_end(members[i]))
        if not early[members[i]]:
            late = np.uint64(ROUNDS + 1)
        keys[i] = (late << np.uint64(3 * BITS)) | _hilbert(x, y, z)


@strict
def _round_from_end(i):
    """0 for seven points of eight, 1 for seven eighths of the rest, ...: a hash of the index."""
    bits = np.uint64(i + 1) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    bits ^= bits >> np.uint64(32)
    early = 0
    while early < ROUNDS and bits & np.uint64(7) == np.uint64(0):
        bits >>= np.uint64(3)
        early += 1
    return early


@strict
def _hilbert(x, y, z):
    """Position of the cell (x, y, z) along the Hilbert curve through 2^(3 BITS) cells."""
    x, y, z = _untwist(x, y, z)
    position = np.uint64(0)
    for bit in range(BITS - 1, -1, -1):
        shift = np.uint32(bit)
        for axis in (x, y, z):
            position = (position << np.uint64(1)) | np.uint64((axis >> shift) & np.uint32(1))
    return position


@strict
def _untwist(x, y, z):
    """Skilling's transform of axes to the transposed Hilbert index."""
    for bit in range(BITS - 1, 0, -1):
        q = np.uint32(1) << np.uint32(bit)
        low = q - np.uint32(1)
        if x & q:
            x ^= low
        x, y = _reflect(x, y, q, low)
        x, z = _reflect(x, z, q, low)
    y ^= x
    z ^= y
    flip = np.uint32(0)
    for bit in range(BITS - 1, 0, -1):
        q = np.uint32(1) << np.uint32(bit)
        if z & q:
            flip ^= q - np.uint32(1)
    return x ^ flip, y ^ flip, z ^ flip


@strict
def _reflect(x, other, q, low):
    """Invert the low bits of x where the other axis has bit q set, else exchange them."""
    if other & q:
        return x ^ low, other
    swap = (x ^ other) & low
    return x ^ swap, other ^ swap
