"""Models of a measured surface: materials with its statistics, and which assumptions of each model it meets.

What a model assumes, and how its parameters follow from the statistics, is declared with it: `ModelSpec.heights`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.materials import Material, presets
from brdfdb.materials.recipe_text import rounded, toml_of
from brdfdb.materials.stated_limits import limits_of
from brdfdb.materials.written_parameters import as_written
from brdfdb.microgeometry.model_errors import suited_parameters, surface_error_of
from brdfdb.microgeometry.topography import Moments, SurfaceStatistics
from brdfdb.models import MODELS
from brdfdb.parameters import (
    MUCH,
    OPAQUE,
    STANDINGS,
    ModelSpec,
    Standing,
    StatedLimit,
    SurfaceNumbers,
    SurfaceProperty,
    standing,
)
from brdfdb.refractive_indices import refractive_index

WAVELENGTHS_NM = (550.0, 10600.0)  # green light, and that of a carbon dioxide laser
UNKNOWN_INDEX = "constant/1.5/0"  # n and k of a surface of an unknown substance
RHO = 0.5  # albedo of diffuse facets where it is not known
_TOLERANCE = 0.05  # of the recipe
_ROUND = 1.2  # ratio of slopes up to which an anisotropic surface is nearly isotropic


class SpatialBand(NamedTuple):
    """Roughness that a map shows, and directions into which it scatters light that falls along the normal.

    The spatial wavelength of this roughness, lambda / sin(theta_r), is at most the length of the map and at least two
    steps of the grid.
    """

    wavelength_nm: float  #: of the light [nm]
    nearest_deg: float  #: least theta_r [degree] of the light that it scatters
    farthest_deg: float  #: largest theta_r [degree]
    everywhere: bool  #: True if it serves all directions of light and viewer, down to lambda / 2


class ModelStanding(NamedTuple):
    """The assumptions of a model for a surface at a wavelength [nm], and whether the surface meets them."""

    model: str
    wavelength_nm: float
    limits: list[StatedLimit]

    @property
    def worst(self) -> Standing:
        """Return the standing of the limit that is met least; unknown limits do not count."""
        judged = (limit.standing for limit in self.limits if limit.standing != "unknown")
        return max(judged, key=STANDINGS.index, default="unknown")


def phase_variance(surface: SurfaceStatistics, wavelength_nm: float) -> float:
    """Return g [1] of eq. 79 of He et al. 1991 along the normal, (4 pi sigma_0 / lambda)^2."""
    return (4.0 * math.pi * surface.sigma_0_um.value / (1e-3 * wavelength_nm)) ** 2


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
    """Materials with the statistics of a surface, by model."""

    tables: dict[str, dict[str, Any]]  #: tables of a recipe
    materials: dict[str, Material]  #: the same materials
    left_out: dict[str, str]  #: reasons why other models have none: a parameter outside its range, or not in heights


def surface_materials(
    surface: SurfaceStatistics, name: str, *, entry: str = UNKNOWN_INDEX, rho: float = RHO, source: str = ""
) -> SurfaceMaterials:
    """Return materials of the models that declare how their parameters follow from heights.

    `entry` is a refractive index, shelf/book/page or constant/N/K, and `rho` the albedo [1] of diffuse facets, in
    [0, 1]. `source` says where the map comes from.
    """
    anisotropic = surface.anisotropy.significant  # or else the difference of both slopes is chance
    slopes = (surface.slope_x.value, surface.slope_y.value) if anisotropic else (surface.slope, surface.slope)
    numbers = SurfaceNumbers(surface.sigma_0_um.value, surface.tau_um, surface.slope, *slopes)
    result = SurfaceMaterials({}, {}, {})
    for model, spec in MODELS.items():
        relation = spec.heights
        if relation is None:
            continue
        if relation.parameters is None:
            result.left_out[model] = f"{relation.left_out}{_suited(model, surface.slope, rho)}"
            continue
        parameters = _written(spec, relation.parameters(numbers))
        albedos = [
            parameter.name for parameter in spec.parameters if parameter.reflectance and parameter.default is None
        ]
        others = [
            parameter.name
            for parameter in spec.parameters
            if parameter.default is not None and as_written(parameter).name not in parameters
        ]
        table = {
            "title": f"{spec.short_title} with the statistics of {name}",
            "model": model,
            "source": f"{source or f'brdfdb topography of {name}'}: {relation.words}",
            "sources": {
                **dict.fromkeys(others, "default of the model; heights do not tell it"),
                **dict.fromkeys(albedos, "not measured by a height map: given by the user, or assumed"),
            },
            "refractive_index": entry if spec.spectral else None,
            "parameters": {**dict.fromkeys(albedos, rho), **parameters},
        }
        table = {key: value for key, value in table.items() if value}
        try:
            result.materials[model] = Material.from_table(material_name(name, model), table)
        except ParameterError as error:
            if error.parameter not in parameters:
                raise
            result.left_out[model] = f"{error.parameter}: {error.sentence}"
        else:
            result.tables[model] = table
    return result


def _written(spec: ModelSpec, values: dict[str, float]) -> dict[str, float]:
    """Return parameters as a recipe writes them, with few digits and angles in degrees."""
    written = {}
    for name, value in values.items():
        in_file = as_written(spec.parameter(name))
        written[in_file.name] = rounded(math.degrees(value) if in_file.unit == "degree" else value)
    return written


def _suited(model: str, slope: float, rho: float) -> str:
    """Return the end of a sentence on the parameters that suit a Gaussian surface best; empty outside of the map."""
    parameters = suited_parameters(model, slope)
    error = surface_error_of(model, {"rho": rho, **parameters}) if parameters else None
    if not parameters or error is None:
        return ""
    words = ", ".join(f"{name} = {value:.3g}" for name, value in parameters.items())
    return f"; {words} suits a Gaussian surface of this slope best. {error.sentence}"


def material_name(name: str, model: str) -> str:
    """Return the name of the material of a surface in a recipe."""
    return f"{name}-{model.replace('_', '-')}"


def recipe_of_surface(tables: dict[str, dict[str, Any]], name: str) -> str:
    """Return a recipe (TOML) of the materials of a surface, for `brdfdb build`."""
    names = ", ".join(f'"{material_name(name, model)}"' for model in tables)
    entry = next((table["refractive_index"] for table in tables.values() if "refractive_index" in table), UNKNOWN_INDEX)
    wavelengths = ", ".join(f"{wavelength_nm:g}" for wavelength_nm in covered_wavelengths(entry))
    head = f"materials = [{names}]\nwavelengths_nm = [{wavelengths}]\ntolerance = {_TOLERANCE:g}\n"
    return "\n".join([head, *(toml_of(material_name(name, model), table) for model, table in tables.items())])


def covered_wavelengths(entry: str) -> tuple[float, ...]:
    """Return those of 550 nm and 10.6 um that a refractive index covers; ParameterError if it covers neither."""
    covered = []
    refusal = None
    for wavelength_nm in WAVELENGTHS_NM:
        try:
            refractive_index(entry, wavelength_nm)
        except ParameterError as error:
            refusal = error
        else:
            covered.append(wavelength_nm)
    if not covered and refusal is not None:
        raise refusal
    return tuple(covered)


def standings(
    surface: SurfaceStatistics, materials: dict[str, Material], entry: str = UNKNOWN_INDEX
) -> list[ModelStanding]:
    """Return which assumptions of its models a surface meets at 550 nm and 10.6 um.

    Limits that papers state of parameters are judged by `brdfdb.materials.stated_limits`, and assumptions that a model
    declares of its surface by the statistics of the map and by k of the refractive index `entry`. A model without
    parameters of direction assumes an isotropic surface.
    """
    result = []
    for wavelength_nm in covered_wavelengths(entry):
        case = _Case(surface, wavelength_nm, float(refractive_index(entry, wavelength_nm)[1]))
        for model, material in materials.items():
            spec = material.spec
            assumptions = spec.heights.assumptions if spec.heights else ()
            judged = [
                StatedLimit(*_JUDGES[assumption.property](case), assumption.words, assumption.where)
                for assumption in assumptions
            ]
            if spec.lobe_axes is None and spec.anisotropic is None:
                judged.append(StatedLimit(*_isotropic(surface), "The surface is isotropic.", "definition of the model"))
            quoted = {assumption.words for assumption in assumptions}
            stated = limits_of(material, np.array([wavelength_nm]) if material.spectral else None)
            limits = [limit for limit in stated if limit.words not in quoted]
            result.append(ModelStanding(model, wavelength_nm, limits + judged))
    return result


class _Case(NamedTuple):
    """A surface, the wavelength of the light [nm], and the extinction coefficient of the substance there [1]."""

    surface: SurfaceStatistics
    wavelength_nm: float
    k: float


class _JudgedProperty(NamedTuple):
    """The first fields of a `StatedLimit`."""

    quantity: str
    value: str
    valid: str
    standing: Standing


def _steeper(surface: SurfaceStatistics) -> Moments:
    """Return the moments of the slopes along the axis where they are farther from a Gaussian."""
    moments = [axis for axis in (surface.slopes_x, surface.slopes_y) if axis is not None]
    return max(moments, key=lambda axis: abs(axis.kurtosis - 3.0) / axis.kurtosis_error)


def _gaussian(name: str, moments: Moments) -> _JudgedProperty:
    """Return whether heights or slopes are Gaussian."""
    near = abs(moments.skewness) < 0.5 and abs(moments.kurtosis - 3.0) < 1.0
    return _JudgedProperty(
        quantity=f"skewness and kurtosis of {name}",
        value=f"{moments.skewness:.2f} and {moments.kurtosis:.2f}",
        valid="0 and 3 within three standard errors; at the edge within 0.5 and 1",
        standing="inside" if moments.gaussian else "at the edge" if near else "outside",
    )


def _long_tails(moments: Moments) -> _JudgedProperty:
    """Return whether slopes have the tails of GGX, whose kurtosis is infinite."""
    long = moments.kurtosis - 3.0 > 3.0 * moments.kurtosis_error
    return _JudgedProperty(
        quantity="kurtosis of slopes",
        value=f"{moments.kurtosis:.2f} ± {moments.kurtosis_error:.2g}",
        valid="above 4, and above 3 by three standard errors; at the edge below 4",
        standing="inside" if moments.kurtosis > 4.0 and long else "at the edge" if long else "outside",
    )


def _correlation(surface: SurfaceStatistics) -> _JudgedProperty:
    """Return whether the correlation is Gaussian, as that of He and Torrance."""
    exponent = surface.exponent
    inside = exponent.low <= 1.0 <= exponent.high or abs(exponent.value - 1.0) < 0.05
    return _JudgedProperty(
        quantity="exponent H of the correlation exp(-(r / tau)^(2 H))",
        value=f"{exponent.value:.2f} ({exponent.low:.2f} to {exponent.high:.2f})",
        valid="1; at the edge from 0.8 to 1.3",
        standing="inside" if inside else "at the edge" if 0.8 <= exponent.value <= 1.3 else "outside",
    )


def _isotropic(surface: SurfaceStatistics) -> _JudgedProperty:
    """Return whether a surface is isotropic."""
    ratio = surface.anisotropy.ratio
    return _JudgedProperty(
        quantity="largest over smallest rms slope of all directions",
        value=f"{ratio:.2f}",
        valid="1 within chance; at the edge up to 1.2",
        standing="inside" if not surface.anisotropy.significant else "at the edge" if ratio < _ROUND else "outside",
    )


def _much(quantity: str, ratio: float, case: _Case) -> _JudgedProperty:
    """Return whether a ratio is much greater than 1."""
    return _JudgedProperty(
        quantity=quantity,
        value=f"{ratio:.3g} at {case.wavelength_nm:g} nm",
        valid=f"at least {MUCH:g}, at the edge above 1",
        standing=standing(1.0 / max(ratio, 1e-300), 1.0 / MUCH, 1.0),
    )


def _opaque(case: _Case, valid: str, opaque: Standing) -> _JudgedProperty:
    """Return the standing of facets of an opaque substance; of others a height map does not tell how they reflect."""
    return _JudgedProperty(
        quantity="extinction coefficient k of the facets",
        value=f"{case.k:.3g} at {case.wavelength_nm:g} nm",
        valid=valid,
        standing=opaque if case.k >= OPAQUE else "unknown",
    )


_JUDGES: dict[SurfaceProperty, Callable[[_Case], _JudgedProperty]] = {
    "Gaussian heights": lambda case: _gaussian("heights", case.surface.heights),
    "Gaussian correlation": lambda case: _correlation(case.surface),
    "Gaussian slopes": lambda case: _gaussian("slopes", _steeper(case.surface)),
    "long-tailed slopes": lambda case: _long_tails(_steeper(case.surface)),
    # Facets have the size of a length of correlation
    "large facets": lambda case: _much(
        "tau^2 / wavelength^2, for the area of facets", (1e3 * case.surface.tau_um / case.wavelength_nm) ** 2, case
    ),
    "no specular part": lambda case: _much(
        "g along the normal, (4 pi sigma_0 / wavelength)^2", phase_variance(case.surface, case.wavelength_nm), case
    ),
    "diffuse facets": lambda case: _opaque(
        case, "below 1 / (4 pi), and facets that scatter light evenly, which heights do not tell", "outside"
    ),
    "mirror-like facets": lambda case: _opaque(
        case, "at least 1 / (4 pi); in others light enters, and what returns is not in the model", "inside"
    ),
}
