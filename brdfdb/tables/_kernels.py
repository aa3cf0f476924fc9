"""Kernels of lookups: from directions to points on a grid, through the interpolation, to values of f_r.

Each kernel works on a block of directions, one short loop after another, so that loops vectorise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import arcsin, cos, cosine, exp, sine
from brdfdb._numba import kernel, loop
from brdfdb.tables._interpolation import POINTS, Axes, interpolated

Array = NDArray[np.float64]

PI, TURN, HALF_PI, PHI_MAX = np.pi, 2.0 * np.pi, np.pi / 2.0, 1e15


class Rule(NamedTuple):
    """The way from numbers on a grid to f_r.

    `half_difference` is True for the axes of half and difference vectors. If `reciprocal` is True, their phi_d stands
    for light and viewer exchanged, too. `copies` is the number of times that the
    azimuth of an anisotropic grid goes into a full turn: 1, 2 or 4. Numbers are logarithms if `logarithm` is True;
    `offset` was added to values before, which had been multiplied by cos theta_i cos theta_r to the `power`.
    Interpolated values below 0 are set to 0 if `overshoots` is True. Spectra mix f_r of the channels if `mixed` is
    True, else numbers.
    """

    half_difference: bool
    reciprocal: bool
    copies: int
    logarithm: bool
    offset: float
    power: float
    overshoots: bool
    mixed: bool


@kernel
def angle(y: float, x: float) -> float:
    """Return atan2(y, x) [rad] of a point in the first quadrant, the axes included; 0 at the origin."""
    length = np.sqrt(x * x + y * y)
    a = arcsin(min(x, y) / (length if length > 0.0 else 1.0))
    return float(HALF_PI - a if y > x else a)


@kernel
def _full_turn(y: float, x: float) -> float:
    """Return atan2(y, x) [rad] in [0, 2 pi)."""
    a = angle(abs(y), abs(x))
    a = PI - a if x < 0.0 else a
    return TURN - a if y < 0.0 and a > 0.0 else a


@kernel
def _folded(phi: float, period: float) -> float:
    """Return an azimuth folded into [0, period]."""
    return float(phi - np.floor(phi * (1.0 / period)) * period)


@kernel
def _turned(phi: float, other: float, copies: int) -> tuple[float, float]:
    """Return two azimuths, the first folded into its part of the turn by the symmetries of the surface.

    Half a turn of the surface moves both by pi, the mirror changes the sign of both.
    """
    phi = _folded(phi, TURN)
    if copies > 1 and phi >= PI:
        phi, other = phi - PI, other - PI
    if copies == 4 and phi > HALF_PI:  # mirrored in y: pi - phi
        phi, other = PI - phi, PI - other
    return phi, other


@kernel
def _halved(phi_h: float, phi_d: float, rule: Rule) -> tuple[float, float]:
    """Return the azimuths of half and difference vector after the symmetries of the surface, phi_d in its period.

    Half a turn of the surface moves phi_h alone, the mirror changes the sign of both.
    """
    if rule.copies > 1 and phi_h >= PI:
        phi_h -= PI
    if rule.copies == 4 and phi_h > HALF_PI:
        phi_h, phi_d = PI - phi_h, -phi_d
    return phi_h, _folded(phi_d, PI if rule.reciprocal else TURN)


@loop
def points_of_angles(
    rule: Rule, theta_i: Array, phi_i: Array, theta_r: Array, phi_r: Array, count: int, x: Array, mu: Array
) -> None:
    """Write points on a grid of light and viewer, and mu = cos theta_i cos theta_r if the rule has a power."""
    if x.shape[0] == 3:
        light, viewer, delta_phi = x[0], x[1], x[2]
        for j in range(count):
            d = np.float64(phi_r[j]) - np.float64(phi_i[j])
            d -= np.floor(d * (1.0 / TURN) + 0.5) * TURN
            light[j], viewer[j] = theta_i[j], theta_r[j]
            delta_phi[j] = abs(d)
    else:
        light, light_phi, viewer, viewer_phi = x[0], x[1], x[2], x[3]
        for j in range(count):
            phi, other = _turned(np.float64(phi_i[j]), np.float64(phi_r[j]), rule.copies)
            light[j], light_phi[j], viewer[j] = theta_i[j], phi, theta_r[j]
            viewer_phi[j] = _folded(other, TURN)
    if rule.power != 0.0:
        for j in range(count):
            mu[j] = cosine(cos(np.float64(theta_i[j]))) * cosine(cos(np.float64(theta_r[j])))


@loop
def points_of_vectors(rule: Rule, ui: Array, ur: Array, count: int, x: Array, mu: Array, scratch: Array) -> None:
    """Write points on either kind of grid, of unit vectors in flat arrays, and mu = cos theta_i cos theta_r if the rule
    has a power.

    `scratch` holds six rows; the last gets the lower z, nan where a number of the vectors is nan or infinite. One loop
    for the products and one for each angle: all in one would not vectorise.
    """
    if rule.half_difference:
        theta_h, theta_d, phi_d = x[0], x[x.shape[0] - 2], x[x.shape[0] - 1]
        _half_difference(ui, ur, count, theta_h, theta_d, phi_d, scratch, rule.reciprocal)
        if x.shape[0] == 4:
            along, across, x_h, y_h = scratch[0], scratch[1], scratch[2], scratch[3]
            phi_h = x[1]
            for j in range(count):
                turn = _full_turn(y_h[j], x_h[j])
                phi_h[j], phi_d[j] = _halved(turn, _full_turn(across[j], along[j]), rule)
    elif x.shape[0] == 3:
        _light_and_viewer(ui, ur, count, x[0], x[1], x[2], scratch)
    else:
        light, light_phi, viewer, viewer_phi = x[0], x[1], x[2], x[3]
        for j in range(count):
            total = ui[3 * j] + ui[3 * j + 1] + ur[3 * j] + ur[3 * j + 1]
            scratch[5, j] = _lower(np.float64(ui[3 * j + 2]), np.float64(ur[3 * j + 2]), np.float64(total))
        for j in range(count):
            phi_i, phi_r = _full_turn(ui[3 * j + 1], ui[3 * j]), _full_turn(ur[3 * j + 1], ur[3 * j])
            phi, other = _turned(phi_i, phi_r, rule.copies)
            light[j] = _polar(ui[3 * j], ui[3 * j + 1], ui[3 * j + 2])
            light_phi[j] = phi
            viewer[j] = _polar(ur[3 * j], ur[3 * j + 1], ur[3 * j + 2])
            viewer_phi[j] = _folded(other, TURN)
    if rule.power != 0.0:
        for j in range(count):
            mu[j] = cosine(np.float64(ui[3 * j + 2])) * cosine(np.float64(ur[3 * j + 2]))


@kernel
def _polar(x: float, y: float, z: float) -> float:
    return angle(np.sqrt(x * x + y * y), abs(z))


@kernel
def _lower(z_i: float, z_r: float, others: float) -> float:
    """Return the lower z of two vectors; nan if one is nan, or if what was made of the other numbers is not finite."""
    return float((z_i if z_i < z_r else z_r) + 0.0 * (z_i + z_r + others))


@kernel
def _half_difference(
    ui: Array, ur: Array, count: int, theta_h: Array, theta_d: Array, phi_d: Array, scratch: Array, reciprocal: bool
) -> None:
    """Write theta_h, theta_d, and phi_d in the first quadrant, or in the first two if not `reciprocal`.

    `scratch` gets the difference vector along theta_h and along phi_h, both times one positive number, the half vector,
    and the lower z; where the half vector is not inclined, the frame is that of phi_h = 0.
    """
    along, across, x_h, y_h, z_h, lowest = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5]
    for j in range(count):
        x_i, y_i, z_i = np.float64(ui[3 * j]), np.float64(ui[3 * j + 1]), np.float64(ui[3 * j + 2])
        x_r, y_r, z_r = np.float64(ur[3 * j]), np.float64(ur[3 * j + 1]), np.float64(ur[3 * j + 2])
        h_x, h_y, h_z = x_i + x_r, y_i + y_r, z_i + z_r
        d_x, d_y, d_z = x_i - x_r, y_i - y_r, z_i - z_r
        flat2 = h_x * h_x + h_y * h_y
        h2 = flat2 + h_z * h_z
        pole = flat2 < 1e-28 * h2
        along[j] = d_x if pole else (d_x * h_x + d_y * h_y) * h_z - d_z * flat2
        across[j] = d_y if pole else (d_y * h_x - d_x * h_y) * np.sqrt(h2)
        x_h[j] = 1.0 if pole else h_x
        y_h[j] = 0.0 if pole else h_y
        z_h[j] = abs(h_z)
        theta_h[j], theta_d[j] = np.sqrt(flat2), np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
        lowest[j] = _lower(z_i, z_r, h2 + theta_d[j])
        phi_d[j] = h2
    for j in range(count):
        theta_d[j] = angle(theta_d[j], np.sqrt(phi_d[j]))
    for j in range(count):
        theta_h[j] = angle(theta_h[j], z_h[j])
    for j in range(count):
        a = angle(abs(across[j]), abs(along[j]))
        phi_d[j] = a if reciprocal or along[j] >= 0.0 else PI - a


@kernel
def _light_and_viewer(
    ui: Array, ur: Array, count: int, theta_i: Array, theta_r: Array, delta_phi: Array, scratch: Array
) -> None:
    """Write theta_i, theta_r and delta_phi."""
    dot, cross, z_light, z_viewer, lowest = scratch[0], scratch[1], scratch[2], scratch[3], scratch[5]
    for j in range(count):
        x_i, y_i, z_i = np.float64(ui[3 * j]), np.float64(ui[3 * j + 1]), np.float64(ui[3 * j + 2])
        x_r, y_r, z_r = np.float64(ur[3 * j]), np.float64(ur[3 * j + 1]), np.float64(ur[3 * j + 2])
        dot[j], cross[j] = x_i * x_r + y_i * y_r, x_i * y_r - y_i * x_r
        theta_i[j], theta_r[j] = np.sqrt(x_i * x_i + y_i * y_i), np.sqrt(x_r * x_r + y_r * y_r)
        z_light[j], z_viewer[j] = abs(z_i), abs(z_r)
        lowest[j] = _lower(z_i, z_r, dot[j] + cross[j])
    for j in range(count):
        theta_i[j] = angle(theta_i[j], z_light[j])
    for j in range(count):
        theta_r[j] = angle(theta_r[j], z_viewer[j])
    for j in range(count):
        turn = angle(abs(cross[j]), abs(dot[j]))
        delta_phi[j] = PI - turn if dot[j] < 0.0 else turn


@loop
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
    of the L count: between them the numbers that are stored are interpolated, not f_r.
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
    wavelengths = nodes.shape[0]
    if channels == 1 and wavelengths == 1 and spectra.size == 0:
        if rule.logarithm:
            for j in range(count):
                numbers[j] = exp(numbers[j]) - rule.offset
        if rule.overshoots:
            for j in range(count):
                value = numbers[j]
                numbers[j] = 0.0 if value < 0.0 else value  # nan stays nan
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
        if spectra.size > 0:
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
        if rule.logarithm and not rule.mixed:
            for j in range(count):
                total[j] = exp(total[j]) - rule.offset
        for j in range(count):
            value = 0.0 if overshoots and total[j] < 0.0 else total[j]  # nan stays nan
            out[j * wavelengths + m] = value * mu[j] + apart


@loop
def vectors_of_angles(theta: Array, phi: Array, count: int, w: Array) -> None:
    """Write unit vectors, three numbers each, of directions by angles [rad]; those below the horizon lie on it.

    The float32 nearest pi/2 lies above pi/2, and is the horizon.
    """
    for j in range(count):
        w[3 * j + 2] = sine(_held(theta[j]))
    for j in range(count):
        w[3 * j] = w[3 * j + 2] * cos(np.float64(phi[j]))
    for j in range(count):
        w[3 * j + 1] = w[3 * j + 2] * sine(np.float64(phi[j]))
    for j in range(count):
        w[3 * j + 2] = cos(_held(theta[j]))


@kernel
def _held(theta: float) -> float:
    return np.float64(theta) if theta < HALF_PI else HALF_PI


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
    """Write f_r [1/sr] of directions by angles [rad]. Return False if any angle is out of range."""
    most = min(POINTS, theta_i.size)
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
            odd += int(not (usual & (abs(p_i[j]) <= PHI_MAX) & (abs(p_r[j]) <= PHI_MAX)))
        if odd > 0:
            for j in range(count):
                bad = t_i[j] < 0.0 or t_i[j] > PI or t_r[j] < 0.0 or t_r[j] > PI
                good = good and not (bad or abs(p_i[j]) > PHI_MAX or abs(p_r[j]) > PHI_MAX)
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
    most = min(POINTS, points)
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
