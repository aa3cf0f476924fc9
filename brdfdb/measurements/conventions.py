"""Meaning of the numbers of a file: the quantity of its values, how its angles and wavelengths count, and its k.

A `Convention` is what a user states with ``--quantity``, ``--angles``, ``--azimuth``, ``--wavelength-unit`` and
``--coverage-factor``. It is applied to rows of any format at one place.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.measurements.instrument import Instrument
from brdfdb.parameters import Floats

RELATIVE = "relative to the light"  # entry "azimuths" of a record: the azimuth on the surface is not known
NODES = "nodes"  # entry of a record that is true if the samples are all nodes of a grid
ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
PER_SR = ("", "sr-1", "1/sr", "sr^-1", "sr**-1")
NM_PER = {  # by the unit that a file states
    **dict.fromkeys(("", "nm", "nanometer", "nanometre", "nanometers", "nanometres"), 1.0),
    **dict.fromkeys(("um", "\u00b5m", "\u03bcm", "micron", "microns", "micrometer", "micrometre"), 1e3),
    **dict.fromkeys(("micrometers", "micrometres"), 1e3),
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres"), 1e9),
}
#: what numbers of a file may be, in words
QUANTITIES = {
    "f_r": "f_r",
    "reflectance_factor": "reflectance factors",
    "percent": "f_r in percent",
    "reflectance_factor_percent": "reflectance factors in percent",
    "log10": "decadic logarithms of f_r",
    "ln": "natural logarithms of f_r",
    "decibel": "f_r in decibels",
    "f_r_cos": "f_r cos theta_r",
    "f_r_cos_i": "f_r cos theta_i",
}
#: natural logarithm of the base: f_r is exp of the number times it
LOGARITHMS = {"log10": np.log(10.0), "ln": 1.0, "decibel": np.log(10.0) / 10.0}
#: the factor of which each quantity is f_r times
FACTORS = {"f_r": 1.0, "reflectance_factor": np.pi, "percent": 100.0, "reflectance_factor_percent": 100.0 * np.pi}
ANGLE_UNITS = {"deg": np.pi / 180.0, "rad": 1.0, "mrad": 1e-3}  # in rad
_ELEVATIONS = ("elevation", "elevation_i", "elevation_r")
EXCHANGED = "exchanged"
#: words of `Convention.angles`: at most one unit, one elevation, and the exchange
ANGLE_WORDS = (*ANGLE_UNITS, *_ELEVATIONS, EXCHANGED)
AZIMUTHS = ("light", "forward", "mirror", "absolute")
CONVENTION_KEYS = ("quantity", "angles", "azimuth", "wavelength_unit", "coverage_factor")  # of `Convention`
WAVELENGTH_UNITS = ("nm", "um", "m")
REFUSED = "refused"  # entry of a record of samples: options that the file they are of refuses
FROM_LIGHT = "viewer_azimuth"  # entry of a record of samples: "light" if azimuths of viewers counted from it
_ROUNDED = 1e-5  # [rad] of elevations of the normal, which files write with few digits
_GRAZING = 1e-6  # cosine below which f_r cannot be made of f_r times it


class FormatConventions(NamedTuple):
    """Units in which a reader takes the numbers of a format, and options that its files refuse, as in `remedy`."""

    angles: str = "deg"
    wavelengths: str = "nm"
    refused: tuple[str, ...] = ()


@dataclass(frozen=True)
class Convention:
    """Statements of a user on the numbers of a file. Empty: as the reader takes them.

    Attributes
    ----------
    quantity : str
        One of `QUANTITIES`: what the values are.
    angles : str
        Words of `ANGLE_WORDS` with commas: the unit of the angles; elevation, where polar angles count from the surface
        (elevation_i: only those of the light, elevation_r: only those of the viewer); exchanged, where theta is phi.
    azimuth : str
        One of `AZIMUTHS`, from which azimuths of viewers count: light, the direction of the light; mirror, the mirror
        direction; absolute, a direction of the surface, as those of lights do. forward: azimuths of lights are those
        into which it travels.
    wavelength_unit : str
        nm, um or m.
    coverage_factor : float
        Factor k of expanded uncertainties, which are divided by it.
    """

    quantity: str = ""
    angles: str = ""
    azimuth: str = ""
    wavelength_unit: str = ""
    coverage_factor: float | None = None

    def __post_init__(self) -> None:
        allowed = {"quantity": tuple(QUANTITIES), "azimuth": AZIMUTHS, "wavelength_unit": WAVELENGTH_UNITS}
        for name, words in allowed.items():
            value = getattr(self, name)
            if value and value not in words:
                raise ParameterError(name, f"{value!r} is not one of {', '.join(words)}", value, words)
        for word in self.words:
            if word not in ANGLE_WORDS:
                text = f"{word!r} is not one of {', '.join(ANGLE_WORDS)}, or several of them with commas"
                raise ParameterError("angles", text, self.angles, ANGLE_WORDS)
        for group in (tuple(ANGLE_UNITS), _ELEVATIONS, (EXCHANGED,)):
            if len(twice := [word for word in self.words if word in group]) > 1:
                raise ParameterError("angles", f"{' and '.join(twice)} exclude each other", self.angles, ANGLE_WORDS)
        k = self.coverage_factor
        if k is not None and not 0.0 < k < np.inf:
            raise ParameterError("coverage_factor", f"{k:g} is not a positive number", k, (0.0, np.inf))

    def __bool__(self) -> bool:
        return any(getattr(self, part.name) for part in fields(self))

    @property
    def words(self) -> tuple[str, ...]:
        """The words of `angles`."""
        return tuple(self.angles.replace(" ", "").split(",")) if self.angles else ()

    @property
    def unit(self) -> str:
        """The unit of angles that is stated; empty if none is."""
        return next((word for word in self.words if word in ANGLE_UNITS), "")

    @property
    def of_rows(self) -> bool:
        """True if it says what angles or wavelengths of rows are."""
        return bool(self.angles or self.wavelength_unit)

    @property
    def options(self) -> str:
        """The options of the command line that state it."""
        given = {part.name.replace("_", "-"): getattr(self, part.name) for part in fields(self)}
        return " ".join(
            f"--{name} {value:g}" if isinstance(value, float) else f"--{name} {value}"
            for name, value in given.items()
            if value
        )


@dataclass(frozen=True, eq=False)
class ListedRows:
    """Rows that a file lists, as its reader takes the numbers: nothing is checked, and nothing that is stated applied.

    `angles` are theta_i, phi_i, theta_r, phi_r, of which polar angles may be any number; `values` may hold fill values.
    What follows `provenance` are the conventions of the reader. `brdfdb.formats.read` makes `Samples` of all rows.
    """

    angles: Floats  #: (N, 4) [rad]
    values: Floats  #: (N, C) [1/sr]
    name: str
    channels: Sequence[str]
    wavelength_nm: NDArray[np.float64] | None
    record: Mapping[str, Any]
    uncertainty: Floats | None = None
    mueller: Floats | None = None
    bandwidth_nm: NDArray[np.float64] | None = None
    instrument: Instrument = field(default_factory=Instrument)
    provenance: str = ""
    angle_unit: str = ""  #: unit of the angles of the file; empty: that of its format
    wavelength_unit: str = ""  #: unit of the wavelengths of the file; empty: that of its format
    quantity: str = "f_r"  #: what the numbers of the file are, of which the reader made f_r
    scale: float = 1.0  #: factor by which the reader has multiplied the numbers of the file
    azimuth: str = "absolute"  #: from where azimuths count in `angles`, as in `Convention`
    relative: bool = False  #: True if only the azimuth from light to viewer is known
    exchanged: bool = False  #: True if the reader has exchanged theta and phi
    signed: bool = False  #: True if a negative polar angle is one at the opposite azimuth
    rows: NDArray[np.int64] | None = None  #: number of rows of the file that each was made of, (N,); None: one
    #: what explains values that contradict at the same directions, in words; None if it was not looked for
    explanation: str | None = None
    refused: tuple[str, ...] = ()  #: options that this file refuses, besides those of its format
    #: gives what is wrong with the polar angle of a row in a column (0 or 2) of `angles`, if nothing is stated on them
    wrong_angle: Callable[[int, int], str] | None = None


def f_r_of(quantity: str, numbers: Floats, theta_i: Floats, theta_r: Floats) -> Floats:
    """Return f_r [1/sr] of numbers (N, C) that are a quantity of `QUANTITIES` at polar angles (N,) [rad].

    It is nan where a cosine of the quantity is below 1e-6.
    """
    if quantity in LOGARITHMS:
        with np.errstate(over="ignore"):
            f_r = np.exp(LOGARITHMS[quantity] * numbers)
        return np.asarray(np.where(np.isfinite(f_r), f_r, np.nan))
    return np.asarray(numbers / factor_of_quantity(quantity, theta_i, theta_r)[:, np.newaxis])


def factor_of_quantity(quantity: str, theta_i: Floats, theta_r: Floats) -> Floats:
    """Return the factor (N,) that makes a quantity, which is no logarithm, of f_r; nan where a cosine is below 1e-6."""
    if quantity in FACTORS:
        return np.full(len(theta_i), FACTORS[quantity])
    cosine = np.cos(theta_r if quantity == "f_r_cos" else theta_i)
    return np.where(cosine > _GRAZING, cosine, np.nan)


def numbers_of(quantity: str, f_r: Floats, theta_i: Floats, theta_r: Floats) -> Floats:
    """Return the numbers (N, C) of a quantity of which `f_r_of` makes f_r."""
    if quantity in LOGARITHMS:
        return np.asarray(np.log(f_r, out=np.full(f_r.shape, np.nan), where=f_r > 0.0) / LOGARITHMS[quantity])
    return np.asarray(f_r * factor_of_quantity(quantity, theta_i, theta_r)[:, np.newaxis])


def converted(rows: ListedRows, convention: Convention, own: FormatConventions) -> ListedRows:
    """Return rows by what a user states, or by the conventions of their reader; azimuths are absolute then."""
    for name, word in (("azimuth", convention.azimuth), *(("angles", word) for word in convention.words)):
        if f"--{name} {word}" in rows.refused:
            text = "the file lists no angles of light and viewer that may mean something else"
            raise ParameterError(name, text, word)
    angles = _converted_angles(rows, convention, own)
    record = {**rows.record}
    values = rows.values
    uncertainty = rows.uncertainty
    if convention.quantity:
        numbers = numbers_of(rows.quantity, values, rows.angles[:, 0], rows.angles[:, 2])
        values = f_r_of(convention.quantity, numbers, angles[:, 0], angles[:, 2])
        if uncertainty is not None:
            raw = _scaled(uncertainty, rows.quantity, rows.values, rows.angles, inverse=True)
            uncertainty = _scaled(raw, convention.quantity, values, angles, inverse=False)
        record["quantity"] = convention.quantity
    if convention.coverage_factor and uncertainty is not None:
        uncertainty = uncertainty / convention.coverage_factor
        record["coverage_factor"] = convention.coverage_factor
    words = [word for word in convention.words if word != (rows.angle_unit or own.angles)]
    stated = {"angles_stated": ",".join(words), "azimuth": convention.azimuth}
    record |= {name: word for name, word in stated.items() if word}
    refused = [*own.refused, *rows.refused]
    record |= {FROM_LIGHT: "light"} if rows.azimuth == "light" else {}
    record |= {REFUSED: refused} if refused else {}
    at = rows.wavelength_nm
    taken = rows.wavelength_unit or own.wavelengths
    if at is not None and convention.wavelength_unit not in ("", taken):
        at = np.round(at * (NM_PER[convention.wavelength_unit] / NM_PER[taken]), 9)
    return replace(rows, angles=angles, values=values, uncertainty=uncertainty, record=record, wavelength_nm=at)


def _scaled(uncertainty: Floats, quantity: str, f_r: Floats, angles: Floats, *, inverse: bool) -> Floats:
    """Return uncertainties [1/sr] of those of a quantity, or with `inverse` those of the quantity."""
    if quantity in LOGARITHMS:
        slope = LOGARITHMS[quantity] * np.abs(f_r)
    else:
        slope = (1.0 / factor_of_quantity(quantity, angles[:, 0], angles[:, 2]))[:, np.newaxis]
    return np.asarray(uncertainty / slope if inverse else uncertainty * slope)


def _converted_angles(rows: ListedRows, convention: Convention, own: FormatConventions) -> Floats:
    """Return the angles (N, 4) [rad] of rows with the words on angles and azimuths of a convention."""
    theta_i, phi_i, theta_r, viewer = rows.angles.T
    taken = rows.angle_unit or own.angles
    if convention.unit and convention.unit != taken:
        factor = ANGLE_UNITS[convention.unit] / ANGLE_UNITS[taken]
        theta_i, phi_i, theta_r, viewer = (factor * angle for angle in (theta_i, phi_i, theta_r, viewer))
    if EXCHANGED in convention.words and not rows.exchanged:
        theta_r, viewer = viewer % (2.0 * np.pi), theta_r
        if not rows.relative:
            theta_i, phi_i = phi_i % (2.0 * np.pi), theta_i
    if {"elevation", "elevation_i"} & set(convention.words):
        theta_i = _from_elevation(theta_i)
    if {"elevation", "elevation_r"} & set(convention.words):
        theta_r = _from_elevation(theta_r)
    azimuth = convention.azimuth or rows.azimuth
    if azimuth in ("light", "mirror") or (azimuth == "forward" and rows.azimuth == "light"):
        viewer = phi_i + viewer
    if azimuth == "mirror" or (azimuth == "forward" and rows.relative):  # relative azimuths stay so: the viewer turns
        viewer = viewer + np.pi
    elif azimuth == "forward":
        phi_i = phi_i + np.pi
    if azimuth in ("forward", "mirror"):
        phi_i, viewer = phi_i % (2.0 * np.pi), viewer % (2.0 * np.pi)
    return np.stack([theta_i, phi_i, theta_r, viewer], axis=1)


def _from_elevation(angle: Floats) -> Floats:
    """Return polar angles [rad] of elevations, of which those of the normal are rounded: 0 if they miss it by 1e-5."""
    theta = 0.5 * np.pi - angle
    return np.where(np.abs(theta) < _ROUNDED, np.maximum(theta, 0.0), theta)


def remedy(record: Mapping[str, Any], words: str) -> str:
    """Return words with the option that mends what samples with a record show; others if their file refuses it."""
    return "correct the file" if any(option in words for option in record.get(REFUSED, ())) else words
