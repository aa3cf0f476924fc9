"""Evaluation of a model at several wavelengths; one that is a polynomial in its reflectances takes a few calls."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials.source import Evaluate
from brdfdb.parameters import Floats, ModelSpec


def evaluations(
    spec: ModelSpec, arguments: Mapping[str, Any], count: int, degree: int | None
) -> tuple[list[dict[str, Any]], NDArray[np.float64] | None]:
    """Return the arguments to evaluate a model at, and the weights that make the values at all wavelengths.

    Parameters
    ----------
    spec : ModelSpec
        A model that takes no wavelength itself.
    arguments : mapping
        Its arguments: numbers, or arrays (L,) of reflectances.
    count : int
        Number of wavelengths, L.
    degree : int or None
        Degree of f_r as a polynomial in the reflectances; None: it is none.

    Returns
    -------
    list of dict
        E sets of arguments, all numbers.
    array (E, L) or None
        f_r at each wavelength is the sum of the E values times a column. None: there is a set for each wavelength.
    """
    spectra = {name: np.asarray(value) for name, value in arguments.items() if np.ndim(value)}
    numbers = {name: value for name, value in arguments.items() if name not in spectra}
    if not spectra:
        return [numbers], np.ones((1, count))
    low = {name: spec.parameter(name).low for name in spectra}
    high = {name: spec.parameter(name).high for name in spectra}
    share = {name: (value - low[name]) / (high[name] - low[name]) for name, value in spectra.items()}
    if degree == 1 and count > len(spectra) + 1:
        corners = [numbers | low, *(numbers | low | {name: high[name]} for name in spectra)]
        return corners, np.stack([1.0 - sum(share.values()), *share.values()])
    pairs = list(itertools.combinations_with_replacement(range(len(spectra) + 1), 2))
    if degree == 2 and count > len(pairs):
        # Lagrange's polynomials through the corners of the simplex and the middles between them
        names, corner = [*spectra], np.eye(len(spectra) + 1)[:, 1:]
        middles = [dict(zip(names, 0.5 * (corner[a] + corner[b]), strict=True)) for a, b in pairs]
        sets = [numbers | {name: low[name] + m[name] * (high[name] - low[name]) for name in names} for m in middles]
        s = np.stack([1.0 - sum(share.values()), *share.values()])
        weights = [s[a] * (2.0 * s[a] - 1.0) if a == b else 4.0 * s[a] * s[b] for a, b in pairs]
        return sets, np.stack(weights)
    return [numbers | {name: value[w] for name, value in spectra.items()} for w in range(count)], None


def each(arguments: Mapping[str, Any], count: int) -> list[dict[str, Any]]:
    """Return the arguments of a model at each of `count` wavelengths."""
    return [{name: value[w] if np.ndim(value) else value for name, value in arguments.items()} for w in range(count)]


def summed(f_r: Callable[..., Floats], sets: list[dict[str, Any]], weights: NDArray[np.float64] | None) -> Evaluate:
    """Return a function of directions whose values are weighted sums of those at some sets of arguments."""

    def brdf(wi: Floats, wr: Floats) -> Floats:
        values = np.stack([f_r(wi, wr, **arguments) for arguments in sets], axis=-1)
        # a BLAS sums in an order that depends on where a row stands: what was symmetric would not stay it
        return values if weights is None else np.einsum("...e,el->...l", values, weights)

    return brdf
