"""The directional albedo of a table: the exact integral of what is linear between nodes, else by quadrature."""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, Field

from brdfdb.geometry import radians
from brdfdb.integrals.quadrature import MOST_PANELS, Albedo, reflected_share
from brdfdb.lobes import narrowest
from brdfdb.materials import FunctionRecord, Source
from brdfdb.parameters import Floats
from brdfdb.tables.grids import Axis
from brdfdb.tables.table import Table

# Absolute, of the albedo of a table whose interpolant has no exact integral; its kinks are worth no more
QUADRATURE_TOLERANCE = 2e-5
MEASURED_TOLERANCE = 2e-4  # of measured tables: their data are uncertain by more, and it takes a quarter of the time
# Absolute, of the largest albedo that a table states: three digits are shown, and it takes a third of the time
LARGEST_TOLERANCE = 1e-3
_MOST_PANELS = 1000
# Lights for which such a table is integrated [degree]; phi_i up to where the symmetry of its grid begins anew
THETA_I_DEG = np.array([*range(0, 85, 5), 82.5, 85.0, 87.5, 89.0, 89.5], dtype=np.float64)
_PHI_I_STEP_DEG = 30.0


class TableAlbedo(NamedTuple):
    """The directional albedo of a table, without the specular part.

    Attributes
    ----------
    theta_i_deg, phi_i_deg : array [degree]
        The lights; one phi_i, 0, of isotropic tables.
    albedo : array (theta_i, phi_i, wavelengths) [1]
        One wavelength of grey tables.
    error : array (theta_i,) [1]
        Estimate of its absolute error, over phi_i and wavelengths the largest; 0 where it is exact.
    """

    theta_i_deg: Axis
    phi_i_deg: Axis
    albedo: Floats
    error: Floats

    @property
    def mean(self) -> Floats:
        """The mean over phi_i, of shape (theta_i, wavelengths)."""
        if self.phi_i_deg.size == 1:
            return self.albedo[:, 0]
        weights = _trapezoid_weights(self.phi_i_deg) / self.phi_i_deg[-1]
        return np.asarray(np.einsum("tpw,p->tw", self.albedo, weights))


def directional_albedo(
    table: Table, theta_i_deg: Axis | None = None, tolerance: float | None = None, source: Source | None = None
) -> TableAlbedo:
    """Integrate f_r cos theta_r over the hemisphere [1], as the table gives f_r between its nodes.

    Parameters
    ----------
    table : Table
        Any decoded table. Of those that are not f_r, linear over light and viewer, the attributes name the source.
    theta_i_deg : array (theta_i,) [degree], optional
        The lights, in [0, 90].
    tolerance : float [1], optional
        Absolute tolerance of the quadrature, where the integral is not exact; by default `tolerance_of`.
    source : Source, optional
        Source whose lobe the quadrature follows; by default that of the table.

    Returns
    -------
    TableAlbedo
        By default at the nodes of theta_i and phi_i where the integral is exact, else at `THETA_I_DEG` and every 30
        degrees of phi_i; at nodes and `THETA_I_DEG` if a planner chose the nodes: the attribute ``reason`` says so.
        Such nodes are at 90 degrees only if f_r has no pole there.

    Notes
    -----
    Exact for what `Table.lookup` returns where that is linear in each angle, so that the integral is a sum of the
    stored values with the integrals of the hat functions of their axes as weights. Other tables are looked up, by the
    quadrature of `brdfdb.integrals.quadrature`, to the tolerance. It follows the lobe of the source if that
    is known.
    """
    if not linear_in_angles(table):
        within = tolerance_of(table) if tolerance is None else tolerance
        of_lobe = table.source if source is None else source
        return _integrated(table, of_lobe, THETA_I_DEG if theta_i_deg is None else theta_i_deg, within)
    nodes = table.axes_deg["theta_i"]
    theta_weights = _theta_weights(radians(table.axes_deg["theta_r"]))
    if table.anisotropic:
        phi_i = table.axes_deg["phi_i"]
        phi_weights = _trapezoid_weights(radians(table.axes_deg["phi_r"]))
        albedo = _sums(table.brdf, phi_i.size, np.outer(theta_weights, phi_weights))
    else:
        phi_i = np.zeros(1)
        phi_weights = 2.0 * _trapezoid_weights(radians(table.axes_deg["delta_phi"]))  # the other half by symmetry
        albedo = _sums(table.brdf, 1, np.outer(theta_weights, phi_weights))
    lights = theta_i_deg
    if lights is None and table.metadata.reason:  # a planner's nodes are few
        lights = np.union1d(THETA_I_DEG, nodes)
    if lights is not None:
        matrix = np.stack([np.interp(lights, nodes, one) for one in np.eye(nodes.size)], axis=1)
        nodes, albedo = lights, np.tensordot(matrix, albedo, axes=1)
    return TableAlbedo(nodes, phi_i, np.asarray(albedo), np.zeros(nodes.size))


