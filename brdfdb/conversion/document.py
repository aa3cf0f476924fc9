"""Types of the document of a conversion: parameters, the remaining error, and where it is worst."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from brdfdb.figure import DocumentPart
from brdfdb.materials import Material
from brdfdb.materials.provenance import Number
from brdfdb.materials.spectrum import Spectrum


class WorstView(DocumentPart):
    """The viewer for whom most light is in the wrong place, under light from everywhere."""

    theta_r_deg: float
    phi_r_deg: float
    l1: float = Field(description="l1 of this viewer, defined as the l1 of all viewers")
    wavelength_nm: float | None = Field(description="null: grey")
    theta_i_deg: float = Field(description="direction of the light whose reflection differs most")
    phi_i_deg: float
    before: float = Field(description="f_r of the source for this pair of directions, in 1/sr")
    after: float = Field(description="f_r of the model for it, in 1/sr")


class Peak(DocumentPart):
    """f_r in the mirror direction of one angle, in the plane through x, at the middle wavelength."""

    theta_deg: float
    before: float = Field(description="f_r of the source, in 1/sr")
    after: float = Field(description="f_r of the model, in 1/sr")


class Conversion(DocumentPart):
    """The parameters of a model that come closest to a source, and the remaining error."""

    source: str = Field(description="name of the source")
    source_model: str = Field(description="its model, or measured; empty for a function")
    model: str = Field(description="the model whose parameters were searched")
    weigh: Literal["light", "lightness"] = Field(description="what the search made least: l1, or that of cube roots")
    parameters: dict[str, Number | Spectrum] = Field(description="all parameters, angles in radians")
    n: float | None = Field(description="refractive index that was searched, too; null: none was")
    k: float | None
    fixed: list[str] = Field(description="parameters that were not searched")
    refractive_index: str | None = Field(description="entry of a spectral model")
    wavelengths_nm: list[float] | None = Field(description="wavelengths of the comparison; null: grey")
    l1: float = Field(
        description="integral of abs(after - before) cos theta_i cos theta_r over all pairs of directions, over that "
        "of before; the mean of all wavelengths. It is the share of the light in the wrong place, twice over; black "
        "has 1, and a model that reflects more than the source can have any"
    )
    l1_of: list[float] = Field(description="l1 at each wavelength")
    quadrature: float = Field(description="change of l1 with a coarser rule, an estimate of its error")
    p99: float = Field(description="99th percentile of abs(after - before) / max(before, floor), as charts have it")
    reflected: float = Field(description="mean albedo of the model over that of the source, mean of all wavelengths")
    specular_share: float = Field(description="share of the specular part (a Dirac delta) in the light of the source")
    peak: Peak
    worst_view: WorstView
    views_deg: list[float] = Field(description="theta_r of the viewers among whom the worst one was looked for")
    l1_of_views: list[float] = Field(description="l1 of each, the largest of all phi_r and wavelengths")
    as_good: dict[str, tuple[float, float]] = Field(
        description="range of each number among the sets of parameters that were tried and are within 1 % of the "
        "least distance: a wide range is that of a parameter that hardly matters"
    )
    remarks: list[str] = Field(description="sentences on what the model cannot carry")
    evaluations: int = Field(description="sets of parameters that were tried")
    material: Material = Field(description="the result as a material")
    recipe: str = Field(description="the material as a part of a recipe, [define.NAME] in TOML")

    @property
    def name(self) -> str:
        """The name of the material."""
        return self.material.name
