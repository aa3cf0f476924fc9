"""What a table conserves: energy, reciprocity, positivity and finiteness, with a verdict on each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.geometry import radians
from brdfdb.grids import Axis
from brdfdb.lookup import Table
from brdfdb.materials import Material
from brdfdb.models import MODELS
from brdfdb.parameters import Floats

Verdict = Literal["passes", "known published excess", "violates"]

# A sum of float32 values: an ideal diffuser, albedo 1, measures 1 + 1.2e-7
ENERGY_TOLERANCE = 1e-6
# The models are reciprocal; what is left is rounding, worst where exp(-V) has a large exponent: measured 3e-13
MODEL_RECIPROCITY_TOLERANCE = 1e-11
# float32 rounds two values that differ by that to the same number or to neighbours, 6e-8 apart: measured 0
TABLE_RECIPROCITY_TOLERANCE = 1e-6
MODEL_RECIPROCITY_PAIRS = 2000

_STRICT = ConfigDict(frozen=True, extra="forbid")


class Energy(BaseModel):
    """Directional albedo of the table, Dirac part included: what leaves, of unit flux from theta_i."""

    model_config = _STRICT

    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: the table is grey")
    albedo: list[list[float | None]] = Field(
        description="[theta_i][wavelength]; over the azimuths of the light the largest, if the table is anisotropic; "
        "null: not finite"
    )
    specular: list[list[float | None]] = Field(description="[theta_i][wavelength], the share of the Dirac part in it")
    max_albedo: float | None = Field(description="null: not finite")
    max_at_theta_i_deg: float
    max_at_wavelength_nm: float | None
    exceeds_1_from_theta_i_deg: float | None
    verdict: Verdict
    reason: str


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
    table: Asymmetry = Field(description="over every pair that the grid holds both ways round")
    verdict: Verdict


class Values(BaseModel):
    """The stored values themselves."""

    model_config = _STRICT

    count: int
    smallest: float | None = Field(description="of f_r; null: no value is finite")
    negative: int
    not_finite: int
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
    version: Literal[1] = 1
    materials: list[MaterialAudit]
    violations: list[str] = Field(description="names of the materials that violate something not known as published")


def audit(table: Table) -> MaterialAudit:
    """Audit one table: what it says of energy, positivity and finiteness holds for its stored values, interpolated.

    Parameters
    ----------
    table : Table
        A decoded table; its attributes name the model and its parameters.

    Returns
    -------
    MaterialAudit
        The findings. The verdict on energy is "known published excess" where the albedo exceeds 1 no further than
        the material's attribute ``known_excess``, or its model, says, and "violates" where it exceeds 1 otherwise.
    """
    energy = _energy(table)
    reciprocity = _reciprocity(table)
    values = _values(table)
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


def directional_albedo(table: Table) -> Floats:
    """Integral of the table's interpolant times cos theta_r over the hemisphere, without the Dirac part.

    Parameters
    ----------
    table : Table
        Any decoded table.

    Returns
    -------
    array [1]
        Over theta_i (and phi_i, if the table has it) and, last, the wavelengths; length 1 there for grey tables.

    Notes
    -----
    Exact for what `Table.lookup` returns: between nodes that is linear in each angle, so that the integral is a sum
    of the stored values with the integrals of the hat functions of their axes as weights.
    """
    theta_weights = _theta_weights(radians(table.axes_deg["theta_r"]))
    if table.anisotropic:
        phi_weights = _trapezoid_weights(radians(table.axes_deg["phi_r"]))
        brdf = table.brdf.reshape(*table.brdf.shape[:4], -1)
        return np.asarray(np.einsum("ipjkw,j,k->ipw", brdf, theta_weights, phi_weights, optimize=True))
    phi_weights = 2.0 * _trapezoid_weights(radians(table.axes_deg["delta_phi"]))  # the other half by symmetry
    brdf = table.brdf.reshape(*table.brdf.shape[:3], -1)
    return np.asarray(np.einsum("ijkw,j,k->iw", brdf, theta_weights, phi_weights, optimize=True))


def _trapezoid_weights(nodes: Axis) -> Axis:
    steps = np.diff(nodes)
    weights = np.zeros(nodes.size)
    weights[:-1] += steps / 2.0
    weights[1:] += steps / 2.0
    return weights


def _theta_weights(nodes: Axis) -> Axis:
    """Integrals of hat_j(theta) cos(theta) sin(theta) over [0, pi/2], the last hat held constant up to pi/2.

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


