"""A table written in another format and read again: what the reader sees, against what the file states."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from brdfdb import formats
from brdfdb.formats import EXPORTERS, IMPORTERS
from brdfdb.formats._channels import RGB, XYZ, Channels, at_wavelength, channels_of
from brdfdb.formats._readings import FileTable
from brdfdb.formats._stated_error import Comparison
from brdfdb.geometry import unit_vector
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats
from brdfdb.tables.table import Table

ROUND_TRIPPED = [name for name in EXPORTERS if name in IMPORTERS]
_COLOURS = {RGB: "rgb", XYZ: "xyz", ("Y",): "grey"}


class Trip(NamedTuple):
    """A round trip: size [byte] of all files, stated and measured p99 [1], times [s] of writing and reading.

    `measured` is the p99 of what was read, at the pairs of the stated error; of samples, their largest error.
    """

    nbytes: int
    stated: float
    measured: float
    within: bool
    write_s: float
    read_s: float
    reading: FileTable | Samples


def round_trip(table: Table, folder: Path, file_format: str, **options: Any) -> Trip:
    """Write a table in a format, read the file, and compare it with the table."""
    path = folder / f"{table.name}{EXPORTERS[file_format].suffix}"
    began = time.perf_counter()
    written = formats.write(table, path, file_format, **options)
    wrote = time.perf_counter()
    reading = formats.read(path, file_format)
    read = time.perf_counter()
    assert written.error is not None, f"{file_format} states no error"
    return Trip(
        written.nbytes,
        written.error.p99,
        error_of(reading, table),
        written.within,
        wrote - began,
        read - wrote,
        reading,
    )


def channels(reading: FileTable | Samples, table: Table) -> Channels:
    """Return the channels of a table that those of a reading are compared with."""
    if reading.wavelength_nm is not None and reading.wavelength_nm.size == 1:
        return at_wavelength(table, float(reading.wavelength_nm[0]))
    return channels_of(table, _COLOURS.get(reading.channels, ""))


def error_of(reading: FileTable | Samples, table: Table) -> float:
    """Return the p99 of a reading against its table; of samples, the largest error at them."""
    compared = channels(reading, table)
    if isinstance(reading, Samples):
        return _of_samples(reading, table, compared)
    at = None if reading.wavelength_nm is None else compared.wavelength_nm

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        values = np.asarray(reading.lookup_vectors(wi, wr, at))
        return np.broadcast_to(values.reshape(len(wi), -1), (len(wi), len(compared.names)))

    return Comparison(table, compared).error_of(evaluate).p99


def _of_samples(samples: Samples, table: Table, compared: Channels) -> float:
    wi, wr = unit_vector(samples.theta_i, samples.phi_i), unit_vector(samples.theta_r, samples.phi_r)
    truth = compared.values(table, wi, wr)
    floor = 1e-3 * truth.mean(axis=0)
    return float(np.max(np.abs(samples.values - truth) / np.maximum(truth, floor)))
