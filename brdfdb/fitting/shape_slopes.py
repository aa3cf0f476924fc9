"""Derivatives of the basis of a surface by the shape of its terms, for models that state their gradient."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.surface import Surface, Term, columns
from brdfdb.fitting.variables import EDGE, NORMAL, index_slopes
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.parameters import Floats

Array = NDArray[np.float64]


def basis_slopes(surface: Surface, x: Array, view: InstrumentView) -> dict[int, Floats]:
    """Return the derivatives (M, N, C) or (M, N, 1) [1/sr] of `Surface.basis` by shape variables.

    Parameters
    ----------
    surface : Surface
        The surface.
    x : array (S,)
        A point of the unit cube.
    view : InstrumentView
        N pairs of directions.

    Returns
    -------
    dict of int to array
        The variables of terms whose models have a gradient. A specular part inside an aperture has none, nor have n and
        k where k is 0, at the end of its range.
    """
    numbers = surface.numbers(x)
    several = surface.channels if surface.indexed else 1
    sizes = [len(term.polynomial.exponents) for term in surface.terms]
    slopes: dict[int, Floats] = {}
    of_variables = [_moves(surface, variable, x, numbers) for variable in range(len(surface.shape))]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    refused: set[int] = set()
    for number, term in enumerate(surface.terms):
        wanted = {variable: moves[number] for variable, moves in enumerate(of_variables) if moves[number]}
        if not wanted:
            continue
        if term.spec.gradient is None or (view.half_angle and term.spec.specular is not None):
            refused |= wanted.keys()
            continue
        own = several if term.spec.spectral else 1
        names = {name for moves in wanted.values() for name in moves}
        by_name = [_term_slopes(term, view, surface.arguments(number, numbers[number], c), names) for c in range(own)]
        for variable, moves in wanted.items():
            of_term = np.stack([sum(move * one[name] for name, move in moves.items()) for one in by_name], axis=-1)
            if variable not in slopes:
                slopes[variable] = np.zeros((starts[-1], len(view), several))
            slopes[variable][starts[number] : starts[number + 1]] = of_term
    return {
        variable: np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        for variable, values in slopes.items()
        if variable not in refused and any(of_variables[variable])
    }


def _moves(surface: Surface, variable: int, x: Array, numbers: list[dict[str, float]]) -> list[dict[str, float]]:
    """Return the derivatives of the parameters of each term by a shape variable; empty where a term has no part in it.

    All are empty for the variables in the place of n and k if k is 0: it begins there like a square root.
    """
    one, owner = surface.shape[variable], surface.owners[variable]
    moves: list[dict[str, float]] = [{} for _ in surface.terms]
    if owner is not None:
        term = surface.terms[owner]
        names = term.tied if term.tied and one.name == term.tied[0] else (one.name,)
        moves[owner] = dict.fromkeys(names, one.slope(float(x[variable])))
        return moves
    labels = [member.name for member in surface.shape]
    ends = {name: surface.shape[labels.index(name)].value(float(x[labels.index(name)])) for name in (NORMAL, EDGE)}
    for number, term in enumerate(surface.terms):
        if term.spec.spectral and numbers[number]["k"] > 0.0:
            n_slope, k_slope = index_slopes(ends[NORMAL], ends[EDGE])[0 if one.name == NORMAL else 1]
            moves[number] = {"n": n_slope * one.slope(0.5), "k": k_slope * one.slope(0.5)}
    return moves


def _term_slopes(term: Term, view: InstrumentView, given: Mapping[str, float], names: set[str]) -> dict[str, Floats]:
    """Return the derivatives (M, N) [1/sr] of the factors of a term by some of its parameters."""
    assert term.spec.gradient is not None
    model, ordered = term.spec.gradient, sorted(names)
    arguments, count = columns([{**given, **node} for node in term.nodes]), len(term.nodes)
    width = term.widths([given]) if view.half_angle else None

    def derivatives(wi: Floats, wr: Floats) -> Floats:
        by = model(wi, wr, **arguments).derivatives
        return np.concatenate([np.broadcast_to(by[name], (count, len(wi))) for name in ordered]).T

    with np.errstate(all="ignore"):  # extreme parameters may raise flags
        seen = view.mean(derivatives, None if width is None else float(width[0])).T
    values = seen.reshape(len(ordered), count, len(view))
    return dict(zip(ordered, values if term.scaled else term.polynomial.parts(values), strict=True))
