"""Spectra: a reflectance at wavelengths with its origin, and how files write it.

A file writes a list, a CSV file, an sRGB colour, or a measured reflectance of colour-science.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from brdfdb.errors import ParameterError, sentence_of
from brdfdb.materials.provenance import Text
from brdfdb.parameters import check_nanometres, closest
from brdfdb.place import path_of
from brdfdb.spectra import ILLUMINANT, OBSERVER, colour_science

MOST_VALUES = 10_000  # of a spectrum
_LEAST_NM = 20.0  # below it, the wavelengths of a spectrum are likely to be micrometres
WAYS = "wavelengths_nm and values, csv, srgb, or measured"

_HEX = re.compile(r"#[0-9a-fA-F]{6}")
_OTHER_UNITS = re.compile(r"%|percent|cm\^?-1|1/cm|wavenumber|[uµμ]m\b|micro\w*|angstrom|[TG]Hz|\beV\b", re.IGNORECASE)
_SHAPE_NM = (360.0, 780.0, 5.0)  # wavelengths of the spectrum of a colour
_MOST_BYTES = 1 << 20  # of a CSV file
UPSAMPLED = "assumed: the smooth spectrum of Jakob and Hanika 2019 with this colour under D65"

Values = Annotated[tuple[float, ...], Field(min_length=1, max_length=MOST_VALUES, fail_fast=True)]


class Spectrum(BaseModel):
    """A reflectance over the wavelength, as the value of a parameter that is a reflectance or an albedo.

    It has a reflectance [1] at each of one or more strictly increasing wavelengths [nm], a straight line between them,
    and no value outside. `origin` is the source of the values in words.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    wavelengths_nm: Values
    values: Values
    origin: Text

    def record(self) -> dict[str, Any]:
        """Return the spectrum for JSON. Whole wavelengths have no fraction: spectra fill half of a small table."""
        whole = [int(wavelength) if wavelength.is_integer() else wavelength for wavelength in self.wavelengths_nm]
        return {**self.model_dump(mode="json"), "wavelengths_nm": whole}

    @model_validator(mode="after")
    def _check_lengths(self) -> Spectrum:
        if np.any(np.diff(check_nanometres("wavelengths_nm", self.wavelengths_nm)) <= 0.0):
            raise ParameterError("wavelengths_nm", "those of a spectrum must be positive and increase strictly")
        if len(self.values) != len(self.wavelengths_nm):
            text = f"{len(self.values)} are given for {len(self.wavelengths_nm)} wavelengths of a spectrum"
            raise ParameterError("values", text)
        return self

    def at(self, name: str, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the reflectance [1] of the parameter `name` at wavelengths [nm], in their shape.

        ParameterError says that a wavelength is outside the range of the spectrum.
        """
        low = self.wavelengths_nm[0]
        high = self.wavelengths_nm[-1]
        outside = ~((wavelength_nm >= low) & (wavelength_nm <= high))
        if np.any(outside):
            hint = "; are they micrometres? A spectrum is in nm" if high < _LEAST_NM else ""
            wrong = float(np.atleast_1d(wavelength_nm)[np.atleast_1d(outside)][0])
            text = f"{wrong:g} has no {name}, whose spectrum covers [{low:g}, {high:g}] nm{hint}"
            raise ParameterError("wavelength_nm", text, wrong, (low, high))
        return np.asarray(np.interp(wavelength_nm, self.wavelengths_nm, self.values))

    def __str__(self) -> str:
        if len(self.values) == 1:
            return f"{self.values[0]:.6g} at {self.wavelengths_nm[0]:g} nm"
        values = f"{min(self.values):.3g} to {max(self.values):.3g}"
        return f"{values} over {self.wavelengths_nm[0]:g} to {self.wavelengths_nm[-1]:g} nm"

    def __format__(self, _: str) -> str:
        return str(self)


def made_lossless(
    lossless: Callable[[Mapping[str, Any]], dict[str, Any]], parameters: Mapping[str, Any]
) -> dict[str, float | Spectrum]:
    """Return the changes that a model's `lossless` makes to parameters, which may be numbers or spectra.

    Spectra are joined: they get the wavelengths of all of them that lie in the range of each.
    """
    spectra = {name: value for name, value in parameters.items() if isinstance(value, Spectrum)}
    if not spectra:
        return lossless(parameters)
    every = np.unique(np.concatenate([value.wavelengths_nm for value in spectra.values()]))
    low = max(value.wavelengths_nm[0] for value in spectra.values())
    high = min(value.wavelengths_nm[-1] for value in spectra.values())
    nodes = every[(every >= low) & (every <= high)]
    given = {**parameters, **{name: value.at(name, nodes) for name, value in spectra.items()}}
    return {
        name: Spectrum(wavelengths_nm=tuple(nodes.tolist()), values=tuple(value.tolist()), origin="made lossless")
        if np.ndim(value)
        else float(value)
        for name, value in lossless(given).items()
    }


def assumptions(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return an assumption for each spectrum whose origin says that it is assumed."""
    return {
        name: {"why": value.origin}
        for name, value in parameters.items()
        if isinstance(value, Spectrum) and UPSAMPLED in value.origin
    }


# Spectra as files write them


def spectrum_of(name: str, written: Any, wavelengths_nm: Any = None, folder: Path | None = None) -> Spectrum:
    """Return the spectrum that a file writes as the value of the parameter `name`.

    A list has one value for each of `wavelengths_nm`. A mapping has ``wavelengths_nm`` and ``values``, with ``origin``
    if it is known; or ``csv``, a file of lines ``wavelength_nm, value``; or ``srgb``, three numbers in [0, 1] or
    ``"#rrggbb"``, encoded as displays take them; or ``measured``, ``CHECKER/PATCH`` of colour-science. The relative
    path of a CSV file begins at `folder`, by default the working directory.

    Order and number of the values are checked, their range is not yet. ParameterError if the value is written in
    another way, a file cannot be read, or a name is unknown.
    """
    if isinstance(written, list | tuple):
        if not isinstance(wavelengths_nm, list | tuple) or len(wavelengths_nm) != len(written):
            given = f"{len(wavelengths_nm)} are given" if isinstance(wavelengths_nm, list | tuple) else "none are given"
            raise ParameterError(
                name, f"a list of {len(written)} values needs as many wavelengths_nm, {given}", written
            )
        return _spectrum(name, wavelengths_nm, written, "listed with the material")
    if not isinstance(written, Mapping):
        raise ParameterError(
            name, f"{written!r} is neither a number nor a spectrum; a spectrum is one of: {WAYS}", written
        )
    fields = set(written)
    if fields == {"csv"}:
        return _of_csv(name, written["csv"], folder)
    if fields == {"srgb"}:
        return _of_srgb(name, written["srgb"])
    if fields == {"measured"}:
        return _of_measured(name, written["measured"])
    if {"wavelengths_nm", "values"} <= fields <= {"wavelengths_nm", "values", "origin"}:
        origin = written.get("origin", "listed with the material")
        return _spectrum(name, written["wavelengths_nm"], written["values"], origin)
    text = f"a spectrum with {', '.join(sorted(map(str, fields))) or 'nothing'}; give one of: {WAYS}"
    raise ParameterError(name, text, dict(written))


def _spectrum(name: str, wavelengths_nm: Any, values: Any, origin: Any) -> Spectrum:
    try:
        return Spectrum(wavelengths_nm=wavelengths_nm, values=values, origin=origin)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(map(str, first["loc"]))
        raise ParameterError(name, f"{field}: {sentence_of(first)}" if field else sentence_of(first)) from None


def _of_csv(name: str, path: Any, folder: Path | None) -> Spectrum:
    if not isinstance(path, str):
        raise ParameterError(name, f"csv: {path!r} is not the path of a file", path)
    file = (folder or Path()) / path_of(path, name)
    try:
        if file.stat().st_size > _MOST_BYTES:
            raise ParameterError(name, f"{path} has more than {_MOST_BYTES} bytes", path)
        text = file.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ParameterError(name, f"{path}: {error.strerror or error}", path) from None
    except UnicodeDecodeError:
        raise ParameterError(name, f"{path} is not text in UTF-8", path) from None
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.partition("#")[0].replace(",", " ").replace(";", " ").split()
        if not cells:
            continue
        try:
            wavelength, value = map(float, cells)
        except ValueError:
            if rows or any(cell[0].isdigit() for cell in cells):  # a line of words before the first numbers is a header
                raise ParameterError(
                    name, f"{path}, line {number}: {line[:40]!r} is not a wavelength [nm] and a value", line
                ) from None
            if unit := _OTHER_UNITS.search(line):
                sentence = f"{path}, line {number}: {unit[0]!r} in the header; give nm and fractions"
                raise ParameterError(name, sentence, line) from None
            continue
        rows.append((wavelength, value))
    if not 2 <= len(rows) <= MOST_VALUES:
        raise ParameterError(name, f"{path} has {len(rows)} lines of values; allowed are 2 to {MOST_VALUES}", path)
    wavelengths, values = zip(*rows, strict=True)
    return _spectrum(name, wavelengths, values, f"file {Path(path).name}")


def _of_srgb(name: str, written: Any) -> Spectrum:
    code = written
    if isinstance(written, str) and _HEX.fullmatch(written):
        code = [int(written[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    if not (isinstance(code, Sequence) and len(code) == 3 and all(map(_is_share, code))):
        raise ParameterError(name, f'srgb: {written!r} is not three numbers in [0, 1] or "#rrggbb"', written)
    encoded = np.array(code, dtype=np.float64)
    # IEC 61966-2-1: the decoding of sRGB
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    colour = colour_science()
    shape = colour.SpectralShape(*_SHAPE_NM)
    made = colour.recovery.XYZ_to_sd_Jakob2019(
        colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ @ linear,
        colour.MSDS_CMFS[OBSERVER].copy().align(shape),
        colour.SDS_ILLUMINANTS[ILLUMINANT].copy().align(shape),
    )
    # straight lines between every second wavelength, fitted to the spectrum, preserve the colour
    nodes = made.wavelengths[::2]
    lines = np.column_stack([np.interp(made.wavelengths, nodes, one) for one in np.eye(nodes.size)])
    fitted = np.clip(np.linalg.lstsq(lines, made.values, rcond=None)[0], 0.0, 1.0)
    words = written if isinstance(written, str) else ", ".join(f"{value:g}" for value in code)
    values = [float(f"{value:.6g}") for value in fitted.tolist()]  # a colour has fewer digits
    return _spectrum(name, nodes.tolist(), values, f"sRGB {words}, {UPSAMPLED}")


def _is_share(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= 1.0


def _of_measured(name: str, written: Any) -> Spectrum:
    checkers = colour_science().SDS_COLOURCHECKERS
    known = {f"{checker}/{patch}": (checker, patch) for checker in checkers for patch in checkers[checker]}
    if not isinstance(written, str) or written not in known:
        near = closest(str(written), known)
        raise ParameterError(name, f"measured: {written!r} is not CHECKER/PATCH of colour-science{near}", written)
    checker, patch = known[written]
    sd = checkers[checker][patch]
    origin = f"{patch} of the colour checker {checker}, measured; colour-science"
    return _spectrum(name, sd.wavelengths.tolist(), sd.values.tolist(), origin)
