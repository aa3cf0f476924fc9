"""What a table conserves: energy, reciprocity, positivity and finiteness, with a verdict on each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb import accuracy
from brdfdb.albedo import (
    QUADRATURE_TOLERANCE,
    directional_albedo,
    linear_in_angles,
    material_of,
    wavelengths_of,
)
from brdfdb.error import Error
from brdfdb.geometry import radians
from brdfdb.grids import Axis
from brdfdb.lookup import Table
from brdfdb.materials import Material
from brdfdb.parameters import Floats

Verdict = Literal["passes", "known published excess", "violates"]

# A sum of float32 values: an ideal diffuser, albedo 1, measures 1 + 1.2e-7
ENERGY_TOLERANCE = 1e-6
# The models are reciprocal; what is left is rounding, worst where exp(-V) has a large exponent: measured 3e-13
MODEL_RECIPROCITY_TOLERANCE = 1e-11
# float32 rounds two values that differ by that to the same number or to neighbours, 6e-8 apart: measured 0
TABLE_RECIPROCITY_TOLERANCE = 1e-6
# Sums of the same numbers in another order, of f_r with the offset of its logarithm: measured 1.6e-14
LOOKUP_RECIPROCITY_TOLERANCE = 5e-14
MODEL_RECIPROCITY_PAIRS = 2000
_SEED = 1994
_POLAR = ("theta_i", "theta_r", "theta_h", "theta_d")

# More cannot be asked of a planner: a table that states more is judged as if it stated this
MOST_ERROR = 0.5
_BAND_POINTS = 100  # at which the mean over a band of theta_i is taken, of what is linear there
_NOT_FINITE, _FINITE = 1e30, 1e20  # what stands for an albedo that is not finite, and what is below any mean of it
_LOOKED_UP = 250  # directions of each band of theta_i, half of them in the lobe, where values are looked at

_STRICT = ConfigDict(frozen=True, extra="forbid")


class Bands(BaseModel):
    """What a table that states its error is judged by: what exceeds 1, on average over bands of theta_i."""

    model_config = _STRICT

    theta_i_deg: list[float] = Field(description="edges of the bands")
    stated_error: list[list[float]] = Field(
        description="[band][wavelength], of all but the Dirac part: integral of abs(error) cos theta_r over that of "
        "f_r cos theta_r"
    )
    explained: list[list[float | None]] = Field(
        description="[band][wavelength], by how much that error can raise the mean albedo at most; null: not finite"
    )
    excess: list[list[float | None]] = Field(
        description="[band][wavelength], mean of what exceeds 1, Dirac part included; null: not finite"
    )


class Energy(BaseModel):
    """Directional albedo of the table, Dirac part included: what leaves, of unit flux from theta_i.

    A table that states its error does so over bands of theta_i. What exceeds 1, or what is known of the material, may
    be as much of a band as that error explains, and no more.
    """

    model_config = _STRICT

    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: the table is grey")
    albedo: list[list[float | None]] = Field(
        description="[theta_i][wavelength]; over the azimuths of the light the largest, if the table is anisotropic; "
        "null: not finite"
    )
    specular: list[list[float | None]] = Field(description="[theta_i][wavelength], the share of the Dirac part in it")
    integration_error: float | None = Field(
        description="of the albedo, the largest estimate; 0: the exact integral of the interpolant; null: not finite"
    )
    bands: Bands | None = Field(description="null: the table states no error, and is allowed none")
    max_albedo: float | None = Field(description="null: not finite")
    max_at_theta_i_deg: float
    max_at_wavelength_nm: float | None
    exceeds_1_from_theta_i_deg: float | None
    exceeds_1_beyond_error_from_theta_i_deg: float | None = Field(
        description="where neither the stated error nor that of the integration explains it"
    )
    verdict: Verdict
    reason: str = Field(description="also where a table passes because of the error that it states")


class Asymmetry(BaseModel):
    """abs(f - f') / (abs(f) + abs(f')) over pairs of directions, f' with light and viewer exchanged."""

    model_config = _STRICT

    pairs: int
    mean: float
    max: float
    tolerance: float


