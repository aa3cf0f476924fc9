"""Types of the documents of charts: forms with their errors and costs, fronts, ladders and samplers."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.forms.catalogue import Kind, LeftOut
from brdfdb.materials.provenance import Number
from brdfdb.materials.spectrum import Spectrum


class _Record(BaseModel):
    """A part of the document: immutable, without keys that it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Cost(_Record):
    """Time of an evaluation on one thread of the machine that made the chart."""

    ns: float = Field(description="median over all rounds of the time of a value of f_r: one direction, one wavelength")
    low: float = Field(description="lower quartile")
    high: float = Field(description="upper quartile")
    directions: int = Field(description="number of directions evaluated at once")


class Form(_Record):
    """A form and its costs."""

    key: str
    title: str
    kind: Kind
    python: str = Field(description="name in Python")
    dtype: Literal["float64", "float32"]
    bytes: int = Field(description="size of the numbers that an evaluation reads")
    batch: Cost = Field(description="cost with 100 000 directions at once; slow forms get fewer")
    block: Cost = Field(description="cost with 256 directions at once")
    single: Cost = Field(description="cost with one direction")


class Saving(_Record):
    """A ratio of times within rounds."""

    low: float = Field(description="lower quartile")
    times: float = Field(description="median")
    high: float = Field(description="upper quartile")


class Point(Form):
    """A form with its errors, which are relative to the truth, at the worst wavelength."""

    l1: float = Field(description="mean of abs(f_r - truth) over the mean of the truth, weighted with the cosine")
    p99: float = Field(description="99th percentile of abs(f_r - truth) / max(truth, floor)")
    p99_low: float = Field(description="lower end of the 95 % confidence interval of p99, an order statistic")
    p99_high: float | None = Field(description="upper end; null if there are too few directions")
    forward: float = Field(description="l1 for viewers within 45 degrees of the azimuth of the mirror direction")
    back: float = Field(description="l1 for viewers within 45 degrees of the azimuth of the light")
    grazing: float = Field(description="l1 where light or viewer is beyond 75 degrees")
    mixed: Cost = Field(
        description="cost with 64 materials in turn, 32 directions of each, read from memory and not from caches"
    )
    rung: str | None = Field(
        description="key of the cheapest rung of the truth as accurate in l1 and p99; null for the truth and its rungs"
    )
    saving: Saving | None = Field(description="time of that rung over the time of this form, in batches")


class Work(_Record):
    """Noise and time of a Monte Carlo estimate."""

    variance: float = Field(description="variance of one sample over the square of the mean; median over rounds")
    ns: float = Field(description="time of one sample; median over rounds")
    low_ms: float = Field(description="time to a standard deviation of 1 %: lower quartile over rounds")
    ms: float = Field(description="median")
    high_ms: float = Field(description="upper quartile")


class Sampler(_Record):
    """A way to draw directions, for the model of the material at its middle wavelength, without the specular part."""

    key: str
    title: str
    albedo: Work = Field(description="work for the directional albedo of light from 60 degrees")
    sphere: Work = Field(description="work for the picture of a sphere under a sky and a lamp about 20 degrees wide")


class Fronts(_Record):
    """Keys of the points worth having, the most accurate (l1) first, each clearly cheaper than the one before.

    Models that are meant to differ are left out, and so are forms with a larger error than black.
    """

    batch: list[str]
    single: list[str]
    bytes: list[str]


class Chart(_Record):
    """One material."""

    material: str
    title: str
    model: str
    parameters: dict[str, Number | Spectrum] = Field(description="angles in degrees, under names that end in _deg")
    wavelength_nm: list[float] | None
    directions: int = Field(description="number of directions at which errors are measured")
    truth: str = Field(description="key of the point that the others are compared with")
    points: list[Point]
    ladder: list[str] = Field(description="keys of the truth and of its rungs, the most accurate (l1) first")
    fronts: Fronts
    samplers: list[Sampler]
    left_out: list[LeftOut] = Field(default=[], description="forms that cannot be made, such as a table too large")


class Curve(Form):
    """A form along a family. Errors are those of a point, and bytes and costs are those of one member."""

    timed: str = Field(description="timed member: the one with this form that is nearest the middle of the family")
    l1: list[float | None] = Field(description="l1 of each member; null where there is no such form")
    p99: list[float | None]


class Between(Form):
    """Lookups between the members of a family in a store, timed in its middle."""

    l1: float = Field(description="l1 that the family states, over all its parameters")
    p99: float


class Diagnostic(_Record):
    """A number that shows the regime of the model of a member, at the middle wavelength."""

    symbol: str
    title: str
    values: list[float] = Field(description="value of each member")


class LeftOutOfMember(LeftOut):
    """A form that cannot be made of a member of a family."""

    member: str


class FamilyChart(_Record):
    """A family: the forms worth having at each of its members."""

    family: str
    title: str
    model: str
    axes: dict[str, list[float]] = Field(description="values of each swept parameter, as in the record of a family")
    members: list[str] = Field(description="names of the materials; the last axis runs fastest")
    diagnostic: Diagnostic | None = Field(description="null unless the model names one")
    wavelength_nm: list[float] | None
    truth: str = Field(description="key of the curve that the others are compared with")
    curves: list[Curve]
    between: Between | None = Field(description="null unless the family is in the store")
    fronts: list[list[str]] = Field(
        description="for each member, keys of the curves worth having in bulk, as in a chart, with the costs above"
    )
    left_out: list[LeftOutOfMember] = Field(default=[], description="forms that cannot be made of a member")


class Charts(_Record):
    """Charts of materials and families from one run. A file holds one of them."""

    brdfdb: str
    when: datetime
    machine: str
    charts: list[Chart]
    families: list[FamilyChart]
