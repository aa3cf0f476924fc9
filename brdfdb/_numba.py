"""The only file that calls numba: how kernels are compiled.

A kernel calls kernels of its own file, and of the files in `SHARED`. numba keeps compiled code under the digest of the
file that holds the kernel, to which `_stamp` adds those of the shared ones: a kernel that calls into any other file
would go on running the old code when that file changes.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import config

F = TypeVar("F", bound=Callable[..., Any])

SHARED = ("_elementary.py", "fresnel.py", "tables/_interpolation.py", "models/_diffraction_series.py")


def kernel(function: F) -> F:
    """Compile a function of scalars, or a loop over arrays, when it is first called.

    nogil: the batch layer runs kernels on threads. error_model="numpy": the Python model checks every division,
    which costs a factor of 5 to 7 on Ward's model, and the limits want inf from 1/0. Of fastmath only "contract", fused
    multiply-add: it rounds less, and nan and inf keep their meaning. cache: 0.2 s instead of seconds next time.
    forceinline: a loop vectorises only if all that it calls is part of it.
    """
    return _compiled(function, forceinline=True)


def loop(function: F) -> F:
    """As `kernel`, for a loop over arrays that several kernels call: compiled once, not once inside of each."""
    return _compiled(function, forceinline=False)


def _compiled(function: F, *, forceinline: bool) -> F:
    compiled: Any = numba.njit(
        cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=forceinline
    )(function)
    if not config.DISABLE_JIT:  # type: ignore[attr-defined]  # numba makes its settings at run time
        _stamp(compiled._cache)
    return cast(F, compiled)


@functools.cache
def _shared_digest() -> bytes:
    return hashlib.sha256(b"".join((Path(__file__).parent / name).read_bytes() for name in SHARED)).digest()


def _stamp(cache: Any) -> None:
    """Let compiled code in numba's cache count as old when a file of `SHARED` has changed, too.

    A cache that cannot be written, on a disk that is full, costs time and not the result.
    """
    file = cache._cache_file
    file._source_stamp += _shared_digest()
    save = cache.save_overload

    def try_to_save(*arguments: Any) -> None:
        with contextlib.suppress(OSError):
            save(*arguments)

    cache.save_overload = try_to_save


def elementwise(function: F) -> Callable[..., Any]:
    """Wrap a scalar kernel as a NumPy ufunc: it broadcasts without copying, so work on axes stays on axes.

    Compiled when it is first called, under a lock: numba's own lazy ufuncs warn when two threads come first together.
    Floating-point flags are ignored: the branch not taken of a vectorised select raises them too. What is finite is
    tested, not flagged.
    """
    lock = threading.Lock()
    compiled: list[Callable[..., Any]] = []

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        if not compiled:
            with lock:
                if not compiled:
                    compiled.append(_ufunc(function, len(arguments)))
        with np.errstate(all="ignore"):
            return compiled[0](*arguments)

    return call


def _ufunc(function: Callable[..., Any], arity: int) -> Callable[..., Any]:
    if config.DISABLE_JIT:  # type: ignore[attr-defined]  # numba makes its settings at run time
        return np.vectorize(function, otypes=[np.float64])  # numba would compile, and fail on kernels that are Python
    ufunc = numba.vectorize(cache=True)(function)  # type: ignore[no-untyped-call]  # numba leaves it untyped
    _stamp(ufunc._dispatcher.cache)
    ufunc.add(numba.float64(*[numba.float64] * arity))
    ufunc.disable_compile()
    return cast(Callable[..., Any], ufunc)