class Reciprocity(BaseModel):
    """Asymmetry of the model at the parameters of the table, and of the table."""

    model_config = _STRICT

    model: Asymmetry = Field(description="over random pairs of directions")
    table: Asymmetry = Field(
        description="over every pair that the grid holds both ways round; of tables that hold other numbers than f_r, "
        "or hold them over half and difference vectors, over pairs that are looked up, too, to whose f_r the offset of "
        "the logarithms is added"
    )
    verdict: Verdict


class Values(BaseModel):
    """The stored values themselves, and those of f_r that come of them."""

    model_config = _STRICT

    count: int = Field(description="of stored values")
    looked_up: int = Field(description="directions between the nodes where f_r was looked up; 0: linear between nodes")
    smallest: float | None = Field(description="of f_r at the nodes and where it was looked up; null: none is finite")
    negative: int = Field(description="of those of f_r, and of the Dirac part")
    not_finite: int = Field(description="of those, and of what is stored in place of f_r")
    positivity: Verdict
    finiteness: Verdict


class MaterialAudit(BaseModel):
    """All findings on one revision of one material."""

    model_config = _STRICT

    material: str
    revision: str
    model: str
    energy: Energy
    reciprocity: Reciprocity
    values: Values
    verdict: Verdict = Field(description="the worst of the findings")


class AuditReport(BaseModel):
    """The audit of a store."""

    model_config = _STRICT

    format: Literal["brdfdb-audit"] = "brdfdb-audit"
    version: Literal[2] = 2
    materials: list[MaterialAudit]
    violations: list[str] = Field(description="names of the materials that violate something not known as published")


def audit(table: Table) -> MaterialAudit:
    """Audit one table: what it says of energy, positivity and finiteness holds for what is looked up in it.

    Parameters
    ----------
    table : Table
        A decoded table; its attributes name the model and its parameters.

    Returns
    -------
    MaterialAudit
        The findings. The verdict on energy is "known published excess" where the albedo exceeds 1 no further than
        the material's attribute ``known_excess``, or its model, says, and "violates" where it exceeds 1 otherwise.
        A table that states its error may exceed either by what that error explains.
    """
    material, plain = material_of(table), linear_in_angles(table)
    looked_up = None if plain else _look_up(table, material)
    energy = _energy(table, material)
    reciprocity = _reciprocity(table, material, looked_up)
    values = _values(table, looked_up)
    found = (energy.verdict, reciprocity.verdict, values.positivity, values.finiteness)
    worst: Verdict = "passes"
    for verdict in ("known published excess", "violates"):
        if verdict in found:
            worst = verdict
    return MaterialAudit(
        material=table.name,
        revision=table.revision,
        model=str(table.attrs["model"]),
        energy=energy,
        reciprocity=reciprocity,
        values=values,
        verdict=worst,
    )


def report(audits: list[MaterialAudit]) -> AuditReport:
    """Collect audits into the report of a store."""
    return AuditReport(materials=audits, violations=[a.material for a in audits if a.verdict == "violates"])


class _Judge(NamedTuple):
    """What is averaged before an albedo is held against a table, and by how much it then may exceed.

    `means` (rows, theta_i) are weights of averages, `covers`, of that shape, which theta_i a row is about, `l1` (rows,
    wavelengths) the error that a table states, and `reflected`, of that shape, a mean of the albedo without the Dirac
    part that a model may have if that error is true.
    """

    means: Floats
    covers: NDArray[np.bool_]
    l1: Floats
    reflected: Floats

    def explained(self, limit: Floats) -> Floats:
        """The integral of abs(table - model), in means: l1 of what the model reflects, which keeps to the limit."""
        return self.l1 * np.minimum(self.reflected, (self.means @ limit)[:, np.newaxis])

    def excess(self, albedo: Floats, limit: Floats) -> Floats:
        """What is above a limit, over rows and wavelengths; the limit is over theta_i."""
        return np.asarray(self.means @ np.maximum(albedo - limit[:, np.newaxis], 0.0))

    def unexplained(self, albedo: Floats, limit: Floats) -> NDArray[np.bool_]:
        """At which theta_i a limit is exceeded, and nothing explains it."""
        rows = self.excess(albedo, limit) > self.explained(limit)
        both = (albedo > limit[:, np.newaxis]) & (self.covers.T.astype(int) @ rows.astype(int) > 0)
        return np.asarray(np.any(both, axis=1))