def _energy(table: Table) -> Energy:
    diffuse = directional_albedo(table)
    if table.anisotropic:
        diffuse = diffuse.max(axis=1)
    specular = np.zeros_like(diffuse) if table.specular is None else table.specular.reshape(diffuse.shape)
    albedo = diffuse + specular
    theta_i = table.axes_deg["theta_i"]
    finite = np.where(np.isfinite(albedo), albedo, np.inf)
    worst_theta, worst_wavelength = np.unravel_index(np.argmax(finite), finite.shape)
    largest = float(finite[worst_theta, worst_wavelength])
    exceeding = theta_i[np.any(finite > 1.0 + ENERGY_TOLERANCE, axis=1)]
    known: Mapping[str, Any] = table.attrs.get("known_excess") or MODELS[str(table.attrs["model"])].known_excess or {}
    verdict: Verdict
    if exceeding.size == 0:
        verdict, reason = "passes", ""
    elif known and largest <= known["max_albedo"] and exceeding[0] >= known["from_theta_i_deg"]:
        verdict, reason = "known published excess", str(known["citation"])
    else:
        share = f"{largest:.4g}" if np.isfinite(largest) else "no finite share"
        verdict, reason = "violates", f"reflects {share} of what arrives at {theta_i[worst_theta]:g} degrees"
    return Energy(
        theta_i_deg=theta_i.tolist(),
        wavelength_nm=None if table.wavelength_nm is None else table.wavelength_nm.tolist(),
        albedo=_json(albedo),
        specular=_json(specular),
        max_albedo=largest if np.isfinite(largest) else None,
        max_at_theta_i_deg=float(theta_i[worst_theta]),
        max_at_wavelength_nm=None if table.wavelength_nm is None else float(table.wavelength_nm[worst_wavelength]),
        exceeds_1_from_theta_i_deg=float(exceeding[0]) if exceeding.size else None,
        verdict=verdict,
        reason=reason,
    )


def _json(values: Floats) -> list[list[float | None]]:
    """Nested lists to seven digits, what a float32 holds; JSON has no number for what is not finite."""
    return [[float(f"{v:.7g}") if np.isfinite(v) else None for v in row] for row in values.tolist()]


def _reciprocity(table: Table) -> Reciprocity:
    rng = np.random.default_rng(1994)
    # uniform over the cosine up to the last node of the table
    lowest = np.cos(radians(min(table.axes_deg["theta_i"][-1], table.axes_deg["theta_r"][-1])))
    theta_i, theta_r = np.arccos(rng.uniform(lowest, 1.0, (2, MODEL_RECIPROCITY_PAIRS)))
    phi_i, phi_r = rng.uniform(0.0, 2.0 * np.pi, (2, MODEL_RECIPROCITY_PAIRS))
    forward, backward = (theta_i, phi_i, theta_r, phi_r), (theta_r, phi_r, theta_i, phi_i)
    model = _asymmetry(
        _model(table, forward), _model(table, backward), MODEL_RECIPROCITY_PAIRS, MODEL_RECIPROCITY_TOLERANCE
    )
    stored = _table_asymmetry(table)
    good = model.max <= model.tolerance and stored.max <= stored.tolerance
    return Reciprocity(model=model, table=stored, verdict="passes" if good else "violates")


def _table_asymmetry(table: Table) -> Asymmetry:
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
    pairs = f.size if table.wavelength_nm is None else f.size // table.wavelength_nm.size
    return _asymmetry(f, swapped, pairs, TABLE_RECIPROCITY_TOLERANCE)


def _model(table: Table, angles: tuple[NDArray[np.float64], ...]) -> Floats:
    """The model behind a table, at the table's wavelengths, from what the table says of itself."""
    fields = ("title", "model", "parameters", "source")
    material = Material.from_table(
        table.name,
        {
            **{field: table.attrs[field] for field in fields},
            "refractive_index": table.attrs["refractive_index"] or None,
        },
    )
    if table.wavelength_nm is not None:
        angles = tuple(angle[:, np.newaxis] for angle in angles)
    return material.spec.evaluate(*angles, **material.arguments(table.wavelength_nm))


def _asymmetry(f: Floats, swapped: Floats, pairs: int, tolerance: float) -> Asymmetry:
    differs = f != swapped  # nan does; hardly any other value, which saves the time of the rest
    f, swapped = f[differs].astype(np.float64), swapped[differs].astype(np.float64)
    with np.errstate(invalid="ignore"):  # what is not finite counts as 1
        relative = np.abs(f - swapped) / (np.abs(f) + np.abs(swapped))
    relative = np.where(np.isfinite(relative), relative, 1.0)
    mean, largest = float(relative.sum() / differs.size), float(relative.max(initial=0.0))
    return Asymmetry(pairs=pairs, mean=mean, max=largest, tolerance=tolerance)


def _values(table: Table) -> Values:
    stored = [table.brdf] if table.specular is None else [table.brdf, table.specular]
    finite = [np.isfinite(array) for array in stored]
    kept = [array[good] for array, good in zip(stored, finite, strict=True) if good.any()]
    negative = sum(int(np.count_nonzero(array < 0.0)) for array in kept)
    not_finite = sum(int(good.size - np.count_nonzero(good)) for good in finite)
    return Values(
        count=sum(array.size for array in stored),
        smallest=float(np.min(table.brdf[finite[0]])) if finite[0].any() else None,
        negative=negative,
        not_finite=not_finite,
        positivity="violates" if negative else "passes",
        finiteness="violates" if not_finite else "passes",
    )
