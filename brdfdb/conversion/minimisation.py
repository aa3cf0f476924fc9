"""Minimisation of a function of a few bounded variables: simplexes that go downhill."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], float]

_EXTENT = 100.0  # size of the last simplex, relative to the tolerance of its values
_NOTHING = 0.01  # value below which differences are relative to this one: there is hardly anything to gain


def downhill(
    function: Function, begin: Array, size: Array, *, tolerance: float = 1e-7, most: int = 400
) -> tuple[Array, float]:
    """Return a minimum of a function in the unit cube, and its value, by the simplex of Nelder and Mead 1965.

    Parameters
    ----------
    function : callable
        A function of an array (variables,) in [0, 1].
    begin : array (variables,)
        The first corner of the simplex.
    size : array (variables,)
        Lengths of its edges.
    tolerance : float
        The search stops when values at the corners differ by less than this, relative to the value at the beginning,
        or to a hundredth if that is more, and the corners by less than a hundred times as much: corners on both sides
        of a minimum may share a value.
    most : int
        Number of evaluations at which the search stops.

    Returns
    -------
    array (variables,), float
        The best corner and its value.

    Notes
    -----
    Corners outside the cube are moved to its surface. No gradient is needed: the integral of an absolute difference has
    none where the difference is 0 over a region.

    References
    ----------
    neldermead1965
    """
    from scipy.optimize import minimize

    close = tolerance * max(abs(function(begin)), _NOTHING)
    limits = {"fatol": close, "xatol": _EXTENT * tolerance, "maxfev": most}
    best, value = begin, np.inf
    for _ in range(2):  # again, because a simplex collapses on the surface of the cube
        towards = np.where(best <= 0.5, size, -size)  # the side with more room
        corners = np.clip(np.vstack([best, best + np.diag(towards)]), 0.0, 1.0)
        options = {"initial_simplex": corners, **limits}
        end = minimize(function, best, method="Nelder-Mead", bounds=[(0.0, 1.0)] * begin.size, options=options)
        if end.fun < value:
            best, value = np.asarray(end.x), float(end.fun)
    return best, value
