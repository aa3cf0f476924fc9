"""Samples of several files or pictures of one surface as one, and what contradicts between them."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, counted
from brdfdb.geometry import degrees
from brdfdb.measurements.conventions import ANGLES, NODES, RELATIVE
from brdfdb.measurements.instrument import Instrument
from brdfdb.measurements.samples import Samples, percent
from brdfdb.parameters import Floats

_BETWEEN = " _-.,+"  # signs between the words of a name
_WORD = re.compile(r"\d+|[^\W\d_]+|[\W_]+")
_LISTED = 12  # wavelengths that a sentence names
_SHOWN = 100  # characters of the channels of a part that a refusal repeats
_SAME_DEG = 0.01  # directions closer than this are one
_RATIO = 1.3  # of the larger to the smaller value, in the median, above which files contradict
_HIGH = 0.9  # share of directions below the ratio that shows lobes that differ where the rest agrees
_TAIL = 5.0  # logarithms of such a ratio over that of the median, at least: of normal noise it is 2.4
_UNLIKELY = 3.0  # standard uncertainties of the difference, in the median, from which on files contradict


def joined(parts: Sequence[Samples]) -> Samples:
    """Return the samples of several pictures or files of one surface as one.

    Parts of different wavelengths become channels of all of them: values of the same directions are one sample, and
    those that another part has at the same directions and wavelength are repeated measurements. The name is the words
    that all names begin with, or all names. The record is that of the first part, with the notes and counts of all;
    instruments and origins are those of all. Where parts hold different values at the same directions, a sentence says
    so in the entry "contradiction" of the record. Uncertainties are left out, with a note, unless all parts state them.
    ParameterError if there is no part, channels without wavelengths differ, or azimuths have no direction in common:
    those of one part are relative to its light, and lights of another come from other azimuths of the surface.
    """
    if not parts:
        raise ParameterError("parts", "there are no samples to join", 0)
    parts, merged = _at_all_wavelengths(parts)
    first = parts[0]
    relative = next((part for part in parts if part.record.get("azimuths") == RELATIVE), None)
    for other in parts:
        _check_channels(first, other)
        of_surface = other.record.get("azimuths") != RELATIVE and np.any((other.theta_i > 0.0) & (other.phi_i != 0.0))
        if relative is not None and of_surface:
            text = f"azimuths of {relative.name} are relative to the light, and those of {other.name} to the surface"
            raise ParameterError("parts", text, other.name)
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in (*ANGLES, "values")
    }
    noises = [part.uncertainty for part in parts if part.uncertainty is not None]
    uncertainty = np.concatenate(noises) if len(noises) == len(parts) else None
    matrices = [part.mueller for part in parts if part.mueller is not None]
    instrument = first.instrument
    if any(part.instrument != instrument for part in parts):
        instrument = Instrument(
            "; ".join(dict.fromkeys(part.instrument.name for part in parts if part.instrument.name))
        )
    provenance = "; ".join(dict.fromkeys(part.provenance for part in parts if part.provenance))
    names = list(dict.fromkeys(part.name for part in parts))
    whole = replace(
        first,
        **arrays,
        name=common_name(names) or " and ".join(names),
        uncertainty=uncertainty,
        mueller=np.concatenate(matrices) if len(matrices) == len(parts) else None,
        instrument=instrument,
        provenance=provenance,
        record=_record(parts),
    )
    return _merged(whole, merged) if merged else whole


class CellsOfRows(NamedTuple):
    """Rows of values (N, C), uncertainties and matrices (N, C, 4, 4) of all wavelengths.

    `first` (N,) are the numbers of cells that have their directions.
    """

    first: NDArray[np.intp]
    values: NDArray[np.float64]
    uncertainty: NDArray[np.float64] | None
    mueller: NDArray[np.float64] | None


def in_columns(
    same: NDArray[np.intp],
    channel: NDArray[np.intp],
    count: int,
    values: Floats,
    uncertainty: Floats | None,
    mueller: Floats | None,
) -> CellsOfRows:
    """Return values (N,) that have one of `count` channels each as rows of all, where `same` (N,) numbers directions.

    Values of the same direction and channel are in several rows; what is missing is nan.
    """
    first = np.unique(same, return_index=True)[1]
    cell = same * count + channel
    order = np.argsort(cell, kind="stable")
    starts = np.flatnonzero(np.append(True, np.diff(cell[order]) > 0))
    again: NDArray[np.intp] = np.empty(len(cell), dtype=np.intp)  # number of earlier measurements of the same
    again[order] = np.arange(len(cell)) - np.repeat(starts, np.diff(np.append(starts, len(cell))))
    row = again * first.size + same

    def table(cells: Floats) -> NDArray[np.float64]:
        grid = np.full(((int(again.max(initial=0)) + 1) * first.size, count, *cells.shape[1:]), np.nan)
        grid[row, channel] = cells
        return grid

    wide = table(values)
    known = np.flatnonzero(np.any(np.isfinite(wide), axis=1))
    others = (cells if cells is None else table(cells)[known] for cells in (uncertainty, mueller))
    return CellsOfRows(first[known % first.size], wide[known], *others)


def _at_all_wavelengths(parts: Sequence[Samples]) -> tuple[Sequence[Samples], str]:
    """Return parts with the channels of all, and a sentence on it; the parts themselves if they have the same."""
    lengths = [part.wavelength_nm for part in parts]
    given = [at for at in lengths if at is not None]
    if len(given) < len(parts) or all(np.array_equal(at, given[0]) for at in given):
        return parts, ""
    union: NDArray[np.float64] = np.unique(np.round(np.concatenate(given), 6))
    widths: dict[float, float] = {}
    for part, at in zip(parts, given, strict=True):
        if part.bandwidth_nm is not None:
            widths |= dict(zip(np.round(at, 6).tolist(), part.bandwidth_nm.tolist(), strict=True))
    wide = []
    for part, at in zip(parts, given, strict=True):
        place = np.searchsorted(union, np.round(at, 6))
        tables: dict[str, Any] = {}
        for name in ("values", "uncertainty", "mueller"):
            table = getattr(part, name)
            tables[name] = None if table is None else np.full((len(part), union.size, *table.shape[2:]), np.nan)
            if table is not None:
                tables[name][:, place] = table
        bandwidth = np.array([widths[nm] for nm in union]) if set(widths) == set(union.tolist()) else None
        names = tuple(f"{nm:g}nm" for nm in union)
        wide.append(replace(part, channels=names, wavelength_nm=union, bandwidth_nm=bandwidth, **tables))
    counts = np.sum([np.isin(union, np.round(at, 6)) for at in given], axis=0)
    shown = ", ".join(f"{nm:g}" for nm in union[:_LISTED]) + (" and others" if union.size > _LISTED else "")
    text = f"Files of different wavelengths were joined to channels of {shown} nm"
    if np.any(counts > 1):
        text += "; where several have the same wavelength and directions, they are repeated measurements"
    return wide, f"{text}."


def _merged(samples: Samples, note: str) -> Samples:
    """Return samples whose values of the same directions at several wavelengths are one sample."""
    row, channel = np.nonzero(samples.known)
    _, same = np.unique(_codes(samples)[row], return_inverse=True)
    others = (table if table is None else table[row, channel] for table in (samples.uncertainty, samples.mueller))
    cells = in_columns(same.reshape(-1), channel, len(samples.channels), samples.values[row, channel], *others)
    chosen = row[cells.first]
    record = {**samples.record, "notes": [*samples.record.get("notes", ()), note]}
    tables: dict[str, Any] = dict(zip(cells._fields[1:], cells[1:], strict=True))
    whole = replace(samples.selected(chosen), **tables, record=record)
    contradiction = contradiction_within(whole)
    return replace(whole, record={**record, "contradiction": contradiction}) if contradiction else whole


def common_name(names: Sequence[str]) -> str:
    """Return the words and numbers that all names begin with, such as tile of tile_10 and tile_30; "" if none."""
    columns = zip(*(_WORD.findall(name) for name in names), strict=False)
    same = itertools.takewhile(lambda words: len(set(words)) == 1, columns)
    return "".join(words[0] for words in same).strip(_BETWEEN)


def _record(parts: Sequence[Samples]) -> dict[str, Any]:
    """Return the record of the first part with the notes and counts of all, and what contradicts."""
    records = [part.record for part in parts]
    record = dict(records[0])
    notes = list(dict.fromkeys(str(text) for some in records for text in some.get("notes", ())))
    without = [part.name for part in parts if part.uncertainty is None]
    if 0 < len(without) < len(parts):
        verb = "states" if len(without) == 1 else "state"
        notes.append(f"Standard uncertainties were left out: {' and '.join(without)} {verb} none.")
    left = list(dict.fromkeys(name for some in records for name in some.get("columns_left_out", ())))
    counts = {key: sum(some.get(key, 0) for some in records) for key in ("below_the_horizon", "repeated")}
    entries = {"notes": notes, "columns_left_out": left, **counts, "contradiction": _contradiction(parts)}
    record |= {key: value for key, value in entries.items() if value}
    if not all(some.get(NODES) for some in records):
        record.pop(NODES, None)
    return record


def _check_channels(first: Samples, other: Samples) -> None:
    """Raise ParameterError if the channels of two parts differ."""
    if other.channels != first.channels:
        names = (", ".join(part.channels) for part in (other, first))
        theirs, ours = (text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..." for text in names)
        raise ParameterError(
            "parts", f"{other.name} has the channels {theirs}, and {first.name} has {ours}", other.channels
        )
    for name in ("wavelength_nm", "bandwidth_nm"):
        one, two = getattr(first, name), getattr(other, name)
        if (one is None) != (two is None) or (one is not None and not np.array_equal(one, two)):
            raise ParameterError("parts", f"{other.name} and {first.name} differ in {name}", two)


def _contradiction(parts: Sequence[Samples]) -> str:
    """Return a sentence if parts hold different values at the same directions, else an empty text.

    Each part is compared with those before it, direction by direction, and the one that differs most is named. They
    contradict if the larger value is 1.3 times the smaller one in the median, or the difference three times its
    uncertainty.
    """
    codes = [_codes(part) for part in parts]
    values = np.concatenate([part.values for part in parts])
    noises = np.concatenate([_noise(part) for part in parts])
    worst = _Difference(0.0, "")
    for number in range(1, len(parts)):
        before = np.concatenate(codes[:number])
        _, one, two = np.intersect1d(before, codes[number], return_indices=True)
        files = "both files have" if len(parts) == 2 else f"{parts[number].name} and files before it have"
        worst = max(
            worst, _difference(values, noises, one, two + len(before), files), key=lambda difference: difference.ratio
        )
    recorded = [str(part.record["contradiction"]) for part in parts if "contradiction" in part.record]
    return worst.sentence or next(iter(recorded), "")


def contradiction_within(samples: Samples) -> str:
    """Return a sentence if samples hold different values at the same directions, else an empty text.

    Each sample is compared with the first one of its directions. They contradict as those of joined files do.
    """
    _, first, directions = np.unique(_codes(samples), return_index=True, return_inverse=True)
    one = first[directions]
    again = np.flatnonzero(one != np.arange(one.size))
    return _difference(samples.values, _noise(samples), one[again], again, "more than one row has").sentence


class _Difference(NamedTuple):
    """The ratio of values at the same directions, in the median or lobes, and a sentence; 0, "" if they agree."""

    ratio: float
    sentence: str


def _difference(
    values: Floats, noises: Floats, one: NDArray[np.intp], two: NDArray[np.intp], holders: str
) -> _Difference:
    """Return the difference of rows `one` and `two` (n,), which have the same directions.

    `values` and `noises` (N, C) [1/sr] are f_r and its standard uncertainties, 0 where none is stated. `holders` is
    what has the directions, with its verb.
    """
    positive = np.minimum(values[one], values[two]) > 0.0
    if not positive.any():
        return _Difference(0.0, "")
    a = values[one][positive]
    b = values[two][positive]
    u = np.hypot(noises[one], noises[two])[positive]
    ratio, high = np.quantile(np.maximum(a, b) / np.minimum(a, b), [0.5, _HIGH]).tolist()
    stated = (u > 0.0) & np.isfinite(u)
    beyond = stated.any() and float(np.median(np.abs(a - b)[stated] / u[stated])) > _UNLIKELY
    in_lobes = high > max(_RATIO, ratio**_TAIL)
    if not (ratio > _RATIO or beyond or in_lobes):
        return _Difference(0.0, "")
    end = ", which is beyond the stated uncertainties" if beyond else ""
    directions = counted(np.unique(one[np.any(positive, axis=1)]).size, "direction")
    some = f", and by more than {percent(high - 1.0)} at a tenth" if in_lobes else ""
    text = f"At {directions} that {holders}, f_r differs by {percent(ratio - 1.0)} in the median{some}{end}."
    return _Difference(max(ratio, high) if in_lobes else ratio, text)


def _noise(part: Samples) -> Floats:
    """Return the standard uncertainties (N, C) [1/sr] of a part, 0 where none is stated."""
    return np.zeros(part.values.shape) if part.uncertainty is None else part.uncertainty


def _codes(part: Samples) -> NDArray[np.int64]:
    """Return a number for each pair of directions, shape (N,): the same number, the same directions."""
    code = np.zeros(len(part.theta_i), dtype=np.int64)
    turn = round(360.0 / _SAME_DEG)
    for theta, phi in ((part.theta_i, part.phi_i), (part.theta_r, part.phi_r)):
        ring, azimuth = (np.rint(degrees(angle) / _SAME_DEG).astype(np.int64) for angle in (theta, phi))
        code = (code * turn + ring) * turn + np.where(ring == 0, 0, azimuth % turn)
    return code
