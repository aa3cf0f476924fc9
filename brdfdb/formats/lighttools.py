"""LightTools BSDF files: f_r about the normal as text, one block for each direction of the light.

After a list of azimuths and polar angles of the viewer each block has an angle of incidence, a side, a wavelength or a
tristimulus value, the total integrated scatter and f_r in 1/sr. Azimuths are those of the viewer, with the light at 90
degrees (libbsdf, ``LightToolsBsdfReader.cpp``). Blocks of the front with the type BRDF are read.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._channels import XYZ, names_of
from brdfdb.formats._doubts import doubt_comments
from brdfdb.formats._input import Words
from brdfdb.formats._nodes import rows_of_grid
from brdfdb.formats._record import of_lines
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.measurements.conventions import ListedRows

suffix = ".bsdf"
angle_unit = "stated"
keywords = ("wavelength_unit",)
_SYMMETRY = "Asymmetric"
_LIGHT_DEG = 90.0
signs = re.compile(rb"^(?:TristimulusValue|POI)\b|^AOI[ \t]+[-\d.]+[ \t]*$", re.MULTILINE)
_ENTRIES = ("AOI", "POI", "Side", "Wavelength", "ScatterType", "TristimulusValue")
_TRISTIMULUS = ("TrisX", "TrisY", "TrisZ")


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a LightTools file, whose symmetry no Zemax file has."""
    lines = (line.split() for line in head.split(b"\n") if not line.lstrip().startswith(b"#"))
    return any(words[:2] == [b"Symmetry", _SYMMETRY.encode()] for words in lines)


def read(path: str | os.PathLike[str], *, wavelength_unit: str = "") -> ListedRows:
    """Return the rows of the front of a LightTools file; the user states the unit of its wavelengths.

    The record has the total integrated scatter as "tis", with its angles of incidence as "theta_i_deg". Planes of
    incidence that differ are refused: what POI counts from is not published.
    """
    from brdfdb.formats._angles import Spherical

    path = path_of(path)
    words = Words(path)
    lists = _lists(words)
    blocks = _blocks(words, lists["ScatterAzimuth"].size * lists["ScatterRadial"].size)
    kept = [block for block in blocks if block["Side"] == "Front" and block["ScatterType"] == "BRDF"]
    if not kept or len({block["POI"] for block in kept}) > 1:
        raise FileFormatError(
            f"{path}: field Side: it has no block with Side Front and ScatterType BRDF, or these blocks differ in POI"
        )
    incidences = sorted({float(block["AOI"]) for block in kept})
    keys = [key for key in _TRISTIMULUS if any(block["TristimulusValue"] == key for block in kept)]
    keys = keys or sorted({block["Wavelength"] for block in kept}, key=float)
    grid: dict[tuple[float, str], dict[str, Any]] = {}
    for block in kept:
        key = float(block["AOI"]), block["TristimulusValue"] or block["Wavelength"]
        if key in grid:
            raise FileFormatError(
                f"{path}: line {block['line']}, field AOI: {key[0]:g} degrees are listed twice for {key[1]}"
            )
        grid[key] = block
    if len(grid) != len(incidences) * len(keys):
        raise FileFormatError(f"{path}: field AOI: an angle of incidence lacks a block of {', '.join(keys)}")
    shape = (lists["ScatterAzimuth"].size, lists["ScatterRadial"].size)
    values = np.stack([[grid[aoi, key]["values"].reshape(shape) for key in keys] for aoi in incidences])
    at, channels = _channels(words, keys, wavelength_unit)
    record = of_lines(words.comments) | {
        "theta_i_deg": incidences,
        "tis": [[[grid[aoi, key]["tis"] for key in keys] for aoi in incidences]],
    }
    doubt_comments(words.comments, record)
    nodes = (np.array(incidences), np.zeros(1), lists["ScatterRadial"], lists["ScatterAzimuth"] - _LIGHT_DEG)
    return rows_of_grid(
        Spherical(anisotropic=True, mirrored=False),
        [np.deg2rad(axis) for axis in nodes],
        values.transpose(0, 3, 2, 1)[:, np.newaxis],
        path.stem,
        channels,
        at,
        record,
    )


def _lists(words: Words) -> dict[str, NDArray[np.float64]]:
    """Return the lists of angles [degree] in the header."""
    lists: dict[str, NDArray[np.float64]] = {}
    name = ""
    line = 0  # of the last entry, whose value may have several words
    for word in words:
        if word in ("ScatterAzimuth", "ScatterRadial"):
            if word in lists:
                raise words.error(word, "it is stated twice; write a file for each header")
            lists[word] = words.numbers(words.count(word), word)
            if np.any(np.diff(lists[word]) <= 0.0):
                raise words.error(word, "its angles do not increase")
            name = word
        elif word == "DataBegin":
            break
        elif word[:1] in "+-.0123456789" and name in lists:
            raise words.error(name, f"{word[:40]!r} is one number more than are stated")
        elif words.line != line:
            name = word[:40]
            line = words.line
    for name in ("ScatterAzimuth", "ScatterRadial"):
        if name not in lists or not lists[name].size:
            raise words.error(name, "it is missing before DataBegin")
    return lists


def _blocks(words: Words, count: int) -> list[dict[str, Any]]:
    """Return the blocks of a file: their entries, their total integrated scatter and their values."""
    blocks: list[dict[str, Any]] = []
    empty = {"POI": "0", "Side": "Front", "Wavelength": "0", "ScatterType": "BRDF", "TristimulusValue": ""}
    block: dict[str, Any] = dict(empty)
    for word in words:
        if word in _ENTRIES:
            block[word] = words.next(word)
        elif word == "TIS":
            block |= {"line": words.line, "tis": float(words.numbers(1, word)[0])}
            for name in ("AOI", "Wavelength"):
                try:
                    float(block.get(name, ""))
                except ValueError:
                    raise words.error(name, f"{block.get(name, '')!r} is not a number") from None
            block["values"] = words.numbers(count, f"TIS of block {len(blocks) + 1}")
            blocks.append(block)
            block = dict(empty)
        elif word == "DataEnd":
            words.end(word, "the last block")
            return blocks
        else:
            text = f"{word[:40]!r} is no entry of a block; ScatterAzimuth and ScatterRadial state {count} values"
            raise words.error(f"block {len(blocks) + 1}", text)
    raise words.error("DataEnd", f"the file ends without it, after {len(blocks)} blocks")


def _channels(words: Words, keys: list[str], stated_unit: str) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Return wavelengths [nm], and names of channels, of the blocks of an angle of incidence.

    Numbers from 100 on are nm, from 0.1 to 100 um, and below 1e-3 m, unless the user states their unit.
    """
    if keys[0] in _TRISTIMULUS:
        return None, tuple(XYZ[_TRISTIMULUS.index(key)] for key in keys)
    lengths = np.array([float(key) for key in keys])
    if np.any(lengths <= 0.0):
        return None, ("grey",)
    if not stated_unit:
        scales = np.select([lengths >= 100.0, lengths >= 0.1, lengths < 1e-3], [1.0, 1e3, 1e9], np.nan)
        if np.unique(scales).size > 1 or np.isnan(scales[0]):
            text = f"{', '.join(keys)[:80]} have no unit in common; state --wavelength-unit nm, um or m"
            raise words.error("Wavelength", text)
        lengths = np.round(lengths * scales, 9)
    return lengths, names_of(lengths)
