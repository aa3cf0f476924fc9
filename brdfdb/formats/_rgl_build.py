"""The fields of RGL's files from lookups of a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.formats._rgl_density import densities
from brdfdb.formats._rgl_fields import Fields, Floats32, bilinear, of_azimuth, of_polar_angle
from brdfdb.formats._rgl_surface import LAST_THETA, Surface, lights
from brdfdb.formats._rgl_warp import Array, Mixture, Warp

_TOWARDS_GRAZING = 1.5  # power of the spacing of theta_i: nodes are closer at grazing incidence
_LEAST_LUMINANCE = 1e-6  # share of the mean density of samples that each place has at least
# Readers join values by straight lines, which lie above a bend by h**2/8 f''. Values that are lower by a part of that
# leave half of it on either side
_LOWERED = 1.0 / 20.0
# Mitsuba reads a light in the plane y = 0 as one at +pi, and continues the last azimuth to it. In files of a quarter it
# is one more, with the values of -pi, which no other light reads; the quarter is still one [rad]
_BEYOND = 0.2


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
        Nodes of phi_i over the part of the circle that the file holds; isotropic tables have one.
    rows, columns : int
        Those of `vndf`.
    horizon : float
        Share of each row above the horizon, as in `densities`.
    """

    size: int
    lights: int
    azimuths: int = 1
    rows: int = 2
    columns: int = 2
    horizon: float = 0.0


def build(surface: Surface, plan: Plan, wavelength_nm: Floats32 | None) -> Fields:
    """Return the fields of a table, whose channels have these wavelengths, or are R, G, B."""
    part = np.linspace(0.0, 1.0, plan.lights)
    theta_i = (LAST_THETA * (1.0 - (1.0 - part) ** _TOWARDS_GRAZING)).astype(np.float32)
    span = 2.0 * np.pi / surface.reduction
    azimuths = np.zeros(1) if surface.isotropic else np.linspace(-np.pi, -np.pi + span, plan.azimuths)
    phi_i = azimuths.astype(np.float32)
    wi = lights(theta_i, phi_i).reshape(-1, 1, 1, 3)
    ndf, sigma = surface.factors
    horizon = np.round(plan.horizon * (plan.size - 1)) / (plan.size - 1)  # at a node of the values
    vndf = densities(surface, wi, ndf, plan.rows, plan.columns, float(horizon))
    warp = Warp(vndf)
    x, y = warp.forward(plan.size)
    values = surface.values(wi, x, y)
    luminance = np.maximum(values.brdf.mean(axis=-1) * values.solid_angle, 0.0) / _of_each(warp, x, y)
    mean = luminance.mean(axis=(1, 2), keepdims=True)
    luminance = np.maximum(luminance, _LEAST_LUMINANCE * mean) + 1e-30
    u_i = of_polar_angle(np.tile(theta_i.astype(np.float64), phi_i.size)), of_azimuth(np.repeat(phi_i, theta_i.size))
    scale = bilinear(ndf, x, y) / (4.0 * bilinear(sigma, *u_i))[:, np.newaxis, np.newaxis]
    shape = (phi_i.size, theta_i.size)
    spectra = np.moveaxis(values.brdf / scale[..., np.newaxis], -1, 1)
    spectra = spectra.reshape(*shape, *spectra.shape[1:])
    nodes = np.arange(plan.size)
    spectra = spectra - _LOWERED * sum(
        _bend(spectra, axis, at) for axis, at in ((0, phi_i), (1, theta_i), (3, nodes), (4, nodes))
    )
    vndf, luminance = vndf.reshape(*shape, *vndf.shape[1:]), luminance.reshape(*shape, *luminance.shape[1:])
    if surface.reduction == 4:
        phi_i = np.append(phi_i, np.float32(phi_i[-1] + _BEYOND))
        vndf, luminance, spectra = (np.concatenate([part, part[:1]]) for part in (vndf, luminance, spectra))
    # below the horizon values are 0: renderers reject samples below 0, which lines from there give beside it
    return Fields(
        theta_i=theta_i,
        phi_i=phi_i,
        ndf=ndf,
        sigma=sigma,
        vndf=vndf,
        luminance=luminance.astype(np.float32),
        spectra=np.maximum(spectra, 0.0).astype(np.float32),
        wavelength_nm=wavelength_nm,
    )


def _of_each(warp: Warp, x: Array, y: Array) -> Array:
    """Return the density of each slice at its own points (slices, n, n)."""
    numbers = np.repeat(np.arange(len(x)), x.shape[1] * x.shape[2])
    alone = Mixture(numbers[np.newaxis], np.ones((1, numbers.size)))
    return warp.density(alone, x.reshape(-1), y.reshape(-1)).reshape(x.shape)


def _bend(values: Array, axis: int, nodes: NDArray[Any]) -> Array:
    """Return h**2 times the second derivative of values along an axis; 0 at its ends."""
    bend = np.zeros_like(values)
    if nodes.size >= 3:
        along, result = np.moveaxis(values, axis, -1), np.moveaxis(bend, axis, -1)
        h = np.diff(nodes.astype(np.float64))
        second = np.diff(np.diff(along, axis=-1) / h, axis=-1) / (0.5 * (h[1:] + h[:-1]))
        result[..., 1:-1] = second * 0.5 * (h[1:] ** 2 + h[:-1] ** 2)
    return bend