def _energy(table: Table, material: Material) -> Energy:
    theta_i, _, each_azimuth, integration = directional_albedo(table)
    diffuse = each_azimuth.max(axis=1)
    specular = _specular(table, theta_i, diffuse.shape)
    albedo = diffuse + specular
    finite = np.where(np.isfinite(albedo), albedo, np.inf)
    worst_theta, worst_wavelength = np.unravel_index(np.argmax(finite), finite.shape)
    largest = float(finite[worst_theta, worst_wavelength])
    judge = _judge(table, theta_i, _known(diffuse))
    certain = _known(albedo - np.minimum(integration, QUADRATURE_TOLERANCE)[:, np.newaxis])
    one = np.full(theta_i.size, 1.0 + ENERGY_TOLERANCE)
    exceeding = theta_i[np.any(finite > one[:, np.newaxis], axis=1)]
    unexplained = theta_i[judge.unexplained(certain, one)]
    known: Mapping[str, Any] = table.attrs.get("known_excess") or material.spec.known_excess or {}
    bands = None if table.error is None else _bands(table.error, judge.explained(one), judge.excess(certain, one))
    verdict: Verdict
    reason = f"reflects {_share(largest)} of what arrives at {theta_i[worst_theta]:g} degrees"
    if unexplained.size == 0:
        verdict = "passes"
        why = "its integration has" if bands is None else "the table states"
        reason = f"{reason}, within the error that {why}" if exceeding.size else ""
    elif known and np.isfinite(largest) and not np.any(judge.unexplained(certain, _known_limit(known, theta_i, one))):
        verdict, reason = "known published excess", str(known["citation"])
    else:
        verdict = "violates"
        if bands is not None:
            reason += ", more than the error that the table states explains"
    return Energy(
        theta_i_deg=theta_i.tolist(),
        wavelength_nm=None if table.wavelength_nm is None else table.wavelength_nm.tolist(),
        albedo=_json(albedo),
        specular=_json(specular),
        integration_error=float(f"{integration.max():.2g}") if np.isfinite(integration).all() else None,
        bands=bands,
        max_albedo=largest if np.isfinite(largest) else None,
        max_at_theta_i_deg=float(theta_i[worst_theta]),
        max_at_wavelength_nm=None if table.wavelength_nm is None else float(table.wavelength_nm[worst_wavelength]),
        exceeds_1_from_theta_i_deg=float(exceeding[0]) if exceeding.size else None,
        exceeds_1_beyond_error_from_theta_i_deg=float(unexplained[0]) if unexplained.size else None,
        verdict=verdict,
        reason=reason,
    )


def _share(albedo: float) -> str:
    return f"{albedo:.4g}" if np.isfinite(albedo) else "no finite share"


def _known_limit(known: Mapping[str, Any], theta_i_deg: Axis, one: Axis) -> Axis:
    """What an albedo may be by what is known: 1 up to an angle, and a published excess from there on."""
    return np.where(theta_i_deg >= known["from_theta_i_deg"], known["max_albedo"], one)


def _judge(table: Table, theta_i_deg: Axis, diffuse: Floats) -> _Judge:
    """Each theta_i of a table without a stated error; of others the mean over bands, over which they state it.

    What is above a limit that the model keeps to is wrong, and no more of a band can be wrong than l1 of what the model
    reflects there: 1 / (1 - l1) of what the table does, at most.
    """
    if table.error is None:
        each = np.eye(theta_i_deg.size)
        nothing = np.zeros((theta_i_deg.size, 1))
        return _Judge(each, each.astype(bool), nothing, nothing)
    edges, l1 = np.array(table.error.theta_i_deg), np.minimum(table.error.l1, MOST_ERROR)
    means = _band_means(theta_i_deg, edges)
    covers = (theta_i_deg >= edges[:-1, np.newaxis]) & (theta_i_deg <= edges[1:, np.newaxis])
    return _Judge(means, covers, l1, (means @ diffuse) / (1.0 - l1))


