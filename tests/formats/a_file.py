"""Files of the tests: small tables in each format, texts, and files that are refused in one sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.formats import EXPORTERS
from brdfdb.formats._readings import FileTable
from brdfdb.geometry import unit_vector
from brdfdb.measurements import Samples
from brdfdb.measurements.statement import statement
from brdfdb.parameters import Floats
from tests.formats.small_tables import DIFFUSE, small_table

ISOTROPIC_ALONE = ("eradiate", "fred", "merl", "openmaterial")
POLARISED_ALONE = ("kaist",)  # its own tests have polarised tables
SIZE = 0.3  # [MB] of astm, fred, ssdd and zemax
# Options with which formats write coarse files, and write them soon: each file states its own error
_COARSE = {"tolerance": 1.0, "size": 0.1, "cells": 2000.0, "megabytes": 0.5}
_OPTIONS: dict[str, dict[str, Any]] = {
    **{name: {"resolution": 30.0} for name in ("bird", "csv", "netcdf", "numpy", "openmaterial", "zarr")},
    **{name: {"tolerance": 0.2, "size": SIZE} for name in ("astm", "fred", "ssdd", "zemax")},
    "eradiate": {"nodes": 9},
    "klems": {"kind": "quarter"},
    "png": {},
}


def options_of(name: str) -> dict[str, Any]:
    """Return options with which a format writes a coarse file soon."""
    known = {option.name for option in EXPORTERS[name].options}
    return _OPTIONS.get(name, {option: value for option, value in _COARSE.items() if option in known})


def exported(folder: Path, name: str, kind: str = DIFFUSE, **options: Any) -> Path:
    """Write a small table as a coarse file `a` with the suffix of a format, and return its path."""
    path = folder / f"a{EXPORTERS[name].suffix}"
    return formats.write(small_table(kind), path, name, **{**options_of(name), **options}).paths[0]


def read_table(path: Path, file_format: str = "", **keywords: Any) -> FileTable:
    """Return what a file holds, which is f_r in all directions."""
    reading = formats.read(path, file_format, **keywords)
    assert isinstance(reading, FileTable)
    return reading


def samples_of(folder: Path, text: str, name: str = "sheet.csv", **keywords: Any) -> Samples:
    """Return the samples of a text in a file."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return formats.samples(path, **keywords)


def notes_of(samples: Samples) -> str:
    """Return the notes of a statement on samples, a note a line."""
    return "\n".join(statement(samples).notes)


def random_pairs(count: int, seed: int = 11, least_cosine: float = 0.02) -> tuple[Floats, Floats]:
    """Return unit vectors (N, 3) of lights and viewers over the hemisphere, above a least cosine."""
    rng = np.random.default_rng(seed)
    theta, phi = np.arccos(rng.uniform(least_cosine, 1.0, (2, count))), rng.uniform(-np.pi, np.pi, (2, count))
    return unit_vector(theta[0], phi[0]), unit_vector(theta[1], phi[1])


def check_refused(path: Path, pattern: str = "", file_format: str = "", **keywords: Any) -> None:
    """Check that a file is refused with a pattern in a sentence of one line, which names the file."""
    with pytest.raises(FileFormatError, match=pattern or None) as refusal:
        formats.samples(path, file_format, **keywords)
    assert path.stem in str(refusal.value)
    assert "\n" not in str(refusal.value)


def check_texts_refused(
    path: Path, damages: Mapping[str, str] | Iterable[tuple[str, str]], file_format: str = "", **keywords: Any
) -> None:
    """Check that each text is refused with the pattern that belongs to it."""
    for text, pattern in damages.items() if isinstance(damages, Mapping) else damages:
        path.write_text(text, encoding="utf-8")
        check_refused(path, pattern, file_format, **keywords)


def check_changes_refused(path: Path, text: str, changes: Iterable[tuple[str, str, str]], file_format: str) -> None:
    """Check that a text is refused after each change: an old part, a new part and the pattern of the sentence."""
    for old, new, pattern in changes:
        assert old in text
        check_texts_refused(path, [(text.replace(old, new), pattern)], file_format)
