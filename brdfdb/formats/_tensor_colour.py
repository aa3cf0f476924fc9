"""Colour in tensor trees, as Radiance reads it: luminance, and the chromaticities u' and v' of CIE 1976."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brdfdb.formats._tensor_tree import Tree, reduced, rounded
from brdfdb.parameters import Floats

MERGED = 2e-4  # largest difference of u' or v' in a cell: 0.3 % of Z in the colours of metals
_WHITE = (4.0 / 19.0, 9.0 / 19.0)  # of equal energy


def trees_of(tree: Tree, xyz: Floats) -> tuple[Tree, Tree, Tree]:
    """Return the trees of Y, u' and v' of a tree whose leaves have the colours `xyz`, shape (leaves, 3)."""
    x, y, z = np.moveaxis(np.maximum(xyz, 0.0), -1, 0)
    total = x + 15.0 * y + 3.0 * z
    bright = total > 0.0
    u = np.divide(4.0 * x, total, out=np.full_like(x, _WHITE[0]), where=bright)
    v = np.divide(9.0 * y, total, out=np.full_like(x, _WHITE[1]), where=bright)
    # Chromaticities of a sum are averages with this weight, not with Y alone
    chroma = [reduced(tree, part, total, MERGED) for part in (u, v)]
    return (
        replace(tree, values=rounded(y)),
        *(replace(part, values=rounded(part.values)) for part in chroma),  # type: ignore[return-value]
    )


def xyz_of(y: Floats, u: Floats, v: Floats) -> Floats:
    """Return X, Y and Z, shape (N, 3), from luminance and chromaticities (N,)."""
    safe = np.where(v > 0.0, v, _WHITE[1])
    x, z = y * 9.0 * u / (4.0 * safe), y * (12.0 - 3.0 * u - 20.0 * safe) / (4.0 * safe)
    return np.stack([x, y, np.maximum(z, 0.0)], axis=-1)
