"""Where a material stands in the range that a paper states of its model, in the paper's own words.

Where a paper says "much less" and no number, a tenth is inside, and what is less, but not by that much, at the edge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from pydantic import BaseModel, Field

from brdfdb.audit.finding import RANKS, STRICT, Cell, Finding, Sentence, Subject
from brdfdb.geometry import degrees
from brdfdb.materials import Material
from brdfdb.tables.grids import Axis

Standing = Literal["inside", "at the edge", "outside", "unknown"]

_MUCH = 10.0
_WARD_ALPHA, _MUCH_GREATER = 0.2, 2.0  # "not much greater" is less than twice
_BEYOND, _FAR_BEYOND = 0.01, 0.1  # shares of a Gaussian of slopes that lie beyond 90 degrees
_OPAQUE = 1.0 / (4.0 * math.pi)  # k of what absorbs within a wavelength
_GENTLE = "Simplifications result by making the local tangent-plane approximation and assuming gentle roughness slopes."
_CHALLENGED = "the large ratio of σ_0/τ challenges the gentle slope assumption of the model"
_ORDER: tuple[Standing, ...] = ("inside", "at the edge", "outside")


class Limit(BaseModel):
    """One limit that a paper states of its model, and where a material stands."""

    model_config = STRICT

    quantity: str
    value: str = Field(description="of the material")
    valid: str = Field(description="what was taken as inside and as the edge, where the paper gives no number")
    standing: Standing = Field(description="unknown: the material does not say")
    words: str = Field(description="of the paper")
    where: str


class Validity(Finding):
    """All limits of a model that its paper states. The verdict on the table does not count them."""

    key = "validity"
    title = "Validity"
    columns = ("validity",)
    explanation = (
        "Whether the parameters lie inside what the paper of the model says it is good for. Where it says “gentle” "
        "or “much less” and no number, a tenth is taken for inside, and 1 for the edge. The verdict on a table does "
        "not count this: what a paper tabulates is audited as it is."
    )

    limits: list[Limit]
    verdict: Standing = Field(description="worst of those that are known; inside: no limit is stated")

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Judge the parameters of the model of a table."""
        if not isinstance(subject.source, Material):
            return subject.not_judged("limits are those of the model of the source")
        return validity_of(subject.source, subject.table.wavelength_nm)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on all limits, and one on each in the words of the paper."""
        standings = [limit.standing for limit in self.limits]
        kept = ", ".join(f"{standings.count(word)} {word}" for word in dict.fromkeys(standings))
        limits = "1 limit" if len(standings) == 1 else f"{len(standings)} limits"
        text = f"of {limits} that its paper states {kept}" if kept else "its paper states no limits"
        return [
            self.sentence(self.verdict, text),
            *(
                self.sentence(
                    limit.standing,
                    f"{limit.value} ({limit.valid})",
                    title=limit.quantity[:1].upper() + limit.quantity[1:],
                    quote=limit.words,
                    where=limit.where,
                )
                for limit in self.limits
            ),
        ]

    def cells(self) -> list[Cell]:
        """Return the number of limits that are not kept well inside."""
        edges = sum(limit.standing in ("at the edge", "outside") for limit in self.limits)
        return [Cell(self.verdict, f"{edges} of {len(self.limits)} limits" if edges else "", -RANKS[self.verdict])]


def validity_of(material: Material, wavelength_nm: Axis | None) -> Validity:
    """The limits of the model, judged at the wavelengths [nm] of the table where they depend on them."""
    stated = _STATED.get(material.model)
    limits = [] if stated is None else stated(material, wavelength_nm)
    known = [limit.standing for limit in limits if limit.standing != "unknown"]
    return Validity(limits=limits, verdict=max(known, key=_ORDER.index, default="inside"))


def _standing(value: float, inside: float, edge: float) -> Standing:
    """Of what must be small."""
    return "inside" if value <= inside else "at the edge" if value < edge else "outside"


def _he_torrance(material: Material, wavelength_nm: Axis | None) -> list[Limit]:
    sigma, tau, a = (float(material.parameters[name]) for name in ("sigma_0_um", "tau_um", "a"))
    arguments = material.arguments(wavelength_nm)
    longest = float(arguments["wavelength_nm"].max()) / 1000.0
    slope, k = sigma / tau, float(np.min(arguments["k"]))
    # Of Gaussian heights with eq. 48 the second derivative along a line has the variance 12 sigma_0^2 / tau^4
    radius = math.inf if sigma == 0.0 else tau * tau / (math.sqrt(12.0) * sigma)
    phase = (4.0 * math.pi * sigma / longest) ** 2
    gentle = _standing(slope, 1.0 / _MUCH, 1.0)
    rough: Standing = "inside" if phase >= _MUCH else "at the edge" if phase > 1.0 else "outside"
    first_surface: Standing = "inside" if a > 0.0 else gentle if k >= _OPAQUE else "outside"
    return [
        Limit(
            quantity="slope sigma_0 / tau",
            value=f"{slope:.3g}",
            valid="up to 0.1, at the edge below 1",
            standing=gentle,
            words=_GENTLE if gentle != "outside" else _CHALLENGED,
            where="He et al. 1991, section " + ("3.1" if gentle != "outside" else "4, of sandpaper"),
        ),
        Limit(
            quantity="very rough, (v_z sigma_0)^2 at normal incidence, or gentle, sigma_0 / tau",
            value=f"{phase:.3g} at {1000.0 * longest:g} nm, or {slope:.3g}",
            valid="at least 10, at the edge above 1; or up to 0.1, at the edge below 1",
            standing=min(rough, gentle, key=_ORDER.index),
            words="can be approximately evaluated under either of the following two conditions: [...] "
            "the surface is very rough [...] the surface has gentle slopes",
            where="He et al. 1991, appendix A.4, below eq. 49",
        ),
        Limit(
            quantity="rms radius of curvature / wavelength",
            value="infinite" if sigma == 0.0 else f"{radius / longest:.3g} at {1000.0 * longest:g} nm",
            valid="at least 10, at the edge above 1",
            standing=_standing(longest / radius, 1.0 / _MUCH, 1.0),
            words="The approximation is valid when the local radius of curvature of the surface is large compared to "
            "the wavelength.",
            where="He et al. 1991, section 2.2",
        ),
        Limit(
            quantity="reflections but the first",
            value=f"a = {a:g}, k = {k:.3g}, sigma_0 / tau = {slope:.3g}",
            valid="a above 0, or k at least 1 / (4 pi) and gentle slopes",
            standing=first_surface,
            words="This contribution is small for metallic (opaque) surfaces with shallow roughness slopes. However, "
            "the contribution can be important for surfaces with large slopes, or for nonmetals",
            where="He et al. 1991, section 3.2.3",
        ),
    ]


def _ward(material: Material, _: Axis | None) -> list[Limit]:
    values = {name: float(value) for name, value in material.parameters.items()}
    alpha, total = max(values["alpha_x"], values["alpha_y"]), values["rho_d"] + values["rho_s"]
    return [
        Limit(
            quantity="alpha, the larger of the two",
            value=f"{alpha:.3g}",
            valid="up to 0.2, at the edge below 0.4",
            standing=_standing(alpha, _WARD_ALPHA, _MUCH_GREATER * _WARD_ALPHA),
            words="is accurate as long as α is not much greater than 0.2, when the surface becomes mostly diffuse.",
            where="Ward 1992, section 4.1, of the normalization factor of eq. 4",
        ),
        Limit(
            quantity="rho_d + rho_s",
            value=f"{total:.3g}",
            valid="below 1, at the edge 1",
            standing="inside" if total < 1.0 else "at the edge" if total == 1.0 else "outside",
            words="As long as the total reflectance, ρ_d + ρ_s, is less than 1 and the two α's are not too large, "
            "Equation 5 will yield a physically valid reflectance function.",
            where="Ward 1992, section 4.2",
        ),
    ]


def _facets(*_: object) -> list[Limit]:
    return [
        Limit(
            quantity="area of facets / wavelength^2",
            value="not a parameter of the model",
            valid="at least 10",
            standing="unknown",
            words="Further, the facet area is large compared to the wavelength λ of incident light and therefore "
            "geometrical optics can be used to derive the reflectance model.",
            where="Oren and Nayar 1994, section 3, with eq. 5",
        )
    ]


def _oren_nayar(material: Material, _: Axis | None) -> list[Limit]:
    sigma = float(material.parameters["sigma"])
    beyond = 0.0 if sigma == 0.0 else math.erfc(math.pi / 2.0 / (sigma * math.sqrt(2.0)))
    return [
        *_facets(),
        Limit(
            quantity="share of the Gaussian of slopes that lies beyond 90 degrees",
            value=f"{100.0 * beyond:.2g} % with sigma = {degrees(sigma):.3g} degrees",
            valid="up to 1 %, at the edge below 10 %",
            standing=_standing(beyond, _BEYOND, _FAR_BEYOND),
            words="If the surface is extremely rough, causing the zero-mean Gaussian model to be an inaccurate "
            "approximation, an additional parameter can be used to weight the interreflection component.",
            where="Oren and Nayar 1994, section 4.3, below eq. 29",
        ),
    ]


_STATED: dict[str, Callable[[Material, Axis | None], list[Limit]]] = {
    "he_torrance": _he_torrance,
    "ward": _ward,
    "ward_half_vector": _ward,
    "oren_nayar": _oren_nayar,
    "oren_nayar_qualitative": _oren_nayar,
    "oren_nayar_gaussian": _oren_nayar,
    "oren_nayar_body_surface": _oren_nayar,
    "oren_nayar_single_slope": _facets,
    "oren_nayar_unidirectional": _facets,
}
