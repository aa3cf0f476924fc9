"""The record of measured data that their table keeps: origin, symmetries, errors, and what was changed."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.measurements.extent import Extent

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


class Noise(BaseModel):
    """Standard uncertainty of the samples as their file states it, relative to f_r or the floor."""

    model_config = _STRICT

    median: float
    p95: float


class Change(BaseModel):
    """A change that makes measured values keep a law, relative to the values before or to the floor."""

    model_config = _STRICT

    law: Literal["reciprocal", "conserving"]
    changed: Spread


class SimulationRecord(BaseModel):
    """The record of a simulation by rays on the facets of a surface, in place of a measurement."""

    model_config = _STRICT

    surface: str = Field(description="the surface in words")
    facets: str = Field(description="the reflection of its facets in words")
    slopes: list[float] = Field(
        description="standard deviations of the slopes of the facets that rays met: of a made surface along x and y, "
        "of a height map along its steepest axis and across it"
    )
    estimates: int = Field(description="realisations of a made surface, or estimates of the parts of a height map")
    rays: int = Field(description="light paths of an estimate")
    target: float = Field(description="relative standard error at which the simulation was to stop")
    standard_error: float = Field(
        description="largest relative standard error of the rays, where f_r exceeds a hundredth of its peak, for light "
        "and viewer up to 82.5 degrees"
    )
    standard_error_lowest: float = Field(description="the same, with light and viewer at 87 degrees")
    standard_error_of_map: float | None = Field(
        description="the same up to 82.5 degrees, for the surface that the height map is a part of; null: it was made"
    )
    lights_deg: list[float] = Field(description="polar angles of the lights whose albedos follow")
    one: list[float] = Field(description="share of the light that leaves after one bounce, mean over wavelengths")
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
        steepest, across = self.slopes
        albedo = self.one[0] + self.two[0] + self.further[0]
        shares = [100.0 * part[0] / max(albedo, 1e-300) for part in (self.one, self.two, self.further)]
        reached = "reached" if self.reached else "not reached"
        low = min(range(len(self.lights_deg)), key=lambda number: abs(self.lights_deg[number] - _LOW_DEG))
        lines = [
            f"simulated by rays: {self.surface}; {self.facets}{f'; {self.receivers}' if self.receivers else ''}",
            f"slopes of its facets: {steepest:.3g} and {across:.3g} (standard deviations)",
            f"albedo at normal light {albedo:.3g}: {shares[0]:.3g} % of it after one bounce, {shares[1]:.2g} % after "
            f"two, {shares[2]:.2g} % after more",
            f"light at {self.lights_deg[low]:g} degrees: {100.0 * self.in_shadow[low]:.2g} % of the area of the facets "
            f"facing it is in shadow",
            f"standard error at most {100.0 * self.standard_error:.2g} % of f_r up to 82.5 degrees, where f_r exceeds "
            f"a hundredth of its peak; the target of {100.0 * self.target:.2g} % was {reached} with {self.estimates} "
            f"estimates of {self.rays} light paths; with directions at 87 degrees at most "
            f"{100.0 * self.standard_error_lowest:.2g} %",
        ]
        if self.standard_error_of_map is not None:
            lines.append(
                f"the map is a part of a surface: for that, from its parts, the standard error is at most "
                f"{100.0 * self.standard_error_of_map:.2g} %{f'; {self.shadows}' if self.shadows else ''}"
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
        return None if self.noise is None else 2.6 * self.noise.p95

    def in_words(self) -> list[str]:
        """Return sentences on origin, errors, symmetries and changes."""
        known = "f_r of a file, between its values" if self.extent else "f_r of a file, everywhere"
        of = f"{self.samples} samples of {self.incidences} incidences" if self.samples else known
        lines = [f"{of}, channels {', '.join(self.channels)}{f'; {self.by}' if self.by else ''}"]
        if self.simulation is not None:
            lines += self.simulation.in_words()
        if self.file:
            lines.append(f"file {self.file}, sha256 {self.file_sha256[:_SHOWN]}...")
        if self.held_out is not None:
            held = self.held_out
            left = "one incidence" if held.scheme == "incidences" else f"one of {held.rounds} parts"
            lines.append(
                f"error at samples held out, {left} at a time: median {held.median:.2g}, 95 of 100 within "
                f"{held.p95:.2g}, 99 within {held.p99:.2g}, of f_r"
            )
        noise = "not stated" if self.noise is None else f"median {self.noise.median:.2g}, p95 {self.noise.p95:.2g}"
        lines.append(f"noise of the {'samples' if self.samples else 'file'}: {noise}")
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
            share = 1.0 - self.extrapolated
            words = f"{100.0 * share:.3g} %" if share >= _FEW else f"less than {100.0 * _FEW:g} %"
            lines.append(
                f"{words} of all pairs of directions were measured; elsewhere f_r is extrapolated, and its error is "
                "unknown"
            )
        if self.negative > 0.0:
            lines.append(f"{100.0 * self.negative:.3g} % of the values are below 0: f_r is 0 there")
        for change in self.changes:
            spread = change.changed
            lines.append(
                f"made {change.law}: changed by a median of {spread.median:.2g}, p99 {spread.p99:.2g}, "
                f"largest {spread.max:.2g}"
            )
        return lines