def _sums(brdf: NDArray[np.float32], phi_i: int, weights: Floats) -> Floats:
    """Return the weighted sums of f_r over viewers, shape (theta_i, phi_i, L), a row in float64 at a time."""
    rows = brdf.reshape(len(brdf), phi_i, weights.size, -1)
    return np.stack([np.einsum("pkl,k->pl", row.astype(np.float64), weights.ravel()) for row in rows])


def tolerance_of(table: Table) -> float:
    """Return the absolute tolerance [1] of the albedo of a table, where its integral is not exact."""
    return QUADRATURE_TOLERANCE if table.metadata.measured is None else MEASURED_TOLERANCE


def hemispherical_albedo(theta_i_deg: Axis, albedo: Floats) -> Floats:
    """Return the share [1] that is reflected of light that is the same from everywhere.

    Parameters
    ----------
    theta_i_deg : array (theta_i,) [degree]
        From 0 on.
    albedo : array (theta_i, wavelengths) [1]
        Directional albedo at these angles, taken as linear between them and the same beyond the last.

    Returns
    -------
    array (wavelengths,) [1]
        Twice the integral of albedo cos(theta_i) sin(theta_i).
    """
    return np.asarray(2.0 * _theta_weights(radians(theta_i_deg)) @ albedo)


class Reflected(NamedTuple):
    """Share of light reflected, averaged over phi_i: arrays (theta_i, wavelengths) [1], one wavelength if grey.

    `albedo` is without the `specular` part, `hemispherical` (wavelengths,) of light from everywhere with it. `error` is
    the largest estimate of the error of the integration.
    """

    theta_i_deg: Axis
    albedo: Floats
    specular: Floats
    hemispherical: Floats
    error: float

    def document(self, wavelength_nm: Axis | None) -> dict[str, Any]:
        """Return the fields of `AlbedoDocument`, with numpy arrays."""
        return {
            "wavelength_nm": wavelength_nm,
            "theta_i": np.ascontiguousarray(self.theta_i_deg),
            "albedo": np.ascontiguousarray(self.albedo),
            "specular_reflectance": np.ascontiguousarray(self.specular),
            "hemispherical": self.hemispherical,
            "error": self.error,
        }


class AlbedoDocument(BaseModel):
    """Directional albedo: the share of light from theta_i that is reflected, averaged over phi_i."""

    wavelength_nm: list[float] | None = Field(description="null: grey")
    theta_i: list[float] = Field(description="degrees")
    albedo: list[list[float]] = Field(description="[theta_i][wavelength], without the specular part")
    specular_reflectance: list[list[float]] = Field(description="[theta_i][wavelength], the specular part")
    hemispherical: list[float] = Field(description="[wavelength], of light that is the same from everywhere, both")
    error: float = Field(description="of albedo, the largest estimate of the integration")


def reflected(table: Table) -> Reflected:
    """Return what a table reflects, integrated once: it takes a third of a second if it is not exact."""
    if table not in _REFLECTED:
        _REFLECTED[table] = _reflected(directional_albedo(table), table, table.wavelength_nm)
    return _REFLECTED[table]


_REFLECTED: WeakKeyDictionary[Table, Reflected] = WeakKeyDictionary()


def reflected_by(source: Source, wavelength_nm: Axis | None) -> Reflected:
    """Return what a source reflects at wavelengths (L,) [nm], or at none if it is grey.

    Raises
    ------
    ParameterError
        If the source does not hold at one of the wavelengths.
    """
    phi_i_deg = azimuths_deg(source)
    angles = radians(THETA_I_DEG)[:, np.newaxis], radians(phi_i_deg)
    albedo, error = source_albedo(source, *angles, wavelength_nm, tolerance=LARGEST_TOLERANCE)
    return _reflected(TableAlbedo(THETA_I_DEG, phi_i_deg, albedo, error.max(axis=1)), source, wavelength_nm)


def azimuths_deg(source: Source) -> Axis:
    """Return the azimuths of lights [degree] up to where the symmetry of a source begins anew."""
    phi_i_deg = np.arange(0.0, 91.0 if source.elliptical else 361.0, _PHI_I_STEP_DEG)
    return phi_i_deg if source.anisotropic else phi_i_deg[:1]


