"""Rows of arguments: a row shares its scalars and varies its columns, so that one loop serves all shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from brdfdb.geometry import Angles, Directions, Vectors, finished
from brdfdb.parameters import Floats

Loop = Callable[..., None]
Out = Floats | None  # the array that takes the values of a call, or a part of it


class RowLoops(NamedTuple):
    """The two loops of a model, and the features of the directions that the loop by angles reads.

    Attributes
    ----------
    by_angles : loop
        Called as `by_rows` says, with the features `columns`, and with scalars that are the features `polar` and then
        the parameters.
    by_vectors : loop
        Called as `by_rows_of_vectors` says, with the parameters as scalars.
    columns, polar : callable
        Functions of `brdfdb.geometry.Angles` that return several of its properties.
    of_viewers : bool
        True if a row may run along any viewers. False if it runs along azimuths only.
    single : bool
        True if the loop by angles itself writes float32 for directions in float32.
    """

    by_angles: Loop
    by_vectors: Loop
    columns: Callable[[Angles], tuple[Floats, ...]] = attrgetter("cos_phi_r", "sin_phi_r")
    polar: Callable[[Angles], tuple[Floats, ...]] = attrgetter("x_i", "y_i", "cos_i", "sin_r", "cos_r")
    of_viewers: bool = False
    single: bool = False

    def evaluated(self, directions: Directions, out: Out, parameters: Sequence[Floats]) -> Floats:
        """Return f_r [1/sr] at directions of either kind, written to `out` where it fits."""
        if isinstance(directions, Vectors):
            return by_rows_of_vectors(self.by_vectors, directions, parameters, out)
        if directions.lights_scattered if self.of_viewers else directions.scattered:
            return finished(by_rows_of_vectors(self.by_vectors, directions.vectors, parameters, out), directions)
        scalars = (*self.polar(directions), *parameters)
        dtype = directions.dtype if self.single else np.float64
        return finished(by_rows(self.by_angles, self.columns(directions), scalars, dtype, out), directions)


def by_rows(
    loop: Loop,
    columns: Sequence[Floats],
    scalars: Sequence[Floats],
    dtype: DTypeLike = np.float64,
    out: Out = None,
) -> Floats:
    """Broadcast the arguments, call ``loop(*columns, scalars, values)`` and return the values.

    Parameters
    ----------
    loop : kernel
        It takes columns of shape (rows, length), or (1, length) where all rows share them, scalars of shape
        (count, rows) in the order given, and values of shape (rows, length), which it fills.
    columns, scalars : sequences of arrays
        They broadcast together. A row runs along the last axis if no scalar varies along it. If one does, each value
        is a row by itself, which is slower and equally right.
    dtype : dtype
        The dtype of the values.
    out : array, optional
        It takes the values if it has their shape and dtype.

    Returns
    -------
    array
        In the broadcast shape.
    """
    shape = np.broadcast_shapes(*(np.shape(array) for array in (*columns, *scalars)))
    rows, length, leading = _split(shape, scalars)
    values: Floats = _array_of_values(out, shape, dtype).reshape(rows, length)
    if values.size:
        of_rows = np.empty((len(scalars), *leading))  # grids have many rows, which this order fills three times as fast
        for i, scalar in enumerate(scalars):
            of_rows[i] = scalar
        packed = of_rows.reshape(len(scalars), rows)
        loop(*(_column(array, shape, rows, length) for array in columns), packed, values)
    return values.reshape(shape)[()]


def by_rows_of_vectors(
    loop: Loop, directions: Vectors, scalars: Sequence[Floats], out: Out = None, several: tuple[int, ...] = ()
) -> Floats:
    """Call ``loop(w_i, w_r, scalars, values)`` as `by_rows` does, with unit vectors of shape (rows or 1, length, 3).

    Scalars have the shape (rows, count). The loop itself writes 0 below the horizon and nan where a vector is nan.
    Values have the dtype of the directions. With `several` = (count,) it fills values of shape (count, rows, length),
    and that axis comes first in the result.
    """
    w_i, w_r = directions.w_i, directions.w_r
    shape = np.broadcast_shapes(w_i.shape[:-1], w_r.shape[:-1], *(np.shape(array) for array in scalars))
    rows, length, leading = _split(shape, scalars)
    values: Floats = _array_of_values(out, (*several, *shape), directions.dtype).reshape(*several, rows, length)
    if values.size:
        common = np.result_type(w_i, w_r)  # loops would be compiled anew for float32 beside float64
        both = (_vectors(w.astype(common, copy=False), shape, rows, length) for w in (w_i, w_r))
        loop(*both, _packed(scalars, leading, rows), values)
    return values.reshape((*several, *shape))[()]


def _array_of_values(out: Out, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    return out if out is not None and out.shape == shape and out.dtype == dtype else np.empty(shape, dtype)


def _split(shape: tuple[int, ...], scalars: Sequence[Floats]) -> tuple[int, int, tuple[int, ...]]:
    """Return the number of rows, their length, and the shape that scalars broadcast to."""
    along = bool(shape) and all(np.ndim(array) == 0 or np.shape(array)[-1] == 1 for array in scalars)
    leading = (*shape[:-1], 1) if along else shape
    length = shape[-1] if along else 1
    return math.prod(leading), length, leading


def _column(array: Floats, shape: tuple[int, ...], rows: int, length: int) -> NDArray[np.float64]:
    shared = np.ndim(array) and np.size(array) == np.shape(array)[-1] == length  # by all rows
    whole = np.ascontiguousarray(array if shared else np.broadcast_to(array, shape), dtype=np.float64)
    return _read_only(whole.reshape(1 if shared else rows, length))


def _vectors(array: Floats, shape: tuple[int, ...], rows: int, length: int) -> NDArray[Any]:
    shared = array.ndim > 1 and array.size == 3 * array.shape[-2] == 3 * length > 3  # a row of one value has its own
    wide = array if shared else np.broadcast_to(array, (*shape, 3))
    return _read_only(np.ascontiguousarray(wide).reshape(1 if shared else rows, length, 3))


def _read_only(view: NDArray[Any]) -> NDArray[Any]:
    """Return a view that is never writable: loops are compiled anew for arrays that are, seconds each time."""
    view.flags.writeable = False
    return view


def _packed(scalars: Sequence[Floats], leading: tuple[int, ...], rows: int) -> NDArray[np.float64]:
    packed = np.empty((*leading, len(scalars)))
    for i, scalar in enumerate(scalars):
        packed[..., i] = scalar
    return packed.reshape(rows, len(scalars))
