"""Tensor trees: averages over cells of the unit cube, which are small where f_r varies and large where it does not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brdfdb.parameters import Floats

Index = NDArray[np.int64]

DIGITS = 4  # of values in files
DEEPEST = 24  # levels below the root; a cell is then smaller than what float32 resolves
_TOKEN = re.compile(r"\{([^{}]*)\}|([{}])|[^{}\s,]+")
_SHOWN = 20  # characters of a wrong word that a sentence repeats
ISOTROPIC, ANISOTROPIC = 3, 4  # ranks of a tree
_INSIDE = 1.0 - 1e-12  # largest coordinate of a position, so that it lies in a cell
MERGED = 2e-4  # largest difference of u' or v' in a cell: 0.3 % of Z in the colours of metals
_WHITE = (4.0 / 19.0, 9.0 / 19.0)  # of equal energy


@dataclass(frozen=True, eq=False)
class Tree:
    """A tree of cells: each divides into 2^rank children, or is a leaf with a grid of values.

    Bit j of the number of a child is the half of dimension j. In a grid dimension 0 varies slowest.
    """

    rank: int  #: dimensions of the cube
    #: Inner nodes: the number of an inner node, or ``-1 - leaf``, (inner, 2^rank). The root is node 0, or leaf 0 if
    #: there is no node.
    children: Index
    start: Index  #: place of the first value of each leaf, (leaves,)
    halvings: Index  #: each axis of the grid of a leaf has 2^halvings cells, (leaves,)
    values: Floats  #: values of all leaves; negative ones stand for 0, (N,)

    def at(self, place: Floats) -> Floats:
        """Return the values (N,) at positions (N, rank) in the unit cube; negative ones are 0, as for Radiance."""
        rest = place.copy()
        node = np.full(len(place), 0 if len(self.children) else -1, dtype=np.int64)
        bits = 1 << np.arange(self.rank)
        inner = np.flatnonzero(node >= 0)
        while inner.size:
            doubled = 2.0 * rest[inner]
            upper = doubled >= 1.0
            rest[inner] = doubled - upper
            node[inner] = self.children[node[inner], upper @ bits]
            inner = inner[node[inner] >= 0]
        leaf = -1 - node
        halvings = self.halvings[leaf]
        cell = (rest * (1 << halvings)[:, np.newaxis]).astype(np.int64)
        offset = np.zeros(len(place), dtype=np.int64)
        for j in range(self.rank):
            offset = (offset << halvings) + cell[:, j]
        return np.asarray(np.maximum(self.values[self.start[leaf] + offset], 0.0))

    def middles(self) -> Floats:
        """Return the positions (N, rank) of the middles of all cells, in the order of the values."""
        corner, size = np.zeros((len(self.start), self.rank)), np.ones(len(self.start))
        below = np.zeros((len(self.children), self.rank)), np.ones(len(self.children))
        for node, children in enumerate(self.children):  # parents before their children
            for number, child in enumerate(children.tolist()):
                half = 0.5 * below[1][node]
                place = below[0][node] + half * (number >> np.arange(self.rank) & 1)
                corners, sizes = below if child >= 0 else (corner, size)
                at = child if child >= 0 else -1 - child
                corners[at], sizes[at] = place, half
        counts = 1 << self.rank * self.halvings
        leaf = np.repeat(np.arange(len(self.start)), counts)
        offset = np.arange(len(self.values)) - self.start[leaf]
        middles = np.empty((len(self.values), self.rank))
        for axis in range(self.rank):
            halvings = self.halvings[leaf]
            cell = (offset >> halvings * (self.rank - 1 - axis)) & ((1 << halvings) - 1)
            middles[:, axis] = corner[leaf, axis] + size[leaf] * (cell + 0.5) / (1 << halvings)
        return middles

    def at_vectors(self, wi: Floats, wr: Floats) -> Floats:
        """Return the values (N,) at unit vectors (N, 3) of light and viewer."""
        return self.at(positions(wi, wr, self.rank))

    def text(self) -> str:
        """Return the tree as Radiance reads it."""
        numbers = [f"{value:.{DIGITS}g}".removeprefix("0") or "0" for value in self.values.tolist()]
        if not len(self.children):
            return f"{{{' '.join(numbers)}}}"
        return "".join(_braces(self, numbers))


def rounded(values: Floats) -> Floats:
    """Return values with the digits that files have."""
    exponent = np.floor(np.log10(np.abs(values), out=np.zeros_like(values), where=values != 0.0))
    unit = 10.0 ** (exponent - (DIGITS - 1))
    return np.asarray(np.rint(values / unit) * unit)


def reduced(tree: Tree, parts: Floats, weight: Floats, tolerance: float) -> Tree:
    """Return a tree of single cells with children merged where their values differ by no more than a tolerance.

    Each leaf of the tree has one value, in `parts`, with a weight in averages. Children have larger numbers than their
    parents.
    """
    inner = len(tree.children)
    # Of all nodes; leaf k, whose code is -1 - k, stands at that place from the end
    mass, total = np.zeros((2, inner + len(parts)))
    low, high = np.full(len(mass), np.inf), np.full(len(mass), -np.inf)
    dark = weight <= 0.0
    mass[inner:], total[inner:] = weight[::-1], (weight * parts)[::-1]
    low[inner:], high[inner:] = np.where(dark, np.inf, parts)[::-1], np.where(dark, -np.inf, parts)[::-1]
    for node in range(inner - 1, -1, -1):
        below = tree.children[node]
        mass[node], total[node] = mass[below].mean(), total[below].mean()
        low[node], high[node] = low[below].min(), high[below].max()
    mean = np.divide(total, mass, out=np.full(len(mass), parts[0]), where=mass > 0.0)
    kept = high[:inner] - low[:inner] > tolerance
    if not np.any(kept):
        return Tree(tree.rank, tree.children[:0], np.zeros(1, np.int64), np.zeros(1, np.int64), mean[:1])
    below = tree.children[kept]
    inside = (below >= 0) & np.append(kept, False)[np.maximum(below, -1)]
    values = mean[below[~inside]]
    children = np.empty_like(below)
    children[inside] = (np.cumsum(kept) - 1)[below[inside]]
    children[~inside] = -1 - np.arange(len(values))
    return Tree(tree.rank, children, np.arange(len(values)), np.zeros(len(values), np.int64), values)


def _braces(tree: Tree, numbers: list[str]) -> Iterator[str]:
    """Yield the pieces of the text of a tree: a node whose children are single cells is a grid of two cells an axis."""
    # Dimension 0 is the first bit of a child, and the last one of a place in a grid
    order = [sum((k >> j & 1) << (tree.rank - 1 - j) for j in range(tree.rank)) for k in range(1 << tree.rank)]
    leaf_of = np.where(tree.children < 0, -1 - tree.children, 0)
    grids = np.all((tree.children < 0) & (tree.halvings[leaf_of] == 0), axis=1).tolist()
    children, start, halvings = tree.children.tolist(), tree.start.tolist(), tree.halvings.tolist()
    stack: list[int | str] = [0]
    while stack:
        top = stack.pop()
        if isinstance(top, str):
            yield top
        elif top < 0:
            leaf = -1 - top
            yield f"{{{' '.join(numbers[start[leaf] : start[leaf] + (1 << tree.rank * halvings[leaf])])}}}"
        elif grids[top]:
            yield f"{{{' '.join([numbers[start[-1 - children[top][k]]] for k in order])}}}\n"
        else:
            yield "{"
            stack.append("}\n")
            stack.extend(reversed(children[top]))


def parsed(text: str, rank: int) -> Tree:
    """Return the tree that a text describes.

    Raises
    ------
    ValueError
        If the text is no tree; the sentence says why.
    """
    start: list[int] = []
    halvings: list[int] = []
    values: list[float] = []
    nodes: list[list[int]] = []  # children before their parents
    path: list[list[int]] = [[]]  # the children, so far, of all open nodes; the first list is that of the root
    if "_" in text:
        raise ValueError("a number has the sign _")
    for match in _TOKEN.finditer(text):
        grid, brace = match.groups()
        if grid is not None:
            numbers = grid.replace(",", " ").split()
            start.append(len(values))
            halvings.append(max(0, len(numbers).bit_length() - 1) // rank)
            if len(numbers) != 1 << rank * halvings[-1]:
                raise ValueError(f"a grid of {len(numbers)} values is not of the same length along {rank} axes")
            values.extend(map(float, numbers))
            path[-1].append(-len(start))
        elif brace == "{":
            if len(path) > DEEPEST:
                raise ValueError(f"it has more than {DEEPEST} levels")
            path.append([])
        elif brace == "}" and len(path) > 1:
            closed = path.pop()
            if len(closed) != 1 << rank:
                raise ValueError(f"a node has {len(closed)} children instead of {1 << rank}")
            path[-1].append(len(nodes))
            nodes.append(closed)
        else:
            raise ValueError(f"{match.group()[:_SHOWN]!r} is outside the braces")
    if len(path) != 1 or len(path[0]) != 1:
        raise ValueError("a brace is not closed" if len(path) != 1 else f"it has {len(path[0])} roots")
    numbers_read = np.array(values)
    if not np.all(np.isfinite(numbers_read)):
        raise ValueError("a value is not finite")
    inner = np.array(nodes, dtype=np.int64).reshape(-1, 1 << rank)
    inner = np.where(inner >= 0, len(nodes) - 1 - inner, inner)[::-1]  # the root is the first node, not the last
    return Tree(rank, inner, np.array(start), np.array(halvings), numbers_read)


def disk(square: Floats) -> Floats:
    """Return points (..., 2) of the unit disk for points (..., 2) of the unit square; areas keep their ratio.

    Shirley and Chiu 1997: concentric squares become concentric circles.
    """
    a, b = 2.0 * square[..., 0] - 1.0, 2.0 * square[..., 1] - 1.0
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    ratio = np.divide(np.where(wide, b, a), radius, out=np.zeros_like(radius), where=radius != 0.0)
    angle = np.where(wide, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def square(disk: Floats) -> Floats:
    """Return points (..., 2) of the unit square for points (..., 2) of the unit disk: the inverse of `disk`."""
    x, y = disk[..., 0], disk[..., 1]
    radius = np.hypot(x, y)
    wide = np.abs(x) > np.abs(y)
    far, near = np.where(wide, x, y), np.where(wide, y, x)
    large, small = np.copysign(radius, far), radius * np.arctan2(near, np.abs(far)) * (4.0 / np.pi)
    return np.stack([np.where(wide, large, small), np.where(wide, small, large)], axis=-1) * 0.5 + 0.5


def _risen(xy: Floats) -> NDArray[np.float64]:
    """Return the unit vectors (..., 3) above the points (..., 2) of the unit disk."""
    z = np.sqrt(np.maximum(0.0, 1.0 - np.sum(xy * xy, axis=-1, keepdims=True)))
    return np.concatenate([xy, z], axis=-1)


def lights(place: Floats) -> Floats:
    """Return unit vectors (..., 3) of the light at the first one (rank 3) or two (rank 4) coordinates of positions.

    Rank 4: the square of the mirrored light. Rank 3: (1 - sin theta) / 2, with an azimuth of pi.
    """
    if place.shape[-1] == 2:
        return _risen(-disk(place))
    along = 2.0 * place - 1.0
    return _risen(np.concatenate([along, np.zeros_like(along)], axis=-1))


def viewers(place: Floats) -> Floats:
    """Return unit vectors (..., 3) of the viewer at the last two coordinates of positions."""
    return _risen(disk(place))


def positions(wi: Floats, wr: Floats, rank: int) -> Floats:
    """Return positions (N, rank) in the unit cube of a tree for unit vectors (N, 3) of light and viewer."""
    if rank == ANISOTROPIC:
        place = np.concatenate([square(-wi[:, :2]), square(wr[:, :2])], axis=-1)
    else:
        sine = np.hypot(wi[:, 0], wi[:, 1])
        safe = np.where(sine > 0.0, sine, 1.0)
        # Cosine and sine of the azimuth of the mirrored light, towards which the frame of the viewer is turned
        c, s = np.where(sine > 0.0, -wi[:, 0] / safe, 1.0), np.where(sine > 0.0, -wi[:, 1] / safe, 0.0)
        turned = np.stack([c * wr[:, 0] + s * wr[:, 1], c * wr[:, 1] - s * wr[:, 0]], axis=-1)
        place = np.concatenate([(0.5 - 0.5 * sine)[:, np.newaxis], square(turned)], axis=-1)
        place[:, 0] = np.minimum(place[:, 0], 0.5 * _INSIDE)
    return np.asarray(np.clip(place, 0.0, _INSIDE))


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
