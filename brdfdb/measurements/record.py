"""The record of measured data that their table keeps: origin, symmetries, errors, and what was changed."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from brdfdb.errors import counted, percent
from brdfdb.measurements.extent import Extent
from brdfdb.measurements.glints import Glints
from brdfdb.measurements.regions import Regions

_NORMAL_99 = 2.6  # standard deviations within which 99 of 100 values of normal noise lie
_FEW = 1e-3  # smallest share of directions that is shown: it is counted with a few thousand directions
_SHOWN = 12  # digits of a digest
_LOW_DEG = 60.0  # light whose shadows are stated in words

_STRICT = ConfigDict(frozen=True, extra="forbid")


class Spread(BaseModel):
    """Percentiles of some relative differences [1]."""

    model_config = _STRICT

    median: float
    p99: float
    max: float


class MeasuredSymmetry(BaseModel):
    """A symmetry of f_r, and how far the data keep to it: abs(f - f') / (abs(f) + abs(f'))."""

    model_config = _STRICT

    assumed: bool = Field(description="true if the table makes use of it")
    asymmetry: Spread | None = Field(
        description="of the f_r that is tabulated, interpolated between samples, over directions up to 80 degrees; "
        "of mirror images: of pairs of samples; null: the data cannot show it"
    )
    allowed: float | None = Field(description="largest asymmetry that their noise explains; null: not known")


class HeldOut(BaseModel):
    """Error of the interpolation at samples that it did not get, abs(f - sample) / max(f, floor); noise included."""

    model_config = _STRICT

    scheme: Literal["incidences", "folds"] = Field(
        description="incidences: all samples of one direction of the light at a time; folds: samples at random"
    )
    rounds: int = Field(description="how often samples were left out")
    samples: int = Field(description="samples that were left out, within the directions of the others")
    outside: int = Field(description="samples that were left out, outside of the directions of the others: not counted")
    floor: list[float] = Field(description="1/sr, for each channel: a thousandth of the mean f_r times cosine")
    l1: float = Field(description="sum of abs(error) over the sum of f_r")
    median: float
    p95: float
    p99: float
    max: float
    regions: Regions | None = Field(default=None, description="errors by region, noise included; null: not known")

    @model_validator(mode="before")
    @classmethod
    def _of_older_tables(cls, fields: Any) -> Any:
        """Leave out the errors by levels of f_r, which tables of older programs have in place of regions."""
        older = isinstance(fields, dict) and "p99_of_levels" in fields
        return {key: value for key, value in fields.items() if key != "p99_of_levels"} if older else fields


class WorstSample(BaseModel):
    """The sample from which the table at the same directions differs most."""

    model_config = _STRICT

    theta_i_deg: float
    phi_i_deg: float
    theta_r_deg: float
    phi_r_deg: float
    channel: str
    sample: float = Field(description="1/sr")
    table: float = Field(description="1/sr")
    error: float = Field(description="abs(table - sample) over the sample, or the floor of the errors")

    @property
    def sentence(self) -> str:
        """Return where and how much the table differs, in words."""
        light = f"theta_i {self.theta_i_deg:g}°, phi_i {self.phi_i_deg:g}°"
        viewer = f"theta_r {self.theta_r_deg:g}°, phi_r {self.phi_r_deg:g}°"
        return f"{percent(self.error)} at {light}, {viewer} ({self.sample:.4g} /sr; table {self.table:.4g} /sr)"


class IncidenceEnergy(BaseModel):
    """Trapezoid sums of f_r cos(theta_r) over the viewers of one incidence, in the channel that differs most.

    They are integrals over theta_r [rad] of viewers in a plane, and otherwise over the projected solid angle [sr].
    """

    model_config = _STRICT

    theta_i_deg: float
    phi_i_deg: float
    channel: str
    samples: float = Field(description="sum of the samples")
    table: float = Field(description="sum of the table at the directions of the samples")
    error: float = Field(description="abs(table - samples) over the samples")


class AtSamples(BaseModel):
    """The table, with its glints, at the samples' own directions."""

    model_config = _STRICT

    p95: float = Field(description="95th percentile of the relative differences from the samples, noise included")
    within: float = Field(default=0.0, description="share of the samples from which the table differs by at most 5 %")
    worst: WorstSample
    energies: list[IncidenceEnergy] = Field(
        description="for each incidence with viewers enough, those with the largest differences if there are many"
    )

    @property
    def worst_energy(self) -> IncidenceEnergy | None:
        """The incidence whose energy the table changes most; None without any."""
        return max(self.energies, key=lambda one: one.error, default=None)


