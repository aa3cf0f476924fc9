"""The fields of RGL's files from lookups of a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brdfdb.formats._rgl_fields import Fields, Floats32, directions
from brdfdb.formats._rgl_warp import Array, Warp

if TYPE_CHECKING:
    from brdfdb.formats._channels import Channels
    from brdfdb.tables.table import Table

LOWEST = 0.02  # cosine of theta_r below which f_r is continued: some models have a pole at the horizon
LAST_THETA = np.deg2rad(89.0)  # last theta_i; readers continue with its values
RAMP = 0.1


@dataclass(frozen=True)
class Plan:
    """Numbers of nodes of a file.

    Attributes
    ----------
    size : int
        Rows and columns of `spectra` and `luminance`.
    lights : int
        Nodes of theta_i.
    azimuths : int
        Nodes of phi_i; 1 of isotropic tables.
    rows, columns : int
        Those of `vndf`.
    factor : bool
        A factor over the half vector is taken out.
    """

    size: int
    lights: int
    azimuths: int = 1
    rows: int = 2
    columns: int = 2
    factor: bool = False
    share: float = 0.5
    ramp: float = RAMP
    power: float = 1.0


class Surface:
    """f_r cos(theta_r) of a table, continued below the horizon.

    Parameters
    ----------
    table : Table
        Table in memory.
    channels : Channels
        Channels that are looked up.
    """

    def __init__(self, table: Table, channels: Channels, reduction: int) -> None:
        self._table, self._channels, self.reduction = table, channels, reduction
        self.isotropic = not table.anisotropic

    def f_r(self, wi: Array, wr: Array) -> Array:
        """Return f_r [1/sr], shape (..., C), where the viewer is as far above the horizon as it may be below."""
        height = np.maximum(np.abs(wr[..., 2:]), LOWEST)
        flat = wr[..., :2]
        length = np.sqrt(np.maximum(np.sum(flat**2, axis=-1, keepdims=True), 1e-30))
        above = np.concatenate([flat * (np.sqrt(1.0 - np.minimum(height, 1.0) ** 2) / length), height], axis=-1)
        return self._channels.values(self._table, wi, above)


def build(surface: Surface, plan: Plan) -> Fields:
    """Return the fields of a table."""
    theta_i, phi_i = lights(surface, plan)
    ndf, sigma = factors(surface, plan)
    grid = np.stack(np.meshgrid(phi_i, theta_i, indexing="ij")).reshape(2, -1).astype(np.float64)
    sine = np.sin(grid[1])
    wi = np.stack([sine * np.cos(grid[0]), sine * np.sin(grid[0]), np.cos(grid[1])], axis=-1)[:, np.newaxis, np.newaxis]
    vndf = _density(surface, plan, wi)
    x, y = Warp(vndf).forward(plan.size)
    values, weight = _values(surface, wi, x, y)
    from brdfdb.formats._rgl_fields import _bilinear, _of_azimuth, _of_polar_angle

    scale = _bilinear(ndf, x, y) / (
        4.0 * _bilinear(sigma, _of_polar_angle(grid[1]), _of_azimuth(grid[0]))[:, np.newaxis, np.newaxis]
    )
    everywhere = np.zeros(len(x), np.int64)[np.newaxis]
    density = _cells(Warp(vndf), x, y)
    luminance = np.maximum(values.mean(axis=-1) * weight, 0.0) / density
    luminance = np.maximum(luminance, 1e-3 * luminance.mean(axis=(1, 2), keepdims=True) + 1e-30)
    spectra = np.moveaxis(values / scale[..., np.newaxis], -1, 1)
    shape = (phi_i.size, theta_i.size)
    return Fields(
        theta_i=theta_i,
        phi_i=phi_i,
        ndf=ndf,
        sigma=sigma,
        vndf=vndf.reshape(*shape, *vndf.shape[1:]),
        luminance=luminance.astype(np.float32).reshape(*shape, *luminance.shape[1:]),
        spectra=spectra.astype(np.float32).reshape(*shape, *spectra.shape[1:]),
        wavelength_nm=np.arange(1, 1 + spectra.shape[1]).astype(np.float32),
    )


def lights(surface: Surface, plan: Plan) -> tuple[Floats32, Floats32]:
    """Return the nodes theta_i and phi_i [rad]."""
    t = np.linspace(0.0, 1.0, plan.lights)
    theta_i = LAST_THETA * (1.0 - (1.0 - t) ** plan.power)
    if surface.isotropic:
        return theta_i.astype(np.float32), np.zeros(1, np.float32)
    span = 2.0 * np.pi / surface.reduction
    return theta_i.astype(np.float32), np.linspace(-np.pi, -np.pi + span, plan.azimuths).astype(np.float32)


def _values(surface: Surface, wi: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Return f_r cos(theta_r), shape (..., C), and the solid angle of the viewer for each area, at half vectors."""
    m = directions(x, y)
    if surface.isotropic:  # azimuths of half vectors are taken from that of the light, which is 0
        wi = np.stack([np.hypot(wi[..., 0], wi[..., 1]), np.zeros(wi.shape[:-1]), wi[..., 2]], axis=-1)
    cosine = np.sum(wi * m, axis=-1)
    wr = 2.0 * cosine[..., np.newaxis] * m - wi
    values = surface.f_r(wi, wr) * wr[..., 2:]
    jacobian = 2.0 * np.pi**2 * x * np.sin(x**2 * (np.pi / 2.0)) * 4.0 * np.maximum(cosine, 0.0)
    return values, jacobian


