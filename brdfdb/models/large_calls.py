"""Large calls: an array that takes the result, and parts of a call on threads.

A part computes its values as the whole call does, bit for bit. It begins at a multiple of `STEP` rows, because kernels
work in blocks, or of two rows if they are long, because an axis of length 1 may be treated apart.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import asked_for
from brdfdb.parameters import Floats

PART = 1 << 21  # values of a part: the checks of each take 0.1 ms, 5 % of the time of the fastest kernel
PART_BY_ANGLES = 1 << 16  # of a call by scattered angles: new memory for their vectors takes as long as the call
STEP = 1024  # a multiple of every block of a kernel
_VECTORS = ("wi", "wr")
_DIRECTIONS = ("theta_i", "phi_i", "theta_r", "phi_r", *_VECTORS)


def in_parts(
    evaluate: Callable[[dict[str, Any], Floats | None], Floats],
    given: dict[str, Any],
    out: Floats | None,
    threads: int,
    *,
    part_size: int,
    together: str,
) -> Floats:
    """Return the values of a call, computed in parts on threads and written to `out` if it is given.

    Parameters
    ----------
    evaluate : callable
        ``evaluate(arguments, out)`` returns the values for some arguments. They are copied to `out` unless it wrote
        them there.
    given : dict
        The arguments by name, directions first.
    out, threads
        As the models take them.
    part_size : int
        Number of values of a part.
    together : str
        A parameter whose values together decide how each is computed: a call with several of them is not cut.
    """
    threads = checked_threads(threads)
    try:
        shape = np.broadcast_shapes(
            *(np.shape(value)[: -1 if name in _VECTORS else None] for name, value in given.items())
        )
    except ValueError:
        return evaluate(given, None)  # it says what is wrong
    result = array_for_result(out, shape, asked_for(*(given[name] for name in _DIRECTIONS if name in given)), given)
    given = {name: np.asarray(value) if isinstance(value, list | tuple) else value for name, value in given.items()}
    axis = next((axis for axis, length in enumerate(shape) if length > 1), None)
    if axis is None or np.size(given.get(together, ())) > 1:
        result[...] = evaluate(given, None)
        return result[()] if out is None else result
    back = len(shape) - axis
    step = STEP if math.prod(shape[axis + 1 :]) < STEP else 2

    def evaluate_part(part: slice) -> None:
        target = result[(*[slice(None)] * axis, part)]
        arguments = {name: _part(value, back + (name in _VECTORS), part) for name, value in given.items()}
        values = evaluate(arguments, target)
        if not np.may_share_memory(values, target):
            target[...] = values

    on_threads(evaluate_part, cut(shape[axis], result.size, step, threads, part_size), threads)
    return result


def _part(value: Any, back: int, part: slice) -> Any:
    """Return a part of an argument along its axis `back`, counted from the end; all of it if it has no such axis."""
    if np.ndim(value) < back or np.shape(value)[-back] == 1:
        return value
    index: tuple[Any, ...] = (..., part, *[slice(None)] * (back - 1))
    return np.asarray(value)[index]


def checked_threads(threads: int) -> int:
    """Return a number of threads; ParameterError if it is not a whole number of at least 1."""
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or threads < 1:
        raise ParameterError("threads", f"{threads!r} is not a whole number of at least 1", threads)
    return int(threads)


def array_for_result(
    out: Floats | None, shape: tuple[int, ...], dtype: np.dtype[Any], arguments: dict[str, Any]
) -> NDArray[Any]:
    """Return `out`, or a new array without one; ParameterError if it does not fit or shares memory with arguments."""
    if out is None:
        return np.empty(shape, dtype)
    allowed = f"allowed is a writable, C-contiguous array of {dtype} and shape {shape}, as the result"
    if not isinstance(out, np.ndarray) or isinstance(out, np.ma.MaskedArray):
        raise ParameterError("out", f"it is of type {type(out).__name__}; {allowed}", out)
    if out.dtype != dtype or out.shape != shape:
        raise ParameterError("out", f"{out.dtype} of shape {out.shape}; {allowed}", out.shape)
    if not out.flags.carray:
        state = "read-only" if not out.flags.writeable else "not C-contiguous and aligned"
        raise ParameterError("out", f"the array is {state}; {allowed}", out.shape)
    for name, value in arguments.items():
        if isinstance(value, np.ndarray) and np.may_share_memory(value, out):
            raise ParameterError("out", f"it shares memory with {name}; {allowed} with memory of its own", out.shape)
    return out


def cut(length: int, values: int, step: int, threads: int, part_size: int = PART) -> list[slice]:
    """Return the parts of an axis: as many for each thread, of about `part_size` values, at multiples of `step`."""
    wanted = -(-values // (part_size * threads)) * threads
    units = max(1, length // step)
    parts = max(1, min(wanted, units))
    edges = [units * part // parts * step for part in range(parts)]
    return [slice(*edge) for edge in itertools.pairwise([*edges, length])]


def on_threads(work: Callable[[slice], None], parts: Sequence[slice], threads: int) -> None:
    """Do the work of all parts. An exception of one reaches the caller, and parts that have not begun are left out."""
    if min(threads, len(parts)) == 1:
        for part in parts:
            work(part)
        return
    with ThreadPoolExecutor(min(threads, len(parts))) as pool:
        for _ in pool.map(work, parts):
            pass


def filled(write: Callable[[slice, NDArray[Any]], None], result: NDArray[Any], channels: int, threads: int) -> Floats:
    """Return `result`, C-contiguous with `channels` values a point, after ``write(points, values)`` has filled it."""
    threads = checked_threads(threads)
    values = result.reshape(-1)
    points = values.size // max(channels, 1)
    if threads == 1:
        write(slice(0, points), values)
        return result

    def write_part(part: slice) -> None:
        write(part, values[part.start * channels : part.stop * channels])

    on_threads(write_part, cut(points, values.size, STEP, threads), threads)
    return result