class Noise(BaseModel):
    """Standard uncertainty of the samples, relative to f_r or the floor."""

    model_config = _STRICT

    median: float
    p95: float
    origin: Literal["stated", "repeats", "reciprocal pairs", "neighbours"] = Field(
        default="stated",
        description="stated by the file, or shown by samples that should be the same, or by neighbours",
    )


class Change(BaseModel):
    """A change that makes measured values keep a law, relative to the values before or to the floor."""

    model_config = _STRICT

    law: Literal["reciprocal", "conserving"]
    changed: Spread

    @property
    def sentence(self) -> str:
        """Return what was changed, in words."""
        text = f"made {self.law}: changed by a median of {self.changed.median:.2g}, p99 {self.changed.p99:.2g}, "
        return f"{text}largest {self.changed.max:.2g}"


class SimulationRecord(BaseModel):
    """The record of a simulation by rays on the facets of a surface, in place of a measurement."""

    model_config = _STRICT

    surface: str = Field(description="the surface in words")
    noise: str = Field(
        default="", description="noise of the instrument in a height map, and the filter, in words; empty: it was made"
    )
    facets: str = Field(description="the reflection of its facets in words")
    slopes: list[float] = Field(
        description="standard deviations of the slopes of the facets that rays met: of a made surface along x and y, "
        "of a height map along its steepest axis and across it"
    )
    realisations: int = Field(description="maps of a made surface, or repetitions of the parts of a height map")
    rays: int = Field(description="rays for each light in a realisation")
    target: float = Field(description="relative standard error at which the simulation was to stop")
    standard_error: float = Field(
        description="largest relative standard error of the rays, where f_r exceeds a hundredth of its peak, for light "
        "and viewer up to 82.5 degrees"
    )
    standard_error_lowest: float = Field(description="the same, with light and viewer at 87 degrees")
    standard_error_median: float = Field(
        default=0.0, description="median of the relative standard errors of which `standard_error` is the largest"
    )
    standard_error_of_map: float | None = Field(
        description="the same up to 82.5 degrees, for the surface that the height map is a part of; null: it was made"
    )
    lights_deg: list[float] = Field(description="polar angles of the lights whose albedos follow")
    spectral: bool = Field(description="true: the albedos are means over wavelengths")
    one: list[float] = Field(description="share of the light that leaves after one bounce")
    two: list[float] = Field(description="the same after two bounces")
    further: list[float] = Field(description="the same after more bounces")
    in_shadow: list[float] = Field(
        description="share of the area of the facets facing each of these lights that other facets shade; as much is "
        "masked from a viewer there"
    )
    receivers: str = Field(description="light that is a mean over directions around the viewer; empty: none is")
    shadows: str = Field(
        default="", description="directions whose shadows may be longer than the height map; empty: there are none"
    )

    @property
    def reached(self) -> bool:
        """True if the standard error is below its target."""
        return self.standard_error <= self.target

    def in_words(self) -> list[str]:
        """Return sentences on the surface, the light by bounces, and the standard error."""
        single = self.standard_error_of_map is not None
        axes = ("along the steepest axis", "across it") if single else ("along x", "along y")
        steep = " and ".join(f"{slope:.3g} {axis}" for slope, axis in zip(self.slopes, axes, strict=True))
        one, two, further = self.one[0], self.two[0], self.further[0]
        low = min(range(len(self.lights_deg)), key=lambda number: abs(self.lights_deg[number] - _LOW_DEG))
        return [
            f"simulated by rays: {self.surface}; {self.facets}{f'; {self.receivers}' if self.receivers else ''}",
            *([self.noise] if self.noise else []),
            f"rms slopes of the facets: {steep}",
            f"albedo for light along the normal{', mean over wavelengths' if self.spectral else ''}: "
            f"{one + two + further:.3f}, of which {one:.3f} after one bounce, {two:.3f} after two and {further:.3f} "
            "after more",
            f"light at {self.lights_deg[low]:g} degrees: {100.0 * self.in_shadow[low]:.2g} % of the area of the facets "
            "that face it lies in shadow",
            *self.errors_in_words(),
        ]

    def errors_in_words(self) -> list[str]:
        """Return sentences on the standard errors of the rays and of the map."""
        error, grazing, target = (
            f"{100.0 * value:.2g} %" for value in (self.standard_error, self.standard_error_lowest, self.target)
        )
        lines = [
            f"standard error of the rays, where f_r exceeds a hundredth of its peak: at most {error} of f_r up to 82.5 "
            f"degrees, {grazing} up to 87 degrees; the target of {target} up to 82.5 degrees was "
            f"{'reached' if self.reached else 'not reached'} with {self.realisations} realisations of {self.rays} rays "
            "for each light",
        ]
        if self.standard_error_of_map is not None:
            lines.append(
                f"standard error of the map as a sample of its surface, from its parts: at most "
                f"{100.0 * self.standard_error_of_map:.2g} % of f_r up to 82.5 degrees"
                f"{f'; {self.shadows}' if self.shadows else ''}"
            )
        return lines


