"""What an audit finds, as data: the types of the report."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.figure import Figure, Map, Numbers

Verdict = Literal["passes", "known published excess", "accepted excess", "violates"]

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


class TableEnergy(BaseModel):
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
    hemispherical: Numbers = Field(
        description="[wavelength], of light that is the same from everywhere, albedo taken as linear between theta_i"
    )
    bands: Bands | None = Field(description="null: the table states no error, and is allowed none")
    max_albedo: float | None = Field(description="null: not finite")
    max_at_theta_i_deg: float
    max_at_wavelength_nm: float | None
    exceeds_1_from_theta_i_deg: float | None = Field(description="to 0.001 degrees")
    exceeds_1_beyond_error_from_theta_i_deg: float | None = Field(
        description="where neither the stated error nor that of the integration explains it"
    )
    verdict: Verdict
    reason: str = Field(description="also where a table passes because of the error that it states")


class Asymmetry(BaseModel):
    """abs(f - f') / (abs(f) + abs(f')) over pairs of directions, f' with light and viewer exchanged."""

    model_config = _STRICT

    pairs: int
    min: float
    mean: float
    max: float
    tolerance: float | None = Field(description="of max; null: not judged, the two are interpolated from other nodes")


class Reciprocity(BaseModel):
    """Asymmetry of the model at the parameters of the table, and of the table.

    Tables are looked up; to values that are interpolated in logarithms the offset of the logarithms is added.
    """

    model_config = _STRICT

    model_random: Asymmetry = Field(description="viewers over the hemisphere")
    model_lobe: Asymmetry | None = Field(description="viewers in the lobe and on its shoulder; null: it has none")
    table_random: Asymmetry
    table_lobe: Asymmetry | None
    table_nodes: Asymmetry | None = Field(
        description="over every pair that the grid holds both ways round; null: half and difference vectors hold none"
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


class Nodes(BaseModel):
    """The numbers that a table stores, beside those that its model gives at the same nodes."""

    model_config = _STRICT

    compared: int = Field(description="of the stored numbers; of large tables those of some rows of the first axis")
    count: int = Field(description="of the stored numbers")
    wrong: int = Field(description="of those compared, by more than rounding")
    stored: float | None = Field(description="the number that is furthest off; null: none is, or it is not finite")
    expected: float | None = Field(description="what the model gives in its place")
    beside: list[str] = Field(
        description="a sentence each on n, k and the uniform part, where they are not those of entry and parameters"
    )
    verdict: Verdict


EnergyVerdict = Literal["conserves", "loses", "known published excess", "accepted excess", "violates"]
Standing = Literal["inside", "at the edge", "outside", "unknown"]


class Furnace(BaseModel):
    """The white furnace: the model made lossless, in light that is the same from everywhere; an ideal one shows 1."""

    model_config = _STRICT

    lossless: str = Field(description="which parameters were set to what")
    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: grey; of many wavelengths the ends and the middle")
    albedo: list[Numbers] = Field(description="[theta_i][wavelength], Dirac part included")
    hemispherical: Numbers = Field(description="[wavelength], the mean over uniform light")
    smallest: float | None = Field(description="null: not finite")
    smallest_at_theta_i_deg: float
    largest: float | None = Field(description="null: not finite")
    largest_at_theta_i_deg: float


class UniformBound(BaseModel):
    """The largest uniform diffuse part a(lambda) that conserves energy at all angles, against the material's own."""

    model_config = _STRICT

    wavelength_nm: list[float]
    largest: Numbers
    preset: Numbers
    keeps: bool = Field(description="whether the material's own is no larger at any wavelength")


class ModelEnergy(BaseModel):
    """Directional albedo of the model behind a table, by adaptive quadrature, Dirac part included."""

    model_config = _STRICT

    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: grey")
    albedo: list[Numbers] = Field(description="[theta_i][wavelength]; over the azimuths of the light the largest")
    specular: list[Numbers] = Field(description="[theta_i][wavelength], the share of the Dirac part in it")
    integration_error: float | None = Field(description="of the albedo, the largest estimate; null: not finite")
    hemispherical: Numbers = Field(description="[wavelength], of light that is the same from everywhere")
    max_albedo: float | None = Field(description="null: not finite")
    max_at_theta_i_deg: float
    max_at_wavelength_nm: float | None
    exceeds_1_from_theta_i_deg: float | None = Field(description="to 0.001 degrees")
    furnace: Furnace | None = Field(description="null: the model has no lossless parameters")
    bound_on_a: UniformBound | None = Field(description="null: not a He-Torrance material")
    verdict: EnergyVerdict
    reason: str = Field(description="how much, where; of a known excess the citation")


class Energy(BaseModel):
    """What the model behind a table does with light, and what the table makes of it."""

    model_config = _STRICT

    model: ModelEnergy
    table: TableEnergy
    verdict: EnergyVerdict = Field(description="the worse of the two")
    reason: str = Field(description="of the one that is worse")


class Jump(BaseModel):
    """How far f_r jumps across a seam, relative to its value there, or to the floor of the error of a table.

    It is the crossing that jumps most for what is allowed there. A slope is no jump: the value on either side is that
    of the line through two points next to the seam.
    """

    model_config = _STRICT

    seam: str = Field(description="what is crossed")
    crossings: int
    largest: float
    where: str = Field(description="of the largest: the directions in degrees, and the wavelength")
    tolerance: float = Field(description="there; of a table the error that it states of the band of theta_i")


class Smoothness(BaseModel):
    """Jumps of the model across its branches, and of the table across the seams of its grid."""

    model_config = _STRICT

    model: list[Jump]
    table: list[Jump]
    verdict: Verdict


Statistic = Literal["l1", "median", "p95", "p99", "max", "floor"]


class Disagreement(BaseModel):
    """One number of the error that a table states, which chance does not reconcile with fresh directions."""

    model_config = _STRICT

    statistic: Statistic
    theta_i_deg: tuple[float, float] = Field(description="ends of the band; 0 and 90: of all directions")
    wavelength_nm: float | None = Field(description="null: the table is grey")
    stated: float
    fresh: float | None = Field(description="null: not finite")
    times: float | None = Field(description="the larger over the smaller; null: not finite")


class TableError(BaseModel):
    """The table less the model, over planes of incidence, and at fresh directions against what the table states."""

    model_config = _STRICT

    stated_p99: float | None = Field(description="null: the table states no error, and none is asked of it")
    fresh_p99: float | None = Field(description="null: not finite")
    specular: float | None = Field(
        description="largest difference of the stored reflectances of the Dirac part from the model's; null: no Dirac "
        "part, or not finite"
    )
    directions: int
    contradictions: list[str] = Field(description="what of the statement contradicts itself, a sentence each")
    disagreements: int = Field(description="numbers of the statement that fresh directions contradict")
    worst: list[Disagreement] = Field(description="of these, of each statistic the one that is furthest off")
    bias: float | None = Field(
        description="signed: integral of (table - model) cos theta_r over that of the model, mean of all directions at "
        "the wavelength where it is largest; null: not finite"
    )
    likeness: str = Field(description="what the table agrees with much better than with its model; empty: nothing")
    maps: list[Map] = Field(description="relative error over theta_i and theta_r, negative back towards the light")
    verdict: Verdict


class Sampling(BaseModel):
    """The sampler of the model at the parameters of the material, for some lights."""

    model_config = _STRICT

    samples: int = Field(description="of each light")
    theta_i_deg: list[float]
    phi_i_deg: float
    wavelength_nm: float | None
    chi_square_p: Numbers = Field(description="probability of a worse histogram if the density is right")
    largest_weight: Numbers
    weight_spread: Numbers = Field(description="standard deviation of the weights over their mean")
    monte_carlo: Numbers = Field(description="albedo without the Dirac part")
    monte_carlo_error: Numbers = Field(description="its standard error")
    quadrature: Numbers
    verdict: Verdict


class Limit(BaseModel):
    """One limit that a paper states of its model, and where a material stands."""

    model_config = _STRICT

    quantity: str
    value: str = Field(description="of the material")
    valid: str = Field(description="what was taken as inside and as the edge, where the paper gives no number")
    standing: Standing = Field(description="unknown: the material does not say")
    words: str = Field(description="of the paper")
    where: str


class Validity(BaseModel):
    """All limits of a model that its paper states."""

    model_config = _STRICT

    limits: list[Limit]
    standing: Standing = Field(description="the worst of those that are known; inside: no limit is stated")


class MaterialAudit(BaseModel):
    """All findings on one revision of one material."""

    model_config = _STRICT

    material: str
    revision: str
    model: str
    energy: Energy
    reciprocity: Reciprocity
    values: Values
    nodes: Nodes
    smoothness: Smoothness
    table_error: TableError
    sampling: Sampling
    validity: Validity = Field(description="no part of the verdict: what a paper tabulates is audited as it is")
    verdict: Verdict = Field(description="the worst of the findings")


class AuditReport(BaseModel):
    """The audit of a store."""

    model_config = _STRICT

    format: Literal["brdfdb-audit"] = "brdfdb-audit"
    version: Literal[4] = 4
    store: str = Field(description="its directory")
    brdfdb: str = Field(description="version of the library")
    when: datetime
    materials: list[MaterialAudit]
    atlas: list[Figure] = Field(description="where methods fail: forms of the models against high-precision values")
    gallery: list[Figure] = Field(description="the figures of the papers, computed")
    damaged: list[str] = Field(description="a sentence on each table that is damaged, and was not audited")
    violations: list[str] = Field(
        description="names of the materials that violate something that is neither known as published nor accepted"
    )
