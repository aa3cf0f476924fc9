"""Points on the four grids of tables, of unit vectors, in Dr.Jit: `brdfdb.tables._coordinates.points_of_vectors`."""

from __future__ import annotations

from typing import Any

import drjit as dr

from brdfdb.tables.grids import Grid

_POLE = 1e-13  # square of the sine of theta_h below which its azimuth has no digits in float32
_LEAST = 1e-30


def points(grid: Grid, wi: Any, wo: Any) -> list[Any]:
    """Return the coordinates [rad] on the axes of a grid, for directions above the horizon."""
    if grid.half_difference:
        return _half_difference(grid, wi, wo)
    theta_i, theta_r = dr.atan2(_length(wi.x, wi.y), wi.z), dr.atan2(_length(wo.x, wo.y), wo.z)
    if not grid.anisotropic:
        dot, cross = wi.x * wo.x + wi.y * wo.y, wi.x * wo.y - wi.y * wo.x
        return [theta_i, theta_r, dr.abs(dr.atan2(cross, dot))]
    phi, other = _turned(_full_turn(wi.y, wi.x), _full_turn(wo.y, wo.x), grid.copies)
    return [theta_i, phi, theta_r, _folded(other, dr.two_pi)]


def _half_difference(grid: Grid, wi: Any, wo: Any) -> list[Any]:
    h_x, h_y, h_z = wi.x + wo.x, wi.y + wo.y, wi.z + wo.z
    d_x, d_y, d_z = wi.x - wo.x, wi.y - wo.y, wi.z - wo.z
    flat2 = dr.square(h_x) + dr.square(h_y)
    h2 = flat2 + dr.square(h_z)
    # The difference vector along theta_h and along phi_h, both times one number. At the pole phi_h is 0
    pole = flat2 < _POLE * h2
    along = dr.select(pole, d_x, (d_x * h_x + d_y * h_y) * h_z - d_z * flat2)
    across = dr.select(pole, d_y, (d_y * h_x - d_x * h_y) * dr.sqrt(h2))
    theta_h = dr.atan2(dr.sqrt(dr.maximum(flat2, _LEAST)), h_z)
    theta_d = dr.atan2(dr.sqrt(dr.maximum(dr.square(d_x) + dr.square(d_y) + dr.square(d_z), _LEAST)), dr.sqrt(h2))
    if not grid.anisotropic:
        phi_d = dr.atan2(dr.abs(across), dr.abs(along) if grid.reciprocal else along)
        return [theta_h, theta_d, phi_d]
    phi_h = _full_turn(dr.select(pole, 0.0, h_y), dr.select(pole, 1.0, h_x))
    phi_d = _full_turn(across, along)
    if grid.copies > 1:
        phi_h = dr.select(phi_h >= dr.pi, phi_h - dr.pi, phi_h)
    if grid.copies == 4:
        beyond = phi_h > dr.pi / 2
        phi_h, phi_d = dr.select(beyond, dr.pi - phi_h, phi_h), dr.select(beyond, -phi_d, phi_d)
    return [theta_h, phi_h, theta_d, _folded(phi_d, dr.pi if grid.reciprocal else dr.two_pi)]


def _turned(phi: Any, other: Any, copies: int) -> tuple[Any, Any]:
    """Return two azimuths, the first folded into its part of the turn by the symmetries of the surface."""
    if copies > 1:
        half = phi >= dr.pi
        phi, other = dr.select(half, phi - dr.pi, phi), dr.select(half, other - dr.pi, other)
    if copies == 4:
        beyond = phi > dr.pi / 2
        phi, other = dr.select(beyond, dr.pi - phi, phi), dr.select(beyond, dr.pi - other, other)
    return phi, other


def _length(x: Any, y: Any) -> Any:
    return dr.sqrt(dr.maximum(dr.square(x) + dr.square(y), _LEAST))


def _full_turn(y: Any, x: Any) -> Any:
    phi = dr.atan2(y, x)
    return dr.select(phi < 0.0, phi + dr.two_pi, phi)


def _folded(phi: Any, period: float) -> Any:
    return phi - dr.floor(phi * (1.0 / period)) * period
