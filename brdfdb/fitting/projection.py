"""The best coefficients of a surface whose shape is given: a bounded least-squares problem for each channel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.residuals import Residual
from brdfdb.fitting.surface import Surface, total
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

MOST, _FEW = 60, 6  # steps at most, of a descent and of a trial
FINE, COARSE = 1e-10, 1e-3  # changes of the cost, relative to it, that end the steps: of a descent, and of a trial
_EDGE = 1e-12  # share of a range within which a coefficient is at its end
_FIRST_DAMPING, _LEAST_DAMPING = 1e-4, 1e-10  # two lobes that are the same make a singular matrix


def cost_of(residuals: Floats, scale: float) -> Floats:
    """Return half of the sum (C,) over rows of s^2 rho((r / s)^2), rho(z) = 2 (sqrt(1 + z) - 1)."""
    z = (residuals / scale) ** 2
    return np.asarray(scale**2 * np.sum(np.sqrt(1.0 + z) - 1.0, axis=0))


def project(
    surface: Surface,
    basis: Floats,
    residual: Residual,
    scale: float,
    bounds: tuple[Array, Array],
    start: Array,
    tolerance: float = FINE,
) -> Array:
    """Return the coefficients (K, C) that make the robust cost of residuals least, between bounds.

    Parameters
    ----------
    surface : Surface
        The surface.
    basis : array (M, N, C) or (M, N, 1) [1/sr]
        Factors of its monomials, as `Surface.basis` gives them.
    residual : Residual
        The residual of N samples in C channels.
    scale : float
        The size of a residual from which on it counts less than squared.
    bounds : pair of arrays (K, C)
        Lower and upper bounds; where they are the same, the coefficient is fixed.
    start : array (K, C)
        Where to begin.
    tolerance : float
        Change of the cost, relative to it, that ends the steps.

    Notes
    -----
    Gauss and Newton's steps with Levenberg's damping. A coefficient at a bound that would leave the range stays there.
    Channels are independent, and each has a damping of its own.
    """
    low, high = bounds
    values = np.clip(start, low, high)
    if not len(values):
        return values
    span = np.where(high > low, high - low, 1.0)
    f_r = total(basis, surface.monomials(values))
    residuals = residual.of(f_r)
    cost = cost_of(residuals, scale)
    damping = np.full(cost.shape, _FIRST_DAMPING)
    diagonal = np.arange(len(values))
    for _ in range(MOST if tolerance < COARSE else _FEW):
        jacobian = slopes_of(surface, basis, values) * residual.slope(f_r)
        weights = 1.0 / np.sqrt(1.0 + (residuals / scale) ** 2)
        columns = np.ascontiguousarray(jacobian.transpose(2, 0, 1))  # (C, K, N): products of matrices are quick
        weighted = columns * weights.T[:, np.newaxis, :]
        gradient = np.einsum("ckn,cn->ck", weighted, residuals.T)
        normal = weighted @ columns.transpose(0, 2, 1)
        stays = ((values <= low + _EDGE * span) & (gradient.T > 0.0)) | (
            (values >= high - _EDGE * span) & (gradient.T < 0.0)
        )
        stays |= high <= low
        size = np.sqrt(np.maximum(normal[:, diagonal, diagonal], 1e-300))
        normal = normal / (size[:, :, np.newaxis] * size[:, np.newaxis, :])
        normal = np.where(stays.T[:, :, np.newaxis] | stays.T[:, np.newaxis, :], 0.0, normal)
        normal[:, diagonal, diagonal] = 1.0 + damping[:, np.newaxis]
        step = np.linalg.solve(normal, np.where(stays.T, 0.0, gradient / size)[..., np.newaxis])[..., 0] / size
        tried = np.clip(values - step.T, low, high)
        f_tried = total(basis, surface.monomials(tried))
        r_tried = residual.of(f_tried)
        cost_tried = cost_of(r_tried, scale)
        better = cost_tried <= cost
        gain = np.where(better, cost - cost_tried, 0.0)
        done = np.where(better, gain <= tolerance * cost, damping > 1e8)
        values = np.where(better, tried, values)
        f_r, residuals = np.where(better, f_tried, f_r), np.where(better, r_tried, residuals)
        cost = np.where(better, cost_tried, cost)
        damping = np.where(better, np.maximum(0.1 * damping, _LEAST_DAMPING), 10.0 * np.maximum(damping, 1e-6))
        if np.all(done):
            break
    return values


def slopes_of(surface: Surface, basis: Floats, values: Array) -> Floats:
    """Return the derivatives (K, N, C) [1/sr] of f_r by each coefficient (K, C)."""
    slopes = surface.slopes(values)
    if basis.shape[2] == 1:
        return np.asarray(np.einsum("mn,kmc->knc", basis[:, :, 0], slopes))
    return np.asarray(np.einsum("mnc,kmc->knc", basis, slopes))
