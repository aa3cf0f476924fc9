"""Energy of a table: its directional albedo, and the part of an excess that its stated error explains."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from brdfdb.audit.finding import STRICT, Verdict
from brdfdb.audit.model_energy import DIGITS, crossing, limit_of, place
from brdfdb.figure import Numbers, numbers, rows
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials.provenance import KnownExcess
from brdfdb.parameters import Floats
from brdfdb.tables.albedo import directional_albedo, hemispherical_albedo, tolerance_of
from brdfdb.tables.grids import Axis
from brdfdb.tables.stated_error import Grazing
from brdfdb.tables.table import Table

# Largest stated error [1]. A table that states more is judged as if it stated this
MOST_ERROR = 0.5
_BAND_POINTS = 100  # number of points of the mean over a band of theta_i
_NOT_FINITE = 1e30  # value in place of an albedo that is not finite
_FINITE = 1e20  # smallest mean that includes such a value
_RINGS = 40  # of viewers that tell which share of an albedo was measured; each has twice as many viewers
_MOST_UNMEASURED = 0.5  # share of the albedo of a light that is judged, beside which others do not count


class Bands(BaseModel):
    """Mean excess over 1 in bands of theta_i. A table with a stated error is judged by it."""

    model_config = STRICT

    theta_i_deg: list[float] = Field(description="edges of the bands")
    stated_error: list[list[float]] = Field(
        description="[band][wavelength], without the specular part: integral of abs(error) cos theta_r over that of "
        "f_r cos theta_r"
    )
    held_out_error: float = Field(
        default=0.0, description="the same at samples of measured data that were held out; it comes on top"
    )
    explained: list[list[float | None]] = Field(
        description="[band][wavelength], largest rise of the mean albedo by that error; null: not finite"
    )
    excess: list[list[float | None]] = Field(
        description="[band][wavelength], mean excess over 1, specular part included; null: not finite"
    )


class TableEnergy(BaseModel):
    """Directional albedo of the table, specular part included: the share of the light from theta_i that leaves.

    Errors are stated for bands of theta_i. In each band the excess over 1, or over the known excess of the material,
    may be as large as the stated error explains.
    """

    model_config = STRICT

    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: the table is grey")
    albedo: list[list[float | None]] = Field(
        description="[theta_i][wavelength]; largest over the azimuths of the light, if the table is anisotropic; "
        "null: not finite"
    )
    specular: list[list[float | None]] = Field(description="[theta_i][wavelength], the specular part of the albedo")
    integration_error: float | None = Field(
        description="largest estimated error of the albedo; 0: the exact integral of the interpolant; null: not finite"
    )
    hemispherical: Numbers = Field(
        description="[wavelength], albedo in uniform light; albedos are linear between theta_i"
    )
    bands: Bands | None = Field(description="null: the table states no error, and no excess is explained")
    max_albedo: float | None = Field(description="null: not finite")
    guessed: float = Field(
        default=0.0,
        description="part of it by glints that one sample shows, or at lights that were not measured: an upper bound",
    )
    extrapolated: float = Field(
        default=0.0,
        description="part of it in directions that were not measured; lights for which it is more than half do not "
        "count, unless it is so for all",
    )
    max_at_theta_i_deg: float
    max_at_wavelength_nm: float | None
    exceeds_1_from_theta_i_deg: float | None = Field(description="to 0.001 degrees")
    exceeds_1_beyond_error_from_theta_i_deg: float | None = Field(
        description="angle above which neither the stated error nor that of the integration explains the excess"
    )
    verdict: Verdict
    reason: str = Field(description="also if a table passes because of its stated error")
    grazing: Grazing | None = Field(
        default=None, description="measured albedo of lights beyond the last; null: not finite, or the model is known"
    )

    @property
    def uncertainty(self) -> float | None:
        """Return the part of the largest albedo [1] that the errors of its band may make; None if none is stated.

        It is that of the worst wavelength, with the error of measured data, what glints may lack, and what was not
        measured.
        """
        unknown = self.guessed + self.extrapolated
        if self.bands is None or self.max_albedo is None:
            return unknown or None
        edges = np.array(self.bands.theta_i_deg)
        band = int(np.clip(np.searchsorted(edges, self.max_at_theta_i_deg, side="right") - 1, 0, edges.size - 2))
        return self.max_albedo * (max(self.bands.stated_error[band]) + self.bands.held_out_error) + unknown

    @property
    def is_extrapolated(self) -> bool:
        """True if most of the largest albedo lies in directions that were not measured: it is unknown."""
        return self.max_albedo is not None and self.extrapolated > _MOST_UNMEASURED * self.max_albedo

    @property
    def is_certain(self) -> bool:
        """True if the largest albedo is at most 1, its uncertainty included; glints count as they may be at most."""
        if self.max_albedo is None:
            return True
        if self.is_extrapolated:
            return False
        most = self.max_albedo + (self.uncertainty or self.guessed) - self.guessed
        return most < 1.0 if self.guessed else most <= 1.0

    @property
    def word(self) -> Verdict | Literal["not judged"]:
        """The verdict on a table without a model; "not judged" if 1 is within the error of its largest albedo."""
        return "not judged" if self.verdict == "passes" and not self.is_certain else self.verdict


class _Judge(NamedTuple):
    """Averages of an albedo that are judged, and the excess that the stated error of the table explains.

    `means` (rows, theta_i) holds the weights of the averages, `covers` (rows, theta_i) is True for the theta_i of a
    row. `l1` (rows, wavelengths) is the stated error of the table, `reflected` (rows, wavelengths) the largest mean
    albedo of the model, without the specular part, that this error allows.
    """

    means: Floats
    covers: NDArray[np.bool_]
    l1: Floats
    reflected: Floats

    def explained(self, limit: Floats) -> Floats:
        """Return the mean albedo [1] that the stated error explains: l1 times the albedo that the model may have."""
        return self.l1 * np.minimum(self.reflected, (self.means @ limit)[:, np.newaxis])

    def excess(self, albedo: Floats, limit: Floats) -> Floats:
        """Return the mean albedo [1] above a limit (theta_i,), shape (rows, wavelengths)."""
        return np.asarray(self.means @ np.maximum(albedo - limit[:, np.newaxis], 0.0))

    def unexplained(self, albedo: Floats, limit: Floats) -> NDArray[np.bool_]:
        """Return a mask over theta_i, True where the excess over a limit is larger than the stated error explains."""
        rows = self.excess(albedo, limit) > self.explained(limit)
        both = (albedo > limit[:, np.newaxis]) & (self.covers.T.astype(int) @ rows.astype(int) > 0)
        return np.asarray(np.any(both, axis=1))


def table_energy_of(
    table: Table,
    known: KnownExcess | None,
    excused: Literal["known published excess", "accepted excess", "violates"] = "known published excess",
) -> TableEnergy:
    """Return the energy of a table; `excused` is the verdict on an excess that is not above the known one."""
    integrated = directional_albedo(table)
    theta_i = integrated.theta_i_deg
    integration = integrated.error
    diffuse = integrated.albedo.max(axis=1)
    specular = _specular(table, theta_i, diffuse.shape)
    albedo = diffuse + specular
    unmeasured = _unmeasured(table, theta_i, integrated.phi_i_deg)
    counts = unmeasured.max(axis=1) <= max(_MOST_UNMEASURED, unmeasured.max(axis=1).min())
    finite = np.where(counts[:, np.newaxis], np.where(np.isfinite(albedo), albedo, np.inf), 0.0)
    worst_theta, worst_wavelength = np.unravel_index(np.argmax(finite), finite.shape)
    largest = float(finite[worst_theta, worst_wavelength])
    judge = _judge(table, theta_i, _known(diffuse))
    guessed = np.zeros(diffuse.shape) if integrated.guessed is None else integrated.guessed.max(axis=1)
    bounded = float(f"{guessed[worst_theta, worst_wavelength]:.4g}")
    smooth = diffuse if integrated.glints is None else (integrated.albedo - integrated.glints).max(axis=1)
    extrapolated = np.where(unmeasured > 0.0, unmeasured * _known(smooth), 0.0)
    known_part = _known(albedo - np.minimum(integration, tolerance_of(table))[:, np.newaxis] - guessed - extrapolated)
    certain = np.where(counts[:, np.newaxis], known_part, 0.0)
    one = limit_of(None, theta_i)
    first = _first_above_1(table, theta_i, np.max(finite, axis=1) - one)
    unexplained = theta_i[judge.unexplained(certain, one)]
    bands = None
    if table.error is not None:
        explained, excess = (
            rows(np.where(means < _FINITE, means, np.nan), DIGITS)
            for means in (judge.explained(one), judge.excess(certain, one))
        )
        bands = Bands(
            theta_i_deg=table.error.theta_i_deg,
            stated_error=table.error.l1,
            held_out_error=_held_out_error(table),
            explained=explained,
            excess=excess,
        )
    verdict: Verdict
    worst_nm = None if table.wavelength_nm is None else float(table.wavelength_nm[worst_wavelength])
    digits = 4 if abs(largest - 1.0) > 5e-4 else 7  # 1.0003 is not 1
    share = f"{largest:.{digits}g}" if np.isfinite(largest) else "no finite share"
    most = "at most " if bounded else ""
    reason = f"reflects {most}{share} of the incident light at {place(theta_i[worst_theta], worst_nm)}"
    if unexplained.size == 0:
        verdict = "passes"
        cause = f"within the error that {'its integration has' if bands is None else 'the table states'}"
        unknown = float(extrapolated[worst_theta, worst_wavelength])
        if unknown > _MOST_UNMEASURED * largest:
            cause = f"{unknown:.3g} of it in directions that were not measured"
        elif bounded:
            cause = f"{bounded:.3g} of it by glints whose power is known as an upper bound alone"
        reason = f"{reason}, {cause}" if first is not None or (bounded and largest >= 1.0) else ""
    elif (
        known is not None and np.isfinite(largest) and not np.any(judge.unexplained(certain, limit_of(known, theta_i)))
    ):
        verdict = excused
        reason = f"{reason}: {known.citation}"
    else:
        verdict = "violates"
        if bands is not None:
            reason += ", more than the error that the table states explains"
    return TableEnergy(
        theta_i_deg=theta_i.tolist(),
        wavelength_nm=None if table.wavelength_nm is None else table.wavelength_nm.tolist(),
        albedo=rows(albedo, DIGITS),
        specular=rows(specular, DIGITS),
        integration_error=float(f"{integration.max():.2g}") if np.isfinite(integration).all() else None,
        hemispherical=numbers(hemispherical_albedo(theta_i, integrated.mean + specular), 4),
        bands=bands,
        max_albedo=largest if np.isfinite(largest) else None,
        guessed=bounded,
        extrapolated=float(f"{extrapolated[worst_theta, worst_wavelength]:.4g}"),
        max_at_theta_i_deg=float(theta_i[worst_theta]),
        max_at_wavelength_nm=worst_nm,
        exceeds_1_from_theta_i_deg=first,
        exceeds_1_beyond_error_from_theta_i_deg=float(unexplained[0]) if unexplained.size else None,
        verdict=verdict,
        reason=reason,
    )


def _unmeasured(table: Table, theta_i_deg: Axis, phi_i_deg: Axis) -> Floats:
    """Return the share [1] of the albedo in directions that were not measured, (theta_i, 1 or wavelengths).

    It is 0 of a table that was made to conserve energy, and the largest of the azimuths of the light.
    """
    measured = table.metadata.measured
    if measured is None or measured.extent is None or any(change.law == "conserving" for change in measured.changes):
        return np.zeros((theta_i_deg.size, 1))
    smooth = table.without_glints()
    theta = np.arcsin(np.sqrt((np.arange(_RINGS) + 0.5) / _RINGS))  # rings of the same projected solid angle
    phi = 2.0 * np.pi * (np.arange(2 * _RINGS) + 0.5) / (2 * _RINGS)
    viewers = unit_vector(theta[:, np.newaxis], phi).reshape(-1, 3)
    shares = []
    for light in unit_vector(radians(theta_i_deg)[:, np.newaxis], radians(phi_i_deg)):
        of_light = []
        for w in light:
            lights = np.broadcast_to(w, viewers.shape)
            f_r = np.nan_to_num(smooth.lookup_vectors(lights, viewers).reshape(len(viewers), -1))
            outside = f_r[measured.extent.outside(lights, viewers)].sum(axis=0)
            of_light.append(outside / np.maximum(f_r.sum(axis=0), 1e-300))
        shares.append(np.max(of_light, axis=0))
    return np.array(shares)


def _first_above_1(table: Table, theta_i_deg: Axis, excess: Axis) -> float | None:
    """Return the angle [degree] above which the albedo of a table exceeds 1, or None."""
    if not np.any(excess > 0.0):
        return None
    first = int(np.argmax(excess > 0.0))
    if first == 0 or not np.isfinite(excess[first - 1 : first + 1]).all():
        return float(theta_i_deg[first])

    def between(angle: float) -> float:
        at = np.array([angle])
        diffuse = directional_albedo(table, at).albedo.max(axis=1)
        return float(np.max(diffuse + _specular(table, at, diffuse.shape)) - limit_of(None, at)[0])

    return crossing(between, *theta_i_deg[first - 1 : first + 1].tolist())


def _judge(table: Table, theta_i_deg: Axis, diffuse: Floats) -> _Judge:
    """Return the averages by which a table is judged: bands of theta_i, or each theta_i if it states no error.

    The excess over a limit that the model keeps is an error. The error of a band is at most l1 times the albedo of the
    model, and the albedo of the model is at most 1 / (1 - l1) times that of the table.
    """
    if table.error is None:
        identity = np.eye(theta_i_deg.size)
        nothing = np.zeros((theta_i_deg.size, 1))
        return _Judge(identity, identity.astype(bool), nothing, nothing)
    edges = np.array(table.error.theta_i_deg)
    l1 = np.minimum(np.add(table.error.l1, _held_out_error(table)), MOST_ERROR)
    means = _band_means(theta_i_deg, edges)
    covers = (theta_i_deg >= edges[:-1, np.newaxis]) & (theta_i_deg <= edges[1:, np.newaxis])
    return _Judge(means, covers, l1, (means @ diffuse) / (1.0 - l1))


def _held_out_error(table: Table) -> float:
    """Return the error [1] of measured data at samples that were held out, over the reflected light; 0 of others."""
    measured = table.metadata.measured
    return 0.0 if measured is None or measured.held_out is None else measured.held_out.l1


def _known(values: Floats) -> Floats:
    """Return values, with a value above all others in place of those that are not finite."""
    return np.where(np.isfinite(values), values, _NOT_FINITE)


def _band_means(theta_i_deg: Axis, edges: Axis) -> Floats:
    """Return the weights (bands, theta_i) of the mean over each band of values that are linear between theta_i."""
    share = (np.arange(_BAND_POINTS) + 0.5) / _BAND_POINTS
    inside = edges[:-1, np.newaxis] + np.diff(edges)[:, np.newaxis] * share
    return np.stack([np.interp(inside, theta_i_deg, one).mean(axis=1) for one in np.eye(theta_i_deg.size)], axis=1)


def _specular(table: Table, theta_i_deg: Axis, shape: tuple[int, ...]) -> Floats:
    """Return the reflectance [1] of the specular part, shape (theta_i, wavelengths)."""
    if table.specular is None:
        return np.zeros(shape)
    if table.specular_theta_deg is None and np.array_equal(theta_i_deg, table.axes_deg["theta_i"]):
        return table.specular.reshape(shape)
    return table.specular_reflectance(radians(theta_i_deg)).reshape(shape)
