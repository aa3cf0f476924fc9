"""A material of a recipe that is simulated: a surface, its facets, and when the simulation is exact enough."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from brdfdb.errors import ParameterError, sentence_of
from brdfdb.geometry import radians
from brdfdb.materials.provenance import Text
from brdfdb.materials.spectrum import Spectrum, spectrum_of
from brdfdb.microgeometry.facets import Facets
from brdfdb.microgeometry.height_map_files import MapOptions, read_heights
from brdfdb.microgeometry.levelling import Levelled, LevellingOptions, levelled
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
_OF_MADE = ("slope_deg", "slope_y_deg", "all_azimuths", "nodes")
_OF_FILE = ("pixel_um", "height_um", "unit", "hole", "channel")  # as of MapOptions
_OF_LEVELLING = ("level", "outliers", "steps", "holes")  # as of LevellingOptions
_OF_MAP = (*_OF_FILE, *_OF_LEVELLING, "isotropic")


SINGLE_DIRECTIONS = (
    "mirrors of grooves, and of parts where many facets have the same slope, send light into single directions, "
    "which no table holds; allowed is facets = 'lambert'"
)


class SimulatedTable(BaseModel):
    """A material of a recipe that is simulated by rays on the facets of a surface."""

    model_config = STRICT

    surface: Kind | None = Field(
        default=None, description=f"kind of made surface: {', '.join(KINDS)}; or else height_map"
    )
    slope_deg: float | None = Field(
        default=None,
        gt=0.0,
        lt=90.0,
        description="angle whose tangent is the standard deviation of the slopes along x; of grooves the angle of "
        "their walls",
    )
    slope_y_deg: float | None = Field(
        default=None, gt=0.0, lt=90.0, description="the same along y; by default as along x"
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
        default=None, pattern=r"^[^/]+/[^/]+/[^/]+$", description="entry of refractiveindex.info, instead of n and k"
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
    realisations: int = Field(default=256, ge=16, le=100_000, description="most realisations, or parts of a height map")
    rays: int = Field(default=4096, ge=100, le=10_000_000, description="rays for each light in a realisation")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="the same seed gives the same table")
    reciprocal: bool = Field(default=False, description="tabulate the nearest values that are reciprocal")
    conserving: bool = Field(
        default=True, description="where noise makes an albedo exceed 1, tabulate the nearest values that do not"
    )
    title: Text | None = Field(default=None, description="a line for people; by default surface and facets in words")
    source: Text | None = Field(default=None, description="origin of the surface; by default the name of the file")

    def made(self) -> MadeSurface:
        """Return the made surface; ParameterError if its parameters do not go together."""
        assert self.surface is not None
        if self.slope_deg is None:
            raise ParameterError("slope_deg", f"is missing; a {self.surface} surface needs it", None)
        slope_y = None if self.slope_y_deg is None else float(np.tan(radians(self.slope_y_deg)))
        slope = float(np.tan(radians(self.slope_deg)))
        return MadeSurface(self.surface, slope, slope_y, self.all_azimuths, self.nodes)

    def levelled(self, path: Path) -> Levelled:
        """Return the height map in a file, levelled; FileFormatError, ParameterError or OSError for a bad file."""
        pixel = self.pixel_um if isinstance(self.pixel_um, list) else [] if self.pixel_um is None else [self.pixel_um]
        options = MapOptions(tuple(pixel), self.height_um, self.unit, self.hole, self.channel)
        chosen: Any = {name: getattr(self, name) for name in _OF_LEVELLING}
        return levelled(read_heights(path, options), LevellingOptions(**chosen))


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
            raise ParameterError("surface, height_map", "give exactly one of them")
        wrong = [key for key in (_OF_MAP if table.height_map is None else _OF_MADE) if key in given]
        if wrong:
            kind = "height_map" if table.height_map is None else "surface"
            raise ParameterError(wrong[0], f"is allowed only with {kind}", getattr(table, wrong[0]))
        allowed = _OF_FACETS[table.facets]
        for key in sorted({key for keys in _OF_FACETS.values() for key in keys} & given):
            if key not in allowed:
                text = f"is not allowed for facets = {table.facets!r}, which take {', '.join(allowed)}"
                raise ParameterError(key, text, getattr(table, key))
        for key in ("rho", "mirror"):
            if key in allowed and table.facets != "mirror" and getattr(table, key) is None:
                raise ParameterError(key, f"is missing; facets = {table.facets!r} need it")
        if table.facets != "lambert" and table.surface in ("grooves", "gaussian-grooves"):
            raise ParameterError("facets", SINGLE_DIRECTIONS, table.facets)
        if table.refractive_index is not None and (table.n is not None or table.k is not None):
            raise ParameterError("refractive_index", "is given in place of n and k; leave these out")
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
    rho: Any = table.rho
    if isinstance(rho, list | dict):
        rho = spectrum_of("rho", rho, table.wavelengths_nm or None, folder)
    lists = [key for key in ("n", "k") if isinstance(getattr(table, key), list)]
    mirror = 0.0 if table.facets == "lambert" else 1.0 if table.mirror is None else table.mirror
    if not isinstance(rho, Spectrum) and not lists and table.refractive_index is None:
        if table.wavelengths_nm:
            raise ParameterError("wavelengths_nm", "is not allowed for facets without a spectrum", table.wavelengths_nm)
        k = 0.0 if table.k is None else table.k
        return SpectralFacets(Facets(0.0 if rho is None else rho, mirror, table.n, k), None)
    own = rho.wavelengths_nm if isinstance(rho, Spectrum) else None
    at = table.wavelengths_nm or (None if lists else own or wavelengths_nm)
    if not at:
        key = lists[0] if lists else "refractive_index"
        raise ParameterError("wavelengths_nm", f"is missing; {key} needs wavelengths", None)
    wavelength_nm = check_nanometres("wavelengths_nm", at)
    if np.any(np.diff(wavelength_nm) <= 0.0):
        raise ParameterError("wavelengths_nm", "the values must increase strictly", list(at))
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