def _bands(error: Error, explained: Floats, excess: Floats) -> Bands:
    known, above = (_json(np.where(each < _FINITE, each, np.nan)) for each in (explained, excess))
    return Bands(theta_i_deg=error.theta_i_deg, stated_error=error.l1, explained=known, excess=above)


def _known(values: Floats) -> Floats:
    """Values of which those that are not finite are replaced by one that exceeds everything."""
    return np.where(np.isfinite(values), values, _NOT_FINITE)


def _band_means(theta_i_deg: Axis, edges: Axis) -> Floats:
    """Weights, (bands, theta_i), of the mean over each band of what is linear between theta_i and the same beyond."""
    share = (np.arange(_BAND_POINTS) + 0.5) / _BAND_POINTS
    inside = edges[:-1, np.newaxis] + np.diff(edges)[:, np.newaxis] * share
    return np.stack([np.interp(inside, theta_i_deg, one).mean(axis=1) for one in np.eye(theta_i_deg.size)], axis=1)


def _specular(table: Table, theta_i_deg: Axis, shape: tuple[int, ...]) -> Floats:
    """The reflectance of the Dirac part, over theta_i and wavelength."""
    if table.specular is None:
        return np.zeros(shape)
    if table.specular_theta_deg is None and np.array_equal(theta_i_deg, table.axes_deg["theta_i"]):
        return table.specular.reshape(shape)
    return table.specular_reflectance(radians(theta_i_deg)).reshape(shape)


def _json(values: Floats) -> list[list[float | None]]:
    """Nested lists to seven digits, what a float32 holds; JSON has no number for what is not finite."""
    return [[float(f"{v:.7g}") if np.isfinite(v) else None for v in row] for row in values.tolist()]


class _LookedUp(NamedTuple):
    """Values of f_r between the nodes: with light and viewer exchanged, too."""

    forward: Floats
    backward: Floats


def _look_up(table: Table, material: Material) -> _LookedUp:
    """f_r, shape (N, L), of pairs of directions above the horizon, half of them in the lobe."""
    drawn = accuracy.draw(material, table.wavelength_nm, _LOOKED_UP, _SEED)
    wi, wr = drawn.wi[drawn.above], drawn.wr[drawn.above]
    shape = (len(wi), wavelengths_of(table))
    return _LookedUp(table.lookup_vectors(wi, wr).reshape(shape), table.lookup_vectors(wr, wi).reshape(shape))


def _reciprocity(table: Table, material: Material, looked_up: _LookedUp | None) -> Reciprocity:
    rng = np.random.default_rng(_SEED)
    # uniform over the cosine up to the last node of the table
    lowest = np.cos(radians(min(table.axes_deg[name][-1] for name in table.axes_deg if name in _POLAR)))
    theta_i, theta_r = np.arccos(rng.uniform(lowest, 1.0, (2, MODEL_RECIPROCITY_PAIRS)))
    phi_i, phi_r = rng.uniform(0.0, 2.0 * np.pi, (2, MODEL_RECIPROCITY_PAIRS))
    forward, backward = (theta_i, phi_i, theta_r, phi_r), (theta_r, phi_r, theta_i, phi_i)
    wavelengths = table.wavelength_nm
    model = _asymmetry(
        _model(material, wavelengths, forward),
        _model(material, wavelengths, backward),
        MODEL_RECIPROCITY_PAIRS,
        MODEL_RECIPROCITY_TOLERANCE,
    )
    stored = _table_asymmetry(table, looked_up)
    good = model.max <= model.tolerance and stored.max <= stored.tolerance
    return Reciprocity(model=model, table=stored, verdict="passes" if good else "violates")


