"""Kernels of coordinates: from directions to points on a grid of light and viewer or of half and difference vectors.

This file is one of `_numba.SHARED`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from brdfdb._elementary import cos, cosine, sine, twice_arctan
from brdfdb._numba import inner_loop, kernel, loop
from brdfdb.parameters import Array

PI, TURN, HALF_PI = np.pi, 2.0 * np.pi, np.pi / 2.0


class Rule(NamedTuple):
    """The way from numbers on a grid to f_r.

    `half_difference` is True for the axes of half and difference vectors. If `reciprocal` is True, their phi_d stands
    for light and viewer exchanged, too. `copies` is the number of times that the
    azimuth of an anisotropic grid goes into a full turn: 1, 2 or 4. Numbers are logarithms if `logarithm` is True;
    `offset` was added to values before, which had been multiplied by cos theta_i cos theta_r to the `power`.
    Interpolated values below 0 are set to 0 if `overshoots` is True. Spectra mix f_r of the channels if `mixed` is
    True, else numbers. Between wavelengths f_r is interpolated if `straight` is True, else numbers.
    """

    half_difference: bool
    reciprocal: bool
    copies: int
    logarithm: bool
    offset: float
    power: float
    overshoots: bool
    mixed: bool
    straight: bool


@kernel
def angle(y: float, x: float) -> float:
    """Return atan2(y, x) [rad] of a point in the first quadrant, the axes included; 0 at the origin."""
    return angle_of(y, x, np.sqrt(x * x + y * y))


@kernel
def angle_of(y: float, x: float, length: float) -> float:
    """Return `angle` [rad] of a point whose distance from the origin is known."""
    reach = length + max(x, y)
    a = twice_arctan(min(x, y) / (reach if reach > 0.0 else 1.0))
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


@inner_loop
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
    """Write points of unit vectors in flat arrays on either kind of grid, and mu if the rule has a power.

    mu is cos theta_i cos theta_r. `scratch` holds six rows; the last gets the lower z, nan where a number of the
    vectors is nan or infinite. One loop for the products and one for each angle: all in one would not vectorise.
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
        length = np.sqrt(h2)
        pole = flat2 < 1e-28 * h2
        along[j] = d_x if pole else (d_x * h_x + d_y * h_y) * h_z - d_z * flat2
        across[j] = d_y if pole else (d_y * h_x - d_x * h_y) * length
        x_h[j] = 1.0 if pole else h_x
        y_h[j] = 0.0 if pole else h_y
        z_h[j] = abs(h_z)
        theta_h[j], theta_d[j] = np.sqrt(flat2), np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
        lowest[j] = _lower(z_i, z_r, h2 + theta_d[j])
        phi_d[j] = length
    for j in range(count):
        theta_d[j] = angle(theta_d[j], phi_d[j])
    for j in range(count):
        theta_h[j] = angle_of(theta_h[j], z_h[j], phi_d[j])
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


@inner_loop
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
