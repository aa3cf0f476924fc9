"""Files of three planes of 64-bit floats, one a colour: their byte order, their layout and their holes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.parameters import Floats

_SMOOTHER = 0.5  # roughness of the right layout to that of the wrong one, at most
_EVERY = 8  # of the blocks of the first angle, of which roughness is measured
_SOME = 97  # every so many numbers tell the byte order
_USUAL = (1e-25, 1e15)  # size of values: those of the other byte order are smaller or larger
BIG_ENDIAN = "The numbers of the file are big-endian."
INTERLEAVED = "The file is interleaved: R, G and B of a direction follow each other, and not the planes of the colours."


class Planes(NamedTuple):
    """Numbers (3, *shape), nan where the file has none, and sentences on how they were read."""

    numbers: Floats
    notes: tuple[str, ...]


def read_planes(path: Path, offset: int, shape: Sequence[int]) -> Planes:
    """Return the planes behind `offset` bytes of a file, whose last angle changes fastest.

    The byte order is the one in which more numbers are likely values. Colours that alternate from number to number are
    told from planes by the roughness over the last angle. nan is a hole. FileFormatError if a number is infinite.
    """
    numbers = np.fromfile(path, "<f8", offset=offset).astype(np.float64, copy=False)
    big_endian = _likely(numbers[::_SOME].byteswap()) > _likely(numbers[::_SOME])
    if big_endian:
        numbers = numbers.byteswap()
    if np.any(infinite := np.isinf(numbers)):
        first = int(np.argmax(infinite))
        raise FileFormatError(
            f"{path}: number {first + 1} of {numbers.size} is infinite; a hole must be negative or nan"
        )
    notes = (BIG_ENDIAN,) if big_endian else ()
    planes = numbers.reshape(3, *shape)
    if _interleaved(planes):
        planes = np.ascontiguousarray(np.moveaxis(numbers.reshape(*shape, 3), -1, 0))
        notes = (*notes, INTERLEAVED)
    if holes := int(np.count_nonzero(np.isnan(numbers))):
        notes = (*notes, f"{holes} numbers are nan and were read as holes.")
    return Planes(planes, notes)


def _likely(numbers: NDArray[np.float64]) -> float:
    """Return the share of numbers that are likely values: 0, or of usual size."""
    size = np.abs(numbers)
    with np.errstate(invalid="ignore"):
        return float(np.mean((size == 0.0) | ((size > _USUAL[0]) & (size < _USUAL[1]))))


def _interleaved(planes: NDArray[np.float64]) -> bool:
    """Return True if numbers that are reshaped to planes are colours that alternate from number to number."""
    flat = planes.reshape(-1)
    runs = int(
        np.gcd.reduce(1 + np.flatnonzero(np.diff(np.nan_to_num(flat, nan=-1.0))))
    )  # the numbers of each are equal
    if runs > 1:  # no dependence on the last angles, or grey: each number follows three times
        return runs in 3 * np.cumprod([1, *planes.shape[:1:-1]])
    by_triples = planes.reshape(*planes.shape[1:], 3)[::_EVERY]
    return _roughness(by_triples, -2) < _SMOOTHER * _roughness(planes[:, ::_EVERY], -1)


def _roughness(numbers: NDArray[np.float64], axis: int) -> float:
    """Return the mean change of the logarithm of positive numbers from one to the next along an axis."""
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(np.diff(np.log(numbers), axis=axis))
    change = change[np.isfinite(change)]
    return float(change.mean()) if change.size else 0.0
