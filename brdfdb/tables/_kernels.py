"""Kernels of lookups: from directions through their coordinates and the interpolation to values of f_r.

Each kernel works on a block of directions, one short loop after another, so that loops vectorise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import exp
from brdfdb._numba import inner_loop, kernel, loop
from brdfdb.parameters import Array
from brdfdb.tables._coordinates import PI, Rule, points_of_angles, points_of_vectors, vectors_of_angles
from brdfdb.tables._interpolation import POINTS, Axes, interpolated, room

PHI_USUAL = 4.0 * PI


@kernel
def _invert(power: float, mu: Array, count: int) -> None:
    """Replace mu by mu**-power; the power is 0, 0.5 or 1."""
    if power == 0.5:
        for j in range(count):
            mu[j] = 1.0 / np.sqrt(mu[j])
    elif power == 1.0:
        for j in range(count):
            mu[j] = 1.0 / mu[j]
    else:
        for j in range(count):
            mu[j] = 1.0


@kernel
def _add_f_r(
    rule: Rule, numbers: Array, channels: int, spectra: Array, wavelength: int, weight: float, count: int, total: Array
) -> None:
    """Add f_r at one of the wavelengths of the table, times its weight, to the total of each point."""
    for j in range(count):
        value = 0.0
        if spectra.size > 0:
            for channel in range(channels):
                value += numbers[j * channels + channel] * spectra[channel, wavelength]
        else:
            value = numbers[j * channels + wavelength]
        value = exp(value) - rule.offset if rule.logarithm else value
        total[j] += weight * (0.0 if rule.overshoots and value < 0.0 else value)  # nan stays nan


@inner_loop
def finished(
    rule: Rule,
    numbers: Array,
    channels: int,
    mu: Array,
    spectra: Array,
    uniform: Array,
    nodes: NDArray[np.int64],
    weight: Array,
    count: int,
    out: Array,
) -> None:
    """Write f_r [1/sr] at the wavelengths asked for, point after point, from what was interpolated over the angles.

    `spectra` of shape (channels, L) says how the channels make up L wavelengths: as numbers, or as f_r if the rule is
    mixed. If it is empty, the channels are the wavelengths. `nodes` and `weight`, of shape (wavelengths, 4), say which
    of the L count: between them the numbers that are stored are interpolated, or f_r if the rule is straight.
    """
    wavelengths = nodes.shape[0]
    single = channels == 1 and wavelengths == 1 and spectra.size == 0
    if rule.power != 0.0 or not single:
        _invert(rule.power, mu, count)
    if single:
        if rule.logarithm:
            for j in range(count):
                numbers[j] = exp(numbers[j]) - rule.offset
        if rule.overshoots:
            for j in range(count):
                value = numbers[j]
                numbers[j] = 0.0 if value < 0.0 else value  # nan stays nan
        if rule.power == 0.0:
            for j in range(count):
                out[j] = numbers[j] + uniform[0]
        else:
            for j in range(count):
                out[j] = numbers[j] * mu[j] + uniform[0]
        return
    if rule.mixed:
        for j in range(count * channels):
            value = numbers[j]
            value = exp(value) - rule.offset if rule.logarithm else value
            numbers[j] = 0.0 if rule.overshoots and value < 0.0 else value  # nan stays nan
    total, column = np.empty(count), np.empty(channels)
    for m in range(wavelengths):
        apart, lowest, overshoots = 0.0, 0.0, True
        for side in range(4):
            stored = uniform[nodes[m, side]]
            apart += weight[m, side] * stored
            lowest = stored if stored < lowest else lowest
            overshoots = overshoots and weight[m, side] != 1.0  # on a node nothing is interpolated
        apart = lowest if overshoots and apart < lowest else apart
        overshoots = overshoots or rule.overshoots or rule.mixed
        for j in range(count):
            total[j] = 0.0
        if rule.straight and not rule.mixed:
            for side in range(4):
                if weight[m, side] != 0.0:
                    _add_f_r(rule, numbers, channels, spectra, nodes[m, side], weight[m, side], count, total)
        elif spectra.size > 0:
            for channel in range(channels):
                column[channel] = 0.0
                for side in range(4):
                    column[channel] += weight[m, side] * spectra[channel, nodes[m, side]]
            for j in range(count):
                for channel in range(channels):
                    total[j] += numbers[j * channels + channel] * column[channel]
        else:
            for side in range(4):
                part, w = weight[m, side], nodes[m, side]
                if part != 0.0:  # what does not count may be nan
                    for j in range(count):
                        total[j] += part * numbers[j * channels + w]
        if rule.logarithm and not rule.mixed and not rule.straight:
            for j in range(count):
                total[j] = exp(total[j]) - rule.offset
        for j in range(count):
            value = 0.0 if overshoots and total[j] < 0.0 else total[j]  # nan stays nan
            out[j * wavelengths + m] = value * mu[j] + apart


@loop
def by_angles(
    rule: Rule,
    axes: Axes,
    table: NDArray[np.float32],
    channels: int,
    spectra: Array,
    uniform: Array,
    nodes: NDArray[np.int64],
    weight: Array,
    theta_i: Array,
    phi_i: Array,
    theta_r: Array,
    phi_r: Array,
    horizon: float,
    out: Array,
) -> bool:
    """Write f_r [1/sr] of directions by angles [rad].

    Return False if a polar angle is out of range, or an azimuth has more than two turns.
    """
    most = room(theta_i.size)
    x, mu, scratch = np.empty((axes.counts.size, most)), np.empty(most), np.empty((6, most))
    wi, wr = np.empty(3 * most), np.empty(3 * most)
    numbers, cell = np.empty(most * channels), np.empty(x.shape, np.int32)
    wavelengths = nodes.shape[0]
    good = True
    for start in range(0, theta_i.size, POINTS):
        count = min(POINTS, theta_i.size - start)
        block = slice(start, start + count)  # an index that starts at 0 is known not to be negative: loops vectorise
        t_i, p_i, t_r, p_r = theta_i[block], phi_i[block], theta_r[block], phi_r[block]
        f_r = out[start * wavelengths : (start + count) * wavelengths]
        if rule.half_difference:
            vectors_of_angles(t_i, p_i, count, wi)
            vectors_of_angles(t_r, p_r, count, wr)
            points_of_vectors(rule, wi, wr, count, x, mu, scratch)
        else:
            points_of_angles(rule, t_i, p_i, t_r, p_r, count, x, mu)
        interpolated(axes, table, channels, x, count, numbers, cell)
        finished(rule, numbers, channels, mu, spectra, uniform, nodes, weight, count, f_r)
        odd = 0
        for j in range(count):
            usual = (t_i[j] >= 0.0) & (t_i[j] <= horizon) & (t_r[j] >= 0.0) & (t_r[j] <= horizon)
            odd += int(not (usual & (abs(p_i[j]) <= PHI_USUAL) & (abs(p_r[j]) <= PHI_USUAL)))
        if odd > 0:
            for j in range(count):
                bad = t_i[j] < 0.0 or t_i[j] > PI or t_r[j] < 0.0 or t_r[j] > PI
                good = good and not (bad or abs(p_i[j]) > PHI_USUAL or abs(p_r[j]) > PHI_USUAL)
                below = t_i[j] > horizon or t_r[j] > horizon
                _outside(t_i[j] + t_r[j] + p_i[j] + p_r[j], below, j, wavelengths, f_r)
    return good


@kernel
def _outside(direction: float, below: bool, point: int, wavelengths: int, out: Array) -> None:
    """Write nan if a direction is nan, 0 if it is below the horizon."""
    if below or direction != direction:
        for m in range(wavelengths):
            out[point * wavelengths + m] = np.nan if direction != direction else 0.0


@loop
def by_vectors(
    rule: Rule,
    axes: Axes,
    table: NDArray[np.float32],
    channels: int,
    spectra: Array,
    uniform: Array,
    nodes: NDArray[np.int64],
    weight: Array,
    wi: Array,
    wr: Array,
    out: Array,
) -> None:
    """Write f_r [1/sr] of directions by unit vectors, flat arrays of three numbers each, on either kind of grid."""
    points, wavelengths = wi.size // 3, nodes.shape[0]
    most = room(points)
    x, mu, scratch = np.empty((axes.counts.size, most)), np.empty(most), np.empty((6, most))
    numbers, cell = np.empty(most * channels), np.empty(x.shape, np.int32)
    for start in range(0, points, POINTS):
        count = min(POINTS, points - start)
        ui, ur = wi[3 * start : 3 * (start + count)], wr[3 * start : 3 * (start + count)]
        f_r = out[start * wavelengths : (start + count) * wavelengths]
        points_of_vectors(rule, ui, ur, count, x, mu, scratch)
        interpolated(axes, table, channels, x, count, numbers, cell)
        finished(rule, numbers, channels, mu, spectra, uniform, nodes, weight, count, f_r)
        odd = 0
        for j in range(count):
            odd += int(not scratch[5, j] >= 0.0)
        if odd > 0:
            for j in range(count):
                direction = ui[3 * j] + ui[3 * j + 1] + ui[3 * j + 2] + ur[3 * j] + ur[3 * j + 1] + ur[3 * j + 2]
                _outside(direction, ui[3 * j + 2] < 0.0 or ur[3 * j + 2] < 0.0, j, wavelengths, f_r)


@loop
def specular(
    theta_nodes: Array,
    rows: NDArray[np.float32],
    nodes: NDArray[np.int64],
    weight: Array,
    theta: Array,
    horizon: float,
    out: Array,
) -> bool:
    """Write the specular part [1], linear between its nodes `theta_nodes` [rad]; else as `by_angles`.

    `out` stays as it is if there are no nodes.
    """
    wavelengths = nodes.shape[0]
    last = theta_nodes.size - 1
    good = True
    for j in range(theta.size):
        t = theta[j]
        good = good and not (t < 0.0 or t > PI)
        if last > 0:
            below, above = 0, last
            while above - below > 1:
                middle = (below + above) // 2
                if theta_nodes[middle] <= t:
                    below = middle
                else:
                    above = middle
            part = (t - theta_nodes[below]) / (theta_nodes[above] - theta_nodes[below])
            part = min(max(part, 0.0), 1.0)
            for m in range(wavelengths):
                value = 0.0
                for side in range(4):
                    w = nodes[m, side]
                    if weight[m, side] != 0.0:
                        value += weight[m, side] * ((1.0 - part) * rows[below, w] + part * rows[above, w])
                out[j * wavelengths + m] = 0.0 if value < 0.0 else value
        _outside(t, t > horizon, j, wavelengths, out)
    return good
