"""A material of a recipe that is simulated: a surface, its facets, and when the simulation is exact enough."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError, field_validator

from brdfdb.errors import ParameterError, counted, sentence_of
from brdfdb.geometry import degrees, radians
from brdfdb.materials.provenance import Text
from brdfdb.materials.spectrum import Spectrum, spectrum_of
from brdfdb.microgeometry.facets import Facets
from brdfdb.microgeometry.height_map_files import MapOptions, read_heights
from brdfdb.microgeometry.levelling import LevellingOptions, levelled
from brdfdb.microgeometry.s_filter import FilteredMap, s_filtered, slopes_of
from brdfdb.microgeometry.surface_models import index_entry
from brdfdb.microgeometry.surfaces import KINDS, Kind, MadeSurface
from brdfdb.parameters import check_nanometres
from brdfdb.refractive_indices import refractive_index
from brdfdb_pipelines.recipe_grids import STRICT, RecipeError

Reflecting = float | list[float] | dict[str, Any]
# Keys that each kind of facets takes, besides those of all
_OF_FACETS = {
    "lambert": ("rho",),
    "mirror": ("mirror", "n", "k", "refractive_index"),
    "mixture": ("rho", "mirror", "n", "k", "refractive_index"),
}
_FLATTEST_DEG, _STEEPEST_DEG = 0.06, 84.0  # rms slopes of surfaces
_OF_MADE = ("slope_deg", "slope_y_deg", "all_azimuths", "nodes")
_OF_FILE = ("pixel_um", "height_um", "unit", "hole", "channel")  # as of MapOptions
_OF_LEVELLING = ("level", "outliers", "steps", "holes")  # as of LevellingOptions
_OF_MAP = (*_OF_FILE, *_OF_LEVELLING, "noise_um", "s_filter_um", "isotropic")

SINGLE_DIRECTIONS = (
    "mirrors of grooves, and of parts where many facets have the same slope, send light into single directions, "
    "which no table holds; allowed are Lambertian facets"
)

_OPTIONS = {"hole": "--hole-value", "isotropic": "--isotropic, --anisotropic"}  # not named as their keys in a recipe


class SimulatedTable(BaseModel):
    """A material of a recipe that is simulated by rays on the facets of a surface."""

    model_config = STRICT

    surface: Kind | None = Field(
        default=None, description=f"kind of made surface: {', '.join(KINDS)}; or else height_map"
    )
    slope_deg: float | None = Field(
        default=None,
        ge=_FLATTEST_DEG,
        le=_STEEPEST_DEG,
        description="angle whose tangent is the standard deviation of the slopes along x; of grooves the angle of "
        "their walls",
    )
    slope_y_deg: float | None = Field(
        default=None, ge=_FLATTEST_DEG, le=_STEEPEST_DEG, description="the same along y; by default as along x"
    )
    all_azimuths: bool = Field(default=False, description="true: grooves that run in all directions")
    nodes: int = Field(default=512, ge=64, le=2048, description="nodes of a made map along each axis")
    height_map: str | None = Field(default=None, min_length=1, description="path of a file of heights")
    pixel_um: float | list[float] | None = Field(
        default=None, description="distance of its nodes [um], or those along x and y, if the file states none"
    )
    height_um: float | None = Field(default=None, description="height [um] of the number 1 in the file")
    unit: str | None = Field(default=None, description="unit of lengths in the file, if it states none")
    hole: float | None = Field(default=None, description="number in the file that stands for a missing height")
    channel: str | None = Field(default=None, description="name or number of the channel; by default the first")
    level: str = Field(default="plane", description="polynomial that is subtracted: none, plane or quadratic")
    outliers: str = Field(default="refuse", description="refuse, leave-out or keep; what is left out is a hole")
    steps: str = Field(default="refuse", description="steps of stitching: refuse, remove or keep")
    holes: Literal["refuse", "fill"] = Field(default="refuse", description="refuse, or fill from neighbours")
    noise_um: float | None = Field(
        default=None, ge=0.0, description="rms noise of the instrument [um]; by default estimated from the map"
    )
    s_filter_um: float | None = Field(
        default=None,
        ge=0.0,
        description="cutoff [um] of the S-filter, which takes shorter waves and with them noise out of the map; 0: no "
        "filter; by default no filter, and maps whose noise changes a slope by more than 5 % are refused",
    )
    isotropic: bool | None = Field(
        default=None,
        description="true: the map stands for a surface without a direction; by default if no harmonic of "
        "its squared slopes over azimuth, up to the sixth, exceeds 10 % and chance",
    )
    facets: Literal["lambert", "mirror", "mixture"] = Field(default="lambert", description="reflection of the facets")
    rho: Reflecting | None = Field(default=None, description="albedo of Lambertian facets, a number or a spectrum")
    mirror: float | None = Field(
        default=None, ge=0.0, le=1.0, description="weight of the mirror-like part; of facets that are mirrors 1"
    )
    n: float | list[float] | None = Field(default=None, description="refractive index; by default mirrors reflect all")
    k: float | list[float] | None = Field(default=None, description="extinction coefficient; by default 0")
    refractive_index: str | None = Field(
        default=None,
        description="instead of n and k: a substance such as Cu, an entry of refractiveindex.info, or constant/N/K",
    )
    wavelengths_nm: list[float] = Field(
        default=[], max_length=10_000, description="wavelengths of spectra; by default those of the recipe"
    )
    standard_error: float = Field(
        default=0.02,
        ge=1e-3,
        le=0.5,
        description="largest relative standard error where f_r exceeds a hundredth of its peak, at which it stops",
    )
    realisations: int = Field(
        default=256,
        ge=16,
        le=100_000,
        description="most realisations: maps of a made surface, or repetitions of a part of a height map",
    )
    rays: int = Field(default=4096, ge=100, le=10_000_000, description="rays for each light in a realisation")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="the same seed gives the same table")
    conserving: bool = Field(
        default=True, description="where noise makes an albedo exceed 1, tabulate the nearest values that do not"
    )
    title: Text | None = Field(default=None, description="a line for people; by default surface and facets in words")
    source: Text | None = Field(default=None, description="origin of the surface; by default the name of the file")

    @field_validator("refractive_index")
    @classmethod
    def _entry(cls, text: str | None) -> str | None:
        return None if text is None else index_entry(text)

    def made(self) -> MadeSurface:
        """Return the made surface; ParameterError if its parameters do not go together."""
        assert self.surface is not None
        if self.slope_deg is None:
            raise ParameterError("slope_deg", f"is missing; a {self.surface} surface needs it", None)
        slope_y = None if self.slope_y_deg is None else float(np.tan(radians(self.slope_y_deg)))
        slope = float(np.tan(radians(self.slope_deg)))
        return MadeSurface(self.surface, slope, slope_y, self.all_azimuths, self.nodes)

    def filtered(self, path: Path) -> FilteredMap:
        """Return the height map in a file, levelled and filtered; FileFormatError, ParameterError or OSError if bad."""
        pixel = self.pixel_um if isinstance(self.pixel_um, list) else [] if self.pixel_um is None else [self.pixel_um]
        options = MapOptions(tuple(pixel), self.height_um, self.unit, self.hole, self.channel)
        chosen: Any = {name: getattr(self, name) for name in _OF_LEVELLING}
        chosen["holes"] = "fill" if self.holes == "fill" else "leave-out"
        ready = levelled(read_heights(path, options), LevellingOptions(**chosen))
        holes = int(np.count_nonzero(np.isnan(ready.measured.heights_um)))
        if holes:
            outliers = f", of them {counted(ready.left_out, 'outlier')}" if ready.left_out else ""
            text = (
                f"{holes} heights of {ready.measured.heights_um.size} are missing{outliers}; rays need all of them; "
                "allowed is fill, which interpolates between neighbours"
            )
            raise ParameterError("holes", text, "refuse", ("fill",))
        filtered = s_filtered(ready, self.s_filter_um, self.noise_um)
        measured = filtered.levelled.measured
        steepest = max(slopes_of(measured.heights_um, (measured.step_x_um, measured.step_y_um)))
        if steepest > np.tan(radians(_STEEPEST_DEG)):
            text = (
                f"the rms slope of {steepest:.3g} is that of {degrees(np.arctan(steepest)):.4g} degrees; allowed are "
            )
            text += f"up to {_STEEPEST_DEG:g} degrees: are the units of heights and pixels right?"
            raise ParameterError("height_map", text, str(self.height_map))
        return filtered


class SpectralFacets(NamedTuple):
    """Facets, and their wavelengths [nm]; None: they are grey."""

    facets: Facets
    wavelength_nm: NDArray[np.float64] | None


def simulated_table(name: str, fields: Mapping[str, Any]) -> SimulatedTable:
    """Return the checked table of a simulated material of a recipe; RecipeError names the first field that is wrong."""
    where = f"define.{name}"
    try:
        table = SimulatedTable.model_validate(dict(fields))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = str(first["loc"][0]) if first["loc"] else ""
        raise RecipeError(f"{where}.{field}", sentence_of(first)) from None
    given = table.model_fields_set
    try:
        if (table.surface is None) == (table.height_map is None):
            given_as = "neither is given" if table.surface is None else "both are given"
            raise ParameterError("surface, height_map", f"{given_as}; give one of them")
        wrong = [key for key in (_OF_MAP if table.height_map is None else _OF_MADE) if key in given]
        if wrong:
            kind = "a height map" if table.height_map is None else "a made surface"
            raise ParameterError(wrong[0], f"is allowed only for {kind}", getattr(table, wrong[0]))
        allowed = _OF_FACETS[table.facets]
        for key in sorted({key for keys in _OF_FACETS.values() for key in keys} & given):
            if key not in allowed:
                kinds = " and ".join(kind for kind, keys in _OF_FACETS.items() if key in keys)
                text = f"is not allowed for facets of the kind {table.facets}, only for {kinds}"
                raise ParameterError(key, text, getattr(table, key))
        for key in ("rho", "mirror"):
            if key in allowed and table.facets != "mirror" and getattr(table, key) is None:
                raise ParameterError(key, f"is missing; facets of the kind {table.facets} need it")
        if table.facets != "lambert" and table.surface in ("grooves", "gaussian-grooves"):
            raise ParameterError("facets", SINGLE_DIRECTIONS, table.facets)
        numbers = [key for key in ("n", "k") if getattr(table, key) is not None]
        if table.refractive_index is not None and numbers:
            raise ParameterError(", ".join(["refractive_index", *numbers]), "give a substance or numbers, not both")
        if table.k is not None and table.n is None:
            raise ParameterError("n", "is missing; k alone is no refractive index")
    except ParameterError as error:
        raise RecipeError(f"{where}.{error.parameter}", error.sentence) from None
    return table


def spectral_facets(
    table: SimulatedTable, wavelengths_nm: Sequence[float] | None, folder: Path | None
) -> SpectralFacets:
    """Return the facets of a table, at its wavelengths, those of a spectrum, or else those of the recipe [nm].

    Paths of spectra begin at `folder`. ParameterError if a value is not allowed, or there are no wavelengths.
    """
    if table.wavelengths_nm and np.any(np.diff(check_nanometres("wavelengths_nm", table.wavelengths_nm)) <= 0.0):
        raise ParameterError("wavelengths_nm", "the values must increase strictly", table.wavelengths_nm)
    rho: Any = table.rho
    if isinstance(rho, list | dict):
        rho = spectrum_of("rho", rho, table.wavelengths_nm or None, folder)
    lists = [key for key in ("n", "k") if isinstance(getattr(table, key), list)]
    mirror = 0.0 if table.facets == "lambert" else 1.0 if table.mirror is None else table.mirror
    if not isinstance(rho, Spectrum) and not lists and table.refractive_index is None:
        if table.wavelengths_nm:
            raise ParameterError(
                "wavelengths_nm", "is not allowed without a spectrum, such as a list of albedos", table.wavelengths_nm
            )
        k = 0.0 if table.k is None else table.k
        return SpectralFacets(Facets(0.0 if rho is None else rho, mirror, table.n, k), None)
    own = rho.wavelengths_nm if isinstance(rho, Spectrum) else None
    at = table.wavelengths_nm or (None if lists else own or wavelengths_nm)
    if not at:
        key = lists[0] if lists else "refractive_index"
        raise ParameterError("wavelengths_nm", f"is missing; {key} needs it", None)
    wavelength_nm = check_nanometres("wavelengths_nm", at)
    for key in lists:
        if len(getattr(table, key)) != len(at):
            text = f"a list of {len(getattr(table, key))} values needs as many wavelengths_nm, {len(at)} are given"
            raise ParameterError(key, text)
    index = None if table.n is None else np.asarray(table.n)
    extinction = np.asarray(0.0 if table.k is None else table.k)
    if table.refractive_index is not None:
        index, extinction = refractive_index(table.refractive_index, wavelength_nm)
    albedo = 0.0 if rho is None else rho.at("rho", wavelength_nm) if isinstance(rho, Spectrum) else rho
    return SpectralFacets(Facets(albedo, mirror, index, extinction, wavelength_nm), wavelength_nm)


# Keys whose names are no words, and `hole` where a sentence gives it a value; names in paths are left as they are
_KEY = re.compile(
    rf"(?<![\w./-])(?:(?P<key>{'|'.join(name for name in SimulatedTable.model_fields if '_' in name)})|hole(?= = ))"
    r"(?![\w/-]|\.\w)( = )?"
)


def option_of(key: str) -> str:
    """Return the option of the commands simulate and topography that a key of a recipe has."""
    return _OPTIONS.get(key, f"--{key.replace('_', '-')}")


def in_options(sentence: str) -> str:
    """Return a sentence with options of the commands simulate and topography in place of keys of a recipe."""
    return _KEY.sub(lambda found: option_of(found["key"] or "hole") + (" " if found[2] else ""), sentence)
