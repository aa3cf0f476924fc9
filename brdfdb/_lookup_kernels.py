"""The inside of lookups: from directions to points on a grid, through the interpolation, to values of f_r.

All work in blocks of directions, step by step, so that each step is a short loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import BLOCK, arcsin, cosine, exp
from brdfdb._numba import kernel, loop
from brdfdb.interpolation import Axes, locate, tricubic, trilinear, weighted

Array = NDArray[np.float64]

PI = np.pi
TURN = 2.0 * np.pi
HALF_PI = np.pi / 2.0
PHI_MAX = 1e15


class Rule(NamedTuple):
    """How numbers on a grid become f_r.

    Attributes
    ----------
    half_difference : bool
        Whether the axes are those of half and difference vectors.
    copies : int
        How many times the azimuth of an anisotropic grid goes into a full turn: 1, 2 or 4.
    logarithm : bool
        Whether the numbers are logarithms, ...
    offset : float
        ... of values to which this was added.
    power : float
        What was tabulated is f_r times (cos theta_i cos theta_r) to this power.
    overshoots : bool
        Whether what is interpolated may fall below 0 where no node is: it is 0 there.
    """

    half_difference: bool
    copies: int
    logarithm: bool
    offset: float
    power: float
    overshoots: bool


@kernel
def angle(y: float, x: float) -> float:
    """atan2(y, x) of a point in the first quadrant, the axes included; 0 at the origin."""
    length = np.sqrt(x * x + y * y)
    a = arcsin(min(x, y) / (length if length > 0.0 else 1.0))
    return float(HALF_PI - a if y > x else a)


@kernel
def _full_turn(y: float, x: float) -> float:
    """atan2(y, x) in [0, 2 pi)."""
    a = angle(abs(y), abs(x))
    a = PI - a if x < 0.0 else a
    return TURN - a if y < 0.0 and a > 0.0 else a


@kernel
def _folded(phi: float, period: float) -> float:
    """An azimuth in [0, period]."""
    return float(phi - np.floor(phi * (1.0 / period)) * period)


@kernel
def _turned(phi: float, other: float, copies: int) -> tuple[float, float]:
    """Two azimuths after the symmetries of the surface brought the first into its part of the turn.

    Half a turn of the surface moves both by pi, the mirror changes the sign of both.
    """
    phi = _folded(phi, TURN)
    if copies > 1 and phi >= PI:
        phi, other = phi - PI, other - PI
    if copies == 4 and phi > HALF_PI:  # mirrored in y: pi - phi
        phi, other = PI - phi, PI - other
    return phi, other


@kernel
def _halved(phi_h: float, phi_d: float, copies: int) -> tuple[float, float]:
    """The azimuths of half and difference vector after the symmetries of the surface and reciprocity.

    Half a turn of the surface moves phi_h alone, the mirror changes the sign of both.
    """
    if copies > 1 and phi_h >= PI:
        phi_h -= PI
    if copies == 4 and phi_h > HALF_PI:
        phi_h, phi_d = PI - phi_h, -phi_d
    return phi_h, _folded(phi_d, PI)


@loop
def points_of_angles(
    rule: Rule, theta_i: Array, phi_i: Array, theta_r: Array, phi_r: Array, start: int, count: int, x: Array, mu: Array
) -> None:
    """Points on a grid of light and viewer, and mu = cos theta_i cos theta_r, which is needed of some rules only."""
    if x.shape[0] == 3:
        for j in range(count):
            d = np.float64(phi_r[start + j]) - np.float64(phi_i[start + j])
            d -= np.floor(d * (1.0 / TURN) + 0.5) * TURN
            x[0, j] = theta_i[start + j]
            x[1, j] = theta_r[start + j]
            x[2, j] = abs(d)
    else:
        for j in range(count):
            phi, other = _turned(np.float64(phi_i[start + j]), np.float64(phi_r[start + j]), rule.copies)
            x[0, j] = theta_i[start + j]
            x[1, j] = phi
            x[2, j] = theta_r[start + j]
            x[3, j] = _folded(other, TURN)
    if rule.power != 0.0:
        for j in range(count):
            mu[j] = cosine(np.cos(np.float64(theta_i[start + j]))) * cosine(np.cos(np.float64(theta_r[start + j])))


@loop
def points_of_vectors(
    rule: Rule, wi: Array, wr: Array, start: int, count: int, x: Array, mu: Array, scratch: Array
) -> None:
    """Points on either kind of grid, of unit vectors in flat arrays, and mu = cos theta_i cos theta_r."""
    axes = x.shape[0]
    ui, ur = wi[3 * start :], wr[3 * start :]
    for j in range(count):
        mu[j] = cosine(np.float64(ui[3 * j + 2])) * cosine(np.float64(ur[3 * j + 2]))
    if rule.half_difference:
        along, across = scratch[0], scratch[1]  # of the difference vector, about the half vector
        for j in range(count):
            x_i, y_i, z_i = np.float64(ui[3 * j]), np.float64(ui[3 * j + 1]), np.float64(ui[3 * j + 2])
            x_r, y_r, z_r = np.float64(ur[3 * j]), np.float64(ur[3 * j + 1]), np.float64(ur[3 * j + 2])
            h_x, h_y, h_z = x_i + x_r, y_i + y_r, z_i + z_r
            d_x, d_y, d_z = x_i - x_r, y_i - y_r, z_i - z_r
            flat = np.sqrt(h_x * h_x + h_y * h_y)
            h = np.sqrt(flat * flat + h_z * h_z)
            d = np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
            pole = flat < 1e-14 * h
            e_x = 1.0 if pole else h_x / (1.0 if pole else flat)
            e_y = 0.0 if pole else h_y / (1.0 if pole else flat)
            whole = h if h > 0.0 else 1.0
            # the frame of the half vector: along theta_h, and along phi_h
            along[j] = (d_x * e_x + d_y * e_y) * (h_z / whole) - d_z * (flat / whole)
            across[j] = d_y * e_x - d_x * e_y
            x[0, j] = angle(flat, abs(h_z))
            x[axes - 2, j] = angle(d, h)
            if axes == 4:
                x[1, j] = h_x
                x[3, j] = h_y
        if axes == 3:
            for j in range(count):
                x[2, j] = angle(abs(across[j]), abs(along[j]))
        else:
            for j in range(count):
                phi_h = 0.0 if abs(x[1, j]) + abs(x[3, j]) < 1e-14 else _full_turn(x[3, j], x[1, j])
                x[1, j], x[3, j] = _halved(phi_h, _full_turn(across[j], along[j]), rule.copies)
        return
    for j in range(count):
        x_i, y_i, z_i = np.float64(ui[3 * j]), np.float64(ui[3 * j + 1]), np.float64(ui[3 * j + 2])
        x_r, y_r, z_r = np.float64(ur[3 * j]), np.float64(ur[3 * j + 1]), np.float64(ur[3 * j + 2])
        theta_i = angle(np.sqrt(x_i * x_i + y_i * y_i), abs(z_i))
        theta_r = angle(np.sqrt(x_r * x_r + y_r * y_r), abs(z_r))
        x[0, j] = theta_i
        if axes == 3:
            dot, cross = x_i * x_r + y_i * y_r, x_i * y_r - y_i * x_r
            turn = angle(abs(cross), abs(dot))
            x[1, j] = theta_r
            x[2, j] = PI - turn if dot < 0.0 else turn
        else:
            phi, other = _turned(_full_turn(y_i, x_i), _full_turn(y_r, x_r), rule.copies)
            x[1, j] = phi
            x[2, j] = theta_r
            x[3, j] = _folded(other, TURN)


@loop
def interpolated(axes: Axes, table: NDArray[np.float32], channels: int, x: Array, count: int, numbers: Array) -> None:
    """What a table holds at points on its grid: `channels` numbers a point, point after point."""
    cell, share = np.empty((x.shape[0], BLOCK), np.int64), np.empty((x.shape[0], BLOCK))
    for axis in range(x.shape[0]):
        locate(axes, axis, x[axis], count, cell[axis], share[axis])
    if channels == 1 and x.shape[0] == 3 and axes.width.sum() == 6:
        trilinear(axes, cell, share, count, table, numbers)
    elif channels == 1 and x.shape[0] == 3 and axes.width.sum() == 12:
        tricubic(axes, cell, share, count, table, numbers)
    else:
        weighted(axes, cell, share, count, table, channels, numbers)


@loop
def finished(
    rule: Rule,
    numbers: Array,
    channels: int,
    mu: Array,
    spectra: Array,
    uniform: Array,
    low: NDArray[np.int64],
    weight: Array,
    start: int,
    count: int,
    out: Array,
) -> None:
    """f_r at the wavelengths asked for, point after point, from what was interpolated.

    `spectra` of shape (channels, L) says how the channels make up L wavelengths, of shape (0, 0) that they are them.
    """
    if rule.power == 0.5:
        for j in range(count):
            mu[j] = 1.0 / np.sqrt(mu[j])
    elif rule.power == 1.0:
        for j in range(count):
            mu[j] = 1.0 / mu[j]
    else:
        for j in range(count):
            mu[j] = 1.0
    if channels == 1 and low.size == 1 and spectra.size == 0:
        if rule.logarithm:
            for j in range(count):
                numbers[j] = exp(numbers[j]) - rule.offset
        if rule.overshoots:
            for j in range(count):
                value = numbers[j]
                numbers[j] = 0.0 if value < 0.0 else value  # nan stays nan
        for j in range(count):
            out[start + j] = numbers[j] * mu[j] + uniform[0]
        return
    wavelengths = low.size
    for m in range(wavelengths):
        for side in range(2 if weight[m] > 0.0 else 1):
            w = low[m] + side
            part = weight[m] if side == 1 else 1.0 - weight[m]
            for j in range(count):
                value = 0.0
                if spectra.size > 0:
                    for channel in range(channels):
                        value += numbers[j * channels + channel] * spectra[channel, w]
                else:
                    value = numbers[j * channels + w]
                value = exp(value) - rule.offset if rule.logarithm else value
                value = 0.0 if rule.overshoots and value < 0.0 else value  # nan stays nan
                value = part * (value * mu[j] + uniform[w])
                at = (start + j) * wavelengths + m
                out[at] = value if side == 0 else out[at] + value


@kernel
def by_angles(
    rule: Rule,
    axes: Axes,
    table: NDArray[np.float32],
    channels: int,
    spectra: Array,
    uniform: Array,
    low: NDArray[np.int64],
    weight: Array,
    theta_i: Array,
    phi_i: Array,
    theta_r: Array,
    phi_r: Array,
    horizon: float,
    out: Array,
) -> bool:
    """f_r of directions by angles [rad] on a grid of light and viewer; False where an angle is not what it may be."""
    x, mu = np.empty((axes.counts.size, BLOCK)), np.empty(BLOCK)
    numbers = np.empty(BLOCK * channels)
    good = True
    for start in range(0, theta_i.size, BLOCK):
        count = min(BLOCK, theta_i.size - start)
        points_of_angles(rule, theta_i, phi_i, theta_r, phi_r, start, count, x, mu)
        interpolated(axes, table, channels, x, count, numbers)
        finished(rule, numbers, channels, mu, spectra, uniform, low, weight, start, count, out)
        odd = 0
        for j in range(count):
            t_i, t_r, p_i, p_r = theta_i[start + j], theta_r[start + j], phi_i[start + j], phi_r[start + j]
            usual = (t_i >= 0.0) & (t_i <= horizon) & (t_r >= 0.0) & (t_r <= horizon)
            odd += int(not (usual & (abs(p_i) <= PHI_MAX) & (abs(p_r) <= PHI_MAX)))
        if odd > 0:
            for j in range(count):
                t_i, t_r, p_i, p_r = theta_i[start + j], theta_r[start + j], phi_i[start + j], phi_r[start + j]
                bad = t_i < 0.0 or t_i > PI or t_r < 0.0 or t_r > PI or abs(p_i) > PHI_MAX or abs(p_r) > PHI_MAX
                good = good and not bad
                _outside(t_i + t_r + p_i + p_r, t_i > horizon or t_r > horizon, start + j, low.size, out)
    return good


@kernel
def _outside(direction: float, below: bool, point: int, wavelengths: int, out: Array) -> None:
    """nan where a direction is nan, 0 below the horizon."""
    if below or direction != direction:
        for m in range(wavelengths):
            out[point * wavelengths + m] = np.nan if direction != direction else 0.0


@kernel
def by_vectors(
    rule: Rule,
    axes: Axes,
    table: NDArray[np.float32],
    channels: int,
    spectra: Array,
    uniform: Array,
    low: NDArray[np.int64],
    weight: Array,
    wi: Array,
    wr: Array,
    out: Array,
) -> None:
    """f_r of directions by unit vectors, flat arrays of three numbers each, on either kind of grid."""
    x, mu, scratch = np.empty((axes.counts.size, BLOCK)), np.empty(BLOCK), np.empty((2, BLOCK))
    numbers = np.empty(BLOCK * channels)
    points = wi.size // 3
    for start in range(0, points, BLOCK):
        count = min(BLOCK, points - start)
        points_of_vectors(rule, wi, wr, start, count, x, mu, scratch)
        interpolated(axes, table, channels, x, count, numbers)
        finished(rule, numbers, channels, mu, spectra, uniform, low, weight, start, count, out)
        ui, ur = wi[3 * start :], wr[3 * start :]
        odd = 0
        for j in range(count):
            flat = abs(ui[3 * j]) + abs(ui[3 * j + 1]) + abs(ur[3 * j]) + abs(ur[3 * j + 1])
            odd += int(not ((ui[3 * j + 2] >= 0.0) & (ur[3 * j + 2] >= 0.0) & (flat < PHI_MAX)))
        if odd > 0:
            for j in range(count):
                direction = ui[3 * j] + ui[3 * j + 1] + ui[3 * j + 2] + ur[3 * j] + ur[3 * j + 1] + ur[3 * j + 2]
                _outside(direction, ui[3 * j + 2] < 0.0 or ur[3 * j + 2] < 0.0, start + j, low.size, out)