def _table_asymmetry(table: Table, looked_up: _LookedUp | None) -> Asymmetry:
    """The pairs that a grid holds both ways round, and those that were looked up."""
    found = []
    if not table.grid.half_difference:
        found.append(_node_asymmetry(table))
    if looked_up is not None and (table.grid.half_difference or table.grid.reciprocal):
        # what is interpolated is the logarithm of f_r with an offset: of f_r far below it, rounding alone is left
        forward, backward = (each + table.interpolation.offset for each in looked_up)
        found.append(_asymmetry(forward, backward, len(forward), LOOKUP_RECIPROCITY_TOLERANCE))
    worst = max(found, key=lambda each: each.max / each.tolerance)
    pairs = sum(each.pairs for each in found)
    return worst.model_copy(
        update={"pairs": pairs, "mean": sum(each.mean * each.pairs for each in found) / max(pairs, 1)}
    )


def _node_asymmetry(table: Table) -> Asymmetry:
    """Stored values against stored values: an interpolant is as symmetric as its nodes, if the axes are the same."""
    axes = table.axes_deg
    _, i, r = np.intersect1d(axes["theta_i"], axes["theta_r"], return_indices=True)
    if table.anisotropic:
        _, phi_i, phi_r = np.intersect1d(axes["phi_i"], axes["phi_r"], return_indices=True)
        f = table.brdf[np.ix_(i, phi_i, r, phi_r)]
        swapped = np.moveaxis(f, (0, 1), (2, 3))
    else:
        f = table.brdf[np.ix_(i, r)]  # exchanging them turns delta_phi to -delta_phi, where the table is the same
        swapped = np.swapaxes(f, 0, 1)
    return _asymmetry(f, swapped, f.size // wavelengths_of(table), TABLE_RECIPROCITY_TOLERANCE)


def _model(material: Material, wavelength_nm: Axis | None, angles: tuple[NDArray[np.float64], ...]) -> Floats:
    """The model behind a table, at the table's wavelengths."""
    if wavelength_nm is not None:
        angles = tuple(angle[:, np.newaxis] for angle in angles)
    return material.spec.evaluate(*angles, **material.arguments(wavelength_nm))


def _asymmetry(f: Floats, swapped: Floats, pairs: int, tolerance: float) -> Asymmetry:
    differs = f != swapped  # nan does; hardly any other value, which saves the time of the rest
    f, swapped = f[differs].astype(np.float64), swapped[differs].astype(np.float64)
    with np.errstate(invalid="ignore"):  # what is not finite counts as 1
        relative = np.abs(f - swapped) / (np.abs(f) + np.abs(swapped))
    relative = np.where(np.isfinite(relative), relative, 1.0)
    mean, largest = float(relative.sum() / differs.size), float(relative.max(initial=0.0))
    return Asymmetry(pairs=pairs, mean=mean, max=largest, tolerance=tolerance)


def _values(table: Table, looked_up: _LookedUp | None) -> Values:
    brdf: list[Floats] = [table.brdf] if looked_up is None else [table.brdf, looked_up.forward]
    dirac: list[Floats] = [] if table.specular is None else [table.specular]
    reflected = [*brdf, *dirac]
    apart: list[Floats] = [array for array in (table.spectra, table.uniform) if array is not None]
    others = apart if table.values_are_brdf else [table.values, *apart]
    not_finite = sum(array.size - int(np.count_nonzero(np.isfinite(array))) for array in (*reflected, *others))
    # -inf is not finite, and counted as that
    negative = sum(int(np.count_nonzero((array < 0.0) & np.isfinite(array))) for array in reflected)
    smallest = min(float(np.min(array, initial=np.inf, where=np.isfinite(array))) for array in brdf)
    return Values(
        count=sum(array.size for array in (table.values, *apart))
        + (0 if table.specular is None else table.specular.size),
        looked_up=0 if looked_up is None else len(looked_up.forward),
        smallest=smallest if np.isfinite(smallest) else None,
        negative=negative,
        not_finite=not_finite,
        positivity="violates" if negative else "passes",
        finiteness="violates" if not_finite else "passes",
    )