class Measured(BaseModel):
    """The record of measured data in their table."""

    model_config = _STRICT

    by: str = Field(default="", description="who measured, and with which instrument; empty: the file does not say")
    file: str = Field(default="", description="name of the file; of joined files all, with commas between them")
    file_sha256: str = Field(default="", description="sha256 of the file, or of each of the files")
    channels: list[str] = Field(description="channels of the data")
    samples: int = Field(description="number of samples; 0: f_r is that of a file between its values")
    incidences: int = Field(default=0, description="number of directions of the light")
    holes: int = Field(default=0, description="number of values that are missing")
    negative: float = Field(description="share of the values below 0; f_r is 0 there")
    interpolation: str = Field(description="the way from samples to f_r everywhere, in words")
    reciprocity: MeasuredSymmetry
    mirror: MeasuredSymmetry | None = Field(
        description="f_r of an isotropic surface and of its mirror image; null: f_r changes when the surface is turned"
    )
    extrapolated: float | None = Field(
        default=None,
        description="share of all pairs of directions that were not measured; null: f_r is known everywhere",
    )
    extent: Extent | None = Field(
        default=None, description="directions that were measured, without holes; null: f_r is known everywhere"
    )
    held_out: HeldOut | None = Field(default=None, description="null: f_r is known everywhere")
    at_samples: AtSamples | None = Field(
        default=None, description="the table at the samples' own directions; null: f_r is known everywhere"
    )
    outliers: list[str] = Field(
        default_factory=list, description="samples that f_r does not pass through, as their neighbours deny them"
    )
    doubts: list[str] = Field(default_factory=list, description="what looks wrong in the file, as its statement says")
    glints: Glints | None = Field(
        default=None, description="peaks that the values of the table leave out, and lookups add; null: there are none"
    )
    noise: Noise | None = Field(default=None, description="null: not known")
    changes: list[Change] = Field(default_factory=list)
    simulation: SimulationRecord | None = Field(default=None, description="null: an instrument measured, or a renderer")

    @property
    def chiral(self) -> bool:
        """Return True if a turn of the surface leaves f_r as it is, and its mirror image does not.

        Isotropic tables are their own mirror image: those of such data are anisotropic ones, the same at each turn.
        """
        return self.mirror is not None and not self.mirror.assumed

    @property
    def uncertainty(self) -> float | None:
        """Return the relative uncertainty [1] that 99 of 100 values keep to; None if nothing is known of it.

        Errors at samples that were held out have the noise of the samples in them.
        """
        if self.held_out is not None:
            return self.held_out.p99
        return None if self.noise is None else _NORMAL_99 * self.noise.p95

    def error_of(
        self,
        f_r: NDArray[np.floating[Any]],
        wi: NDArray[np.float64],
        wr: NDArray[np.float64],
        floor: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the uncertainty [1/sr] of f_r (N, L) that 99 of 100 values keep to; 0 if nothing is known of it.

        It is that of the region of unit vectors (N, 3) of light and viewer. Errors are relative to the `floor` (L,)
        [1/sr] at least. All samples of a simulation share their rays: those that were held out do not show their common
        noise, which is added.
        """
        held = self.held_out
        if held is None or held.regions is None:
            return np.asarray((self.uncertainty or 0.0) * np.maximum(f_r, floor), np.float64)
        relative = held.regions.p99(wi, wr)[:, np.newaxis]
        common = 0.0 if self.simulation is None else _NORMAL_99 * self.simulation.standard_error_median
        floor = np.maximum(floor, min(held.floor))
        return np.asarray(np.hypot(relative, common) * np.maximum(f_r, floor), np.float64)

    @property
    def origin(self) -> str:
        """The word for data of this kind: measured or simulated."""
        return "measured" if self.simulation is None else "simulated"

    @property
    def share(self) -> str:
        """The share of all pairs of directions that were measured, in words; empty: f_r is known everywhere."""
        if not self.extrapolated:
            return ""
        share = 1.0 - self.extrapolated
        return f"{100.0 * share:.2g} %" if share >= _FEW else f"less than {100.0 * _FEW:g} %"

    @property
    def where(self) -> str:
        """Basis of a verdict, such as "where measured, 1.4 %"; empty: f_r is known everywhere."""
        return f"where {self.origin}, {self.share}" if self.share else ""

    def in_words(self) -> list[str]:
        """Return sentences on origin, errors, symmetries and changes."""
        known = "f_r of a file, between its values" if self.extent else "f_r of a file, everywhere"
        of = f"{counted(self.samples, 'sample')} of {counted(self.incidences, 'incidence')}" if self.samples else known
        lines = [f"{of}, channels {', '.join(self.channels)}{f'; {self.by}' if self.by else ''}"]
        if self.simulation is not None:
            lines += self.simulation.in_words()
        if self.file:
            lines.append(f"file {self.file}, sha256 {self.file_sha256[:_SHOWN]}...")
        lines += [f"doubt: {sentence}" for sentence in self.doubts]
        if self.held_out is not None:
            held = self.held_out
            left = "one incidence" if held.scheme == "incidences" else f"one of {held.rounds} parts"
            lines.append(
                f"error at samples held out, {left} at a time: median {held.median:.2g}, 95 of 100 within "
                f"{held.p95:.2g}, 99 within {held.p99:.2g}, of f_r"
            )
            if held.regions is not None:
                lines.append(held.regions.sentence)
        if self.at_samples is not None:
            lines.append(
                f"table at the samples: 95 of 100 within {self.at_samples.p95:.2g}; largest difference "
                f"{self.at_samples.worst.sentence}"
            )
            energy = self.at_samples.worst_energy
            if energy is not None:
                lines.append(
                    f"energy of each incidence, summed over its samples: within {percent(energy.error)} (at "
                    f"{energy.theta_i_deg:g} degrees: {energy.samples:.4g}; table {energy.table:.4g})"
                )
        lines += [self.glints.sentence] if self.glints is not None and self.glints.lit else []
        lines += self.outliers
        noise = "not stated" if self.noise is None else f"median {self.noise.median:.2g}, p95 {self.noise.p95:.2g}"
        shown = "" if self.noise is None or self.noise.origin == "stated" else f", from {self.noise.origin}"
        lines.append(f"noise of the {'samples' if self.samples else 'file'}: {noise}{shown}")
        for name, symmetry in (("reciprocity", self.reciprocity), ("mirror symmetry", self.mirror)):
            if symmetry is not None:
                seen = symmetry.asymmetry
                how = (
                    "the data cannot tell"
                    if seen is None
                    else f"asymmetry of f_r between samples: median {seen.median:.2g}, p99 {seen.p99:.2g}"
                    if self.samples
                    else f"asymmetry median {seen.median:.2g}, p99 {seen.p99:.2g}"
                )
                lines.append(f"{name} {'assumed' if symmetry.assumed else 'not assumed'}: {how}")
        if self.extrapolated is not None:
            known = f"{self.share or '100 %'} of all pairs of directions were {self.origin}"
            lines.append(f"{known}; elsewhere f_r is extrapolated, and its error is unknown")
        if self.negative > 0.0:
            lines.append(f"{100.0 * self.negative:.3g} % of the values are below 0: f_r is 0 there")
        return lines + [change.sentence for change in self.changes]