def _reflected(albedo: TableAlbedo, surface: Table | Source, wavelength_nm: Axis | None) -> Reflected:
    diffuse, angles = albedo.mean, albedo.theta_i_deg
    specular = np.asarray(surface.specular_reflectance(radians(angles), wavelength_nm)).reshape(diffuse.shape[0], -1)
    specular = np.broadcast_to(specular, diffuse.shape)
    return Reflected(
        angles, diffuse, specular, hemispherical_albedo(angles, diffuse + specular), float(albedo.error.max())
    )


def source_albedo(
    source: Source,
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    wavelength_nm: Axis | None,
    *,
    tolerance: float,
    most_panels: int = MOST_PANELS,
) -> Albedo:
    """Integrate f_r cos theta_r of a source over the hemisphere [1], at all wavelengths at once.

    Parameters
    ----------
    source : Source
        Material or function.
    theta_i, phi_i : array_like [rad]
        Directions of the lights, theta up to pi/2. They broadcast.
    wavelength_nm : array (L,) [nm], or None
        For spectral sources, and only for them.
    tolerance, most_panels
        As in `brdfdb.integrals.quadrature.reflected_share`.

    Returns
    -------
    Albedo
        Albedo of shape (..., L), or (..., 1) of a grey source, without the specular part; and an estimate of the error
        for each light.
    """
    f_r = source.brdf_at(wavelength_nm)

    def brdf(wi: Floats, wr: Floats) -> Floats:
        with np.errstate(all="ignore"):  # nodes lie in every corner; what is finite is tested, not flagged
            return f_r(wi, wr)

    cos_i = np.cos(np.asarray(theta_i, dtype=np.float64))[..., np.newaxis]
    return reflected_share(
        brdf,
        theta_i,
        phi_i,
        narrowest(source.lobe(cos_i, wavelength_nm)),
        tolerance=tolerance,
        most_panels=most_panels,
        width=1 if wavelength_nm is None else wavelength_nm.size,
        mirrored=not source.anisotropic,
    )


def linear_in_angles(table: Table) -> bool:
    """Return True if the table is f_r over light and viewer, linear in each angle between its nodes."""
    return table.values_are_brdf and not table.grid.half_difference and not table.interpolation.cubic


def wavelengths_of(table: Table) -> int:
    """Return the number of wavelengths of a table; 1 if it is grey."""
    return 1 if table.wavelength_nm is None else table.wavelength_nm.size


def _integrated(
    table: Table, source: Source | FunctionRecord | None, theta_i_deg: Axis, tolerance: float
) -> TableAlbedo:
    """Return the albedo by quadrature of lookups, at all wavelengths at once."""
    width = wavelengths_of(table)
    phi_i_deg = np.zeros(1)
    if table.grid.turned:
        phi_i_deg = np.arange(0.0, 360.0 / table.grid.copies + 1.0, _PHI_I_STEP_DEG)
    theta_i = radians(theta_i_deg)[:, np.newaxis]

    def brdf(wi: Floats, wr: Floats) -> Floats:
        return table.lookup_vectors(wi, wr).reshape(len(wr), width)

    albedo, error = reflected_share(
        brdf,
        theta_i,
        radians(phi_i_deg),
        narrowest(None if source is None else source.lobe(np.cos(theta_i)[..., np.newaxis], table.wavelength_nm)),
        tolerance=tolerance,
        most_panels=_MOST_PANELS,
        width=width,
        mirrored=not table.anisotropic,
    )
    return TableAlbedo(theta_i_deg, phi_i_deg, albedo, error.max(axis=1))


def _trapezoid_weights(nodes: Axis) -> Axis:
    steps = np.diff(nodes)
    weights = np.zeros(nodes.size)
    weights[:-1] += steps / 2.0
    weights[1:] += steps / 2.0
    return weights


def _theta_weights(nodes: Axis) -> Axis:
    """Return the integrals of hat_j(theta) cos(theta) sin(theta) over [0, pi/2], the last hat held constant up to pi/2.

    With F = sin^2 / 2 and its integral G = theta / 4 - sin(2 theta) / 8, the rising half over [a, b] gives
    F(b) - (G(b) - G(a)) / (b - a).
    """
    F = np.sin(nodes) ** 2 / 2.0
    slope = np.diff(nodes / 4.0 - np.sin(2.0 * nodes) / 8.0) / np.diff(nodes)
    weights = np.zeros(nodes.size)
    weights[1:] += F[1:] - slope
    weights[:-1] += slope - F[:-1]
    weights[-1] += 0.5 - F[-1]
    return weights