def _density(surface: Surface, plan: Plan, wi: Array) -> Floats32:
    """Return the density over half vectors, shape (slices, rows, columns)."""
    if plan.rows == 2:
        return np.ones((len(wi), 2, 2), np.float32)
    x, y = np.meshgrid(np.linspace(0.0, 1.0, plan.columns), np.linspace(0.0, 1.0, plan.rows))
    x, y = (np.broadcast_to(u, (len(wi), plan.rows, plan.columns)) for u in (x, y))
    values, weight = _values(surface, wi, x, y)
    m = directions(x, y)
    local = wi if not surface.isotropic else np.stack([np.hypot(wi[..., 0], wi[..., 1]), 0.0 * wi[..., 0], wi[..., 2]], axis=-1)
    height = 2.0 * np.sum(local * m, axis=-1) * m[..., 2] - local[..., 2]
    ramp = np.clip(1.0 + height / plan.ramp, 0.02, 1.0)
    light = np.maximum(values.mean(axis=-1), 0.0) * weight
    light /= light.mean(axis=(1, 2), keepdims=True)
    ramp /= ramp.mean(axis=(1, 2), keepdims=True)
    return (plan.share * light + (1.0 - plan.share) * ramp).astype(np.float32)


def _cells(warp: Warp, x: Array, y: Array) -> Array:
    """Return the densities of all slices at points (slices, n, n)."""
    from brdfdb.formats._rgl_warp import Mixture

    numbers = np.repeat(np.arange(len(x)), x.shape[1] * x.shape[2])
    mixture = Mixture(numbers[np.newaxis], np.ones((1, numbers.size)))
    return warp.density(mixture, x.reshape(-1), y.reshape(-1)).reshape(x.shape)


def factors(surface: Surface, plan: Plan) -> tuple[Floats32, Floats32]:
    """Return the factor over the half vector and the divisor over the light."""
    if not plan.factor:
        return np.ones((2, 2), np.float32), np.full((2, 2), 0.25, np.float32)
    columns, count = 256, 48
    rows = 2 if surface.isotropic else 65
    u = np.linspace(0.0, 1.0, count)
    theta = u**2 * np.pi / 2
    theta_i = np.minimum(np.linspace(0, 1, 24) * np.pi / 2, LAST_THETA)
    x = np.linspace(0.0, 1.0, columns)
    y = (np.arange(12) + 0.5) / 24 if surface.isotropic else np.linspace(0, 1, rows)
    phi = np.zeros(1) if surface.isotropic else np.linspace(-np.pi, -np.pi / 2, 4)
    wi = np.stack([np.sin(theta_i) * np.cos(phi[:, None]), np.sin(theta_i) * np.sin(phi[:, None]), np.broadcast_to(np.cos(theta_i), (phi.size, theta_i.size))], axis=-1)
    wi = wi.reshape(-1, 1, 1, 3)
    xx, yy = (np.broadcast_to(v, (len(wi), y.size, columns)) for v in np.meshgrid(x, y))
    values, weight = _values(surface, wi, xx, yy)
    m = directions(xx, yy)
    height = 2 * np.sum(wi * m, axis=-1) * m[..., 2] - wi[..., 2]
    valid = (height > 0.05) & (values.mean(axis=-1) > 0)
    log = np.where(valid, np.log(np.maximum(values.mean(axis=-1), 1e-30) / np.maximum(height, 0.05)), 0.0)
    t = np.zeros(len(wi))
    w = valid.astype(float)
    axes = (0, 1) if surface.isotropic else (0,)
    for _ in range(6):
        n = np.sum(w * (log - t[:, None, None]), axis=axes, keepdims=True) / np.maximum(np.sum(w, axis=axes, keepdims=True), 1e-9)
        t = np.sum(w * (log - n), axis=(1, 2)) / np.maximum(np.sum(w, axis=(1, 2)), 1e-9)
    n = n[0]
    known = np.sum(w, axis=axes).reshape(n.shape) > 0
    for j in range(len(n)):
        n[j] = np.interp(x, x[known[j]], n[j][known[j]])
    if surface.isotropic:
        n = np.repeat(n, 2, axis=0)
    else:
        n[0] = n[-1] = 0.5 * (n[0] + n[-1])
    t = t.reshape(phi.size, theta_i.size).mean(axis=0)
    xs = np.linspace(0, 1, 128)
    tt = np.interp(xs**2 * np.pi / 2, theta_i, t)
    sigma = 0.25 * np.exp(-tt)
    return np.exp(n).astype(np.float32), np.repeat(sigma[None], 2, axis=0).astype(np.float32)
