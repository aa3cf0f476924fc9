"""Models of a measured surface: materials with its statistics, and which assumptions of each model it meets."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.materials import Material, presets
from brdfdb.materials.recipe_text import rounded, toml_of
from brdfdb.materials.stated_limits import limits_of
from brdfdb.microgeometry.topography import Moments, SurfaceStatistics
from brdfdb.parameters import Standing, StatedLimit, standing
from brdfdb.refractive_indices import refractive_index
from brdfdb.roughness import alpha_from_slope

WAVELENGTHS_NM = (550.0, 10600.0)  # green light, and that of a carbon dioxide laser
UNKNOWN_INDEX = "constant/1.5/0"  # n and k of a surface of an unknown substance
RHO = 0.5  # albedo of the facets of Oren and Nayar where it is not known
_TOLERANCE = 0.05  # of the recipe
_MUCH = 10.0  # ratio that is "much greater"
_ROUND = 1.2  # ratio of slopes up to which an anisotropic surface is nearly isotropic


class SpatialBand(NamedTuple):
    """Roughness that a map shows, and directions into which it scatters light that falls along the normal.

    Attributes
    ----------
    wavelength_nm : float [nm]
        Wavelength of the light.
    nearest_deg, farthest_deg : float [degree]
        Polar angles between which the roughness that scatters the light is seen: its spatial wavelength, lambda /
        sin(theta_r), is at most the length of the map and at least two steps of the grid.
    everywhere : bool
        True if this holds for all directions of light and viewer, whose least spatial wavelength is lambda / 2.
    """

    wavelength_nm: float
    nearest_deg: float
    farthest_deg: float
    everywhere: bool


class ModelStanding(NamedTuple):
    """The assumptions of a model for a surface at a wavelength.

    Attributes
    ----------
    model : str
        Name of the model.
    wavelength_nm : float [nm]
        Wavelength of the light.
    limits : list of StatedLimit
        Assumptions, and whether the surface meets them.
    """

    model: str
    wavelength_nm: float
    limits: list[StatedLimit]

    @property
    def worst(self) -> Standing:
        """Return the standing of the limit that is met least; unknown limits do not count."""
        order: tuple[Standing, ...] = ("outside", "at the edge", "inside")
        found = {limit.standing for limit in self.limits}
        return next((one for one in order if one in found), "unknown")


def phase_variance(surface: SurfaceStatistics, wavelength_nm: float, cos_i: float = 1.0) -> float:
    """Return g [1] of eq. 79 of He et al. 1991 in the mirror direction, (4 pi sigma_0 cos theta_i / lambda)^2."""
    return (4.0 * math.pi * surface.sigma_0_um.value * cos_i / (1e-3 * wavelength_nm)) ** 2


def spatial_band(surface: SurfaceStatistics, wavelength_nm: float) -> SpatialBand:
    """Return the directions into which the roughness that the map shows scatters light."""
    wavelength_um = 1e-3 * wavelength_nm
    finest, longest = 2.0 * max(surface.step_um), min(surface.width_um)
    nearest, farthest = (math.degrees(math.asin(min(1.0, wavelength_um / length))) for length in (longest, finest))
    return SpatialBand(wavelength_nm, nearest, farthest, finest <= 0.5 * wavelength_um)


def index_entry(text: str) -> str:
    """Return the entry of a refractive index that a text names: shelf/book/page, constant/N/K, or a symbol such as Cu.

    A symbol is that of a substance of the libraries of metals. ParameterError if it is none of these.
    """
    if text.count("/") == 2:
        return text
    known: dict[str, str] = {}
    for library in ("metals", "metals-infrared"):
        for material in presets(library).values():
            entry = material.refractive_index or "//"
            known.setdefault(entry.split("/")[1], entry)
    if text not in known:
        allowed = f"allowed are shelf/book/page, constant/N/K, and {', '.join(known)}"
        raise ParameterError("refractive_index", f"{text!r} is no refractive index; {allowed}", text, tuple(known))
    return known[text]


class SurfaceMaterials(NamedTuple):
    """Materials with the statistics of a surface, by model.

    Attributes
    ----------
    tables : dict of str to dict
        Tables of a recipe.
    materials : dict of str to Material
        The same materials.
    left_out : dict of str to str
        Models whose range the surface exceeds, with the parameter and its range in words.
    """

    tables: dict[str, dict[str, Any]]
    materials: dict[str, Material]
    left_out: dict[str, str]


def surface_materials(
    surface: SurfaceStatistics, name: str, *, entry: str = UNKNOWN_INDEX, rho: float = RHO, source: str = ""
) -> SurfaceMaterials:
    """Return materials of the models that describe a surface by its statistics.

    Parameters
    ----------
    surface : SurfaceStatistics
        Statistics of a map.
    name : str
        Name of the surface.
    entry : str
        Refractive index, shelf/book/page or constant/N/K.
    rho : float [1]
        Albedo of the facets of Oren and Nayar, in [0, 1].
    source : str
        Where the map comes from.

    Returns
    -------
    SurfaceMaterials
        "he_torrance" with sigma_0 and the mean tau; "oren_nayar" with the rms slope as its angle; "ggx" and "beckmann"
        with alpha = sqrt(2) times the slope. Models whose range the surface exceeds are left out, and named.
    """
    where = source or f"brdfdb topography of {name}"
    turned = surface.anisotropy.significant  # else the mean of both: their difference is chance
    alphas = {
        f"alpha_{axis}": rounded(float(alpha_from_slope(slope.value if turned else surface.slope)))
        for axis, slope in (("x", surface.slope_x), ("y", surface.slope_y))
    }
    tables: dict[str, dict[str, Any]] = {
        "he_torrance": {
            "title": f"He-Torrance with sigma_0 and tau of {name}",
            "model": "he_torrance",
            "source": f"{where}: rms height, and length where the correlation is 1 / e",
            "refractive_index": entry,
            "parameters": {"sigma_0_um": rounded(surface.sigma_0_um.value), "tau_um": rounded(surface.tau_um)},
        },
        "oren_nayar": {
            "title": f"Oren-Nayar with the slopes of {name}",
            "model": "oren_nayar",
            "source": f"{where}: sigma is the rms slope along an axis, as an angle in radians",
            "sources": {"rho": "not measured by a height map: given by the user, or assumed"},
            "parameters": {"rho": rho, "sigma_deg": rounded(math.degrees(surface.slope))},
        },
    }
    for model, title in (("ggx", "GGX"), ("beckmann", "Beckmann")):
        tables[model] = {
            "title": f"{title} with the slopes of {name}",
            "model": model,
            "source": f"{where}: alpha is sqrt(2) times the rms slope along an axis",
            "refractive_index": entry,
            "parameters": alphas,
        }
    materials: dict[str, Material] = {}
    left_out: dict[str, str] = {}
    for model, table in tables.items():
        try:
            materials[model] = Material.from_table(material_name(name, model), table)
        except ParameterError as error:
            if error.parameter not in table["parameters"] or error.parameter == "rho":
                raise
            left_out[model] = f"{error.parameter}: {error.sentence}"
    return SurfaceMaterials({model: tables[model] for model in materials}, materials, left_out)


def material_name(name: str, model: str) -> str:
    """Return the name of the material of a surface in a recipe."""
    return f"{name}-{model.replace('_', '-')}"


def recipe_of_surface(tables: dict[str, dict[str, Any]], name: str) -> str:
    """Return a recipe (TOML) of the materials of a surface, for `brdfdb build`."""
    names = ", ".join(f'"{material_name(name, model)}"' for model in tables)
    entry = next((table["refractive_index"] for table in tables.values() if "refractive_index" in table), UNKNOWN_INDEX)
    wavelengths = ", ".join(f"{one:g}" for one in covered_wavelengths(entry))
    head = f"materials = [{names}]\nwavelengths_nm = [{wavelengths}]\ntolerance = {_TOLERANCE:g}\n"
    return "\n".join([head, *(toml_of(material_name(name, model), table) for model, table in tables.items())])


def covered_wavelengths(entry: str) -> tuple[float, ...]:
    """Return those of 550 nm and 10.6 um that a refractive index covers; ParameterError if it covers neither."""
    covered = []
    error = None
    for one in WAVELENGTHS_NM:
        try:
            refractive_index(entry, one)
        except ParameterError as found:
            error = found
        else:
            covered.append(one)
    if not covered and error is not None:
        raise error
    return tuple(covered)


def standings(surface: SurfaceStatistics, materials: dict[str, Material]) -> list[ModelStanding]:
    """Return which assumptions of its models a surface meets at 550 nm and 10.6 um.

    Limits that papers state are judged by `brdfdb.materials.stated_limits`. Assumptions on the surface itself, which no
    parameter of a model tells, are judged by the statistics of the map.
    """
    found = []
    entry = next((one.refractive_index for one in materials.values() if one.refractive_index), UNKNOWN_INDEX)
    for wavelength_nm in covered_wavelengths(entry):
        for model, material in materials.items():
            at = np.array([wavelength_nm]) if material.spectral else None
            limits = limits_of(material, at)
            if model == "he_torrance":
                limits += [_gaussian("heights", surface.heights, "He et al. 1991, eq. 47"), _correlation(surface)]
            if model in ("oren_nayar", "ggx", "beckmann"):
                limits = [limit for limit in limits if limit.standing != "unknown"]
                limits += [_facets(surface, wavelength_nm), _geometrical(surface, wavelength_nm)]
            if model in ("oren_nayar", "beckmann"):
                where = "Oren and Nayar 1994, eq. 26" if model == "oren_nayar" else "Walter et al. 2007, eq. 25"
                limits.append(_gaussian("slopes", _steeper(surface), where))
            if model == "ggx":
                limits.append(_heavy_tails(_steeper(surface)))
            if model in ("he_torrance", "oren_nayar"):
                limits.append(_isotropic(surface))
            found.append(ModelStanding(model, wavelength_nm, limits))
    return found


def _steeper(surface: SurfaceStatistics) -> Moments:
    """Return the moments of the slopes along the axis where they are farther from a Gaussian."""
    vary = [one for one in (surface.slopes_x, surface.slopes_y) if one is not None]
    return max(vary, key=lambda one: abs(one.kurtosis - 3.0) / one.kurtosis_error)


def _gaussian(what: str, moments: Moments, where: str) -> StatedLimit:
    """Return whether heights or slopes are Gaussian."""
    near = abs(moments.skewness) < 0.5 and abs(moments.kurtosis - 3.0) < 1.0
    return StatedLimit(
        quantity=f"skewness and kurtosis of {what}",
        value=f"{moments.skewness:.2f} and {moments.kurtosis:.2f}",
        valid="0 and 3 within three standard errors; at the edge within 0.5 and 1",
        standing="inside" if moments.gaussian else "at the edge" if near else "outside",
        words=f"The {what} are Gaussian.",
        where=where,
    )


def _heavy_tails(moments: Moments) -> StatedLimit:
    """Return whether slopes have the tails of GGX, whose kurtosis is infinite."""
    heavy = moments.kurtosis - 3.0 > 3.0 * moments.kurtosis_error
    return StatedLimit(
        quantity="kurtosis of slopes",
        value=f"{moments.kurtosis:.2f}",
        valid="well above 3",
        standing="inside" if moments.kurtosis > 4.0 and heavy else "at the edge" if heavy else "outside",
        words="Slopes have tails longer than those of a Gaussian, and no rms value.",
        where="Walter et al. 2007, eq. 33",
    )


def _correlation(surface: SurfaceStatistics) -> StatedLimit:
    """Return whether the correlation is Gaussian, as that of He and Torrance."""
    exponent = surface.exponent
    inside = exponent.low <= 1.0 <= exponent.high or abs(exponent.value - 1.0) < 0.05
    return StatedLimit(
        quantity="exponent H of the correlation exp(-(r / tau)^(2 H))",
        value=f"{exponent.value:.2f} ({exponent.low:.2f} to {exponent.high:.2f})",
        valid="1; at the edge from 0.8 to 1.3",
        standing="inside" if inside else "at the edge" if 0.8 <= exponent.value <= 1.3 else "outside",
        words="The correlation of the heights is Gaussian.",
        where="He et al. 1991, eq. 48",
    )


def _isotropic(surface: SurfaceStatistics) -> StatedLimit:
    """Return whether a surface is isotropic."""
    ratio = surface.anisotropy.ratio
    return StatedLimit(
        quantity="largest over smallest rms slope of all directions",
        value=f"{ratio:.2f}",
        valid="1 within chance; at the edge up to 1.2",
        standing="inside" if not surface.anisotropy.significant else "at the edge" if ratio < _ROUND else "outside",
        words="The surface is isotropic.",
        where="definition of the model",
    )


def _facets(surface: SurfaceStatistics, wavelength_nm: float) -> StatedLimit:
    """Return whether facets, of the size of a length of correlation, are large compared to the wavelength."""
    ratio = (1e3 * surface.tau_um / wavelength_nm) ** 2
    return StatedLimit(
        quantity="tau^2 / wavelength^2, for the area of facets",
        value=f"{ratio:.3g} at {wavelength_nm:g} nm",
        valid="at least 10, at the edge above 1",
        standing=standing(1.0 / ratio, 1.0 / _MUCH, 1.0),
        words="Further, the facet area is large compared to the wavelength λ of incident light and therefore "
        "geometrical optics can be used to derive the reflectance model.",
        where="Oren and Nayar 1994, section 3, with eq. 5",
    )


def _geometrical(surface: SurfaceStatistics, wavelength_nm: float) -> StatedLimit:
    """Return whether a surface is so rough that no specular part is left."""
    g = phase_variance(surface, wavelength_nm)
    return StatedLimit(
        quantity="g along the normal, (4 pi sigma_0 / wavelength)^2",
        value=f"{g:.3g} at {wavelength_nm:g} nm",
        valid="at least 10, at the edge above 1",
        standing=standing(1.0 / max(g, 1e-300), 1.0 / _MUCH, 1.0),
        words="Waves of different heights do not interfere, and the specular part, exp(-g), is gone.",
        where="He et al. 1991, eq. 79, for g >> 1",
    )
