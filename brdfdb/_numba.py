"""Compilation of kernels. This is the only file that calls numba.

A kernel calls kernels of its own file and of the files in `SHARED`. numba stores compiled code under the digest of the
file that holds the kernel, and `_stamp` adds the digests of the shared files. A kernel that called into any other file
would continue to run old code after a change of that file.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from brdfdb.errors import ParameterError

F = TypeVar("F", bound=Callable[..., Any])

# Kernels stay functions of Python, and numba is not imported. numba reads the same variable
INTERPRETED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
SHARED = (
    "_numba.py",  # its options decide what is compiled
    "_elementary.py",
    "tables/_simd.py",
    "fresnel.py",
    "tables/_interpolation.py",
    "tables/_coordinates.py",
    "models/_diffraction_series.py",
    "models/_gaussian_slopes.py",
)


def kernel(function: F) -> F:
    """Compile a function of scalars, or a part of a loop, into the kernels that call it. Python runs it as Python.

    nogil: the batch layer runs kernels on threads. error_model="numpy": the Python model checks every division,
    which costs a factor of 5 to 7 on Ward's model, and limits need inf from 1/0. fastmath has only "contract", fused
    multiply-add, which rounds less; nan and inf keep their meaning. cache: the next process starts in 0.04 s instead of
    seconds. forceinline: a loop vectorises only if all functions that it calls are inlined.
    """
    return _part(function, forceinline=True)


def inner_loop(function: F) -> F:
    """Compile a loop over arrays that kernels call, without inlining it. Python runs it as Python."""
    return _part(function, forceinline=False)


def loop(function: F) -> F:
    """Compile a loop over arrays that Python calls, and kernels where they need it.

    Python calls a function through a wrapper, for which LLVM compiles another copy.
    """
    return _compiled(function, forceinline=False)


def _part(function: F, *, forceinline: bool) -> F:
    """Show numba the compiled function in place of the function: without a wrapper, Python could not call it."""
    if INTERPRETED:
        return function
    import numba

    typeof: Any = numba.typeof  # numba leaves it untyped
    part: Any = function
    part.dispatcher = _compiled(function, forceinline=forceinline, no_cpython_wrapper=True)
    part._numba_type_ = typeof(part.dispatcher)  # it does not keep the dispatcher alive
    return function


def _compiled(function: F, **more: bool) -> F:
    if INTERPRETED:
        return function
    import numba

    options: Any = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, **more}
    options["no_cfunc_wrapper"] = True  # nothing calls a kernel by address, and its code would be compiled once more
    try:
        compiled: Any = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # neither beside the sources nor at home can anything be written: nothing is stored
        return cast(F, numba.njit(**options)(function))
    _stamp(compiled._cache)
    _load_alone(compiled._cache)
    return cast(F, compiled)


def instructions(write: Callable[..., Any]) -> Callable[[F], F]:
    """Compile a function of arrays and scalars as ``write(ir, builder, *arguments)`` writes it in LLVM's language.

    An array arrives as the pointer to its first number. The function takes uint64 and float64, and returns a float64 or
    nothing, as its annotation says.
    """

    def decorated(function: F) -> F:
        if INTERPRETED:
            return function
        import numba
        from numba.core.cgutils import ir  # type: ignore[attr-defined]  # it is llvmlite's
        from numba.extending import intrinsic

        def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            arguments = [
                context.make_array(kind)(context, builder, value).data if isinstance(kind, numba.types.Array) else value
                for kind, value in zip(signature.args, given, strict=True)
            ]
            result = write(ir, builder, *arguments)
            return context.get_dummy_value() if result is None else result

        def typed(_: Any, *arguments: Any) -> Any:
            return returned(*arguments), code

        own = inspect.signature(function)
        returned = numba.void if own.return_annotation == "None" else numba.float64
        context = inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        typed.__signature__ = own.replace(parameters=[context, *own.parameters.values()])  # type: ignore[attr-defined]
        return cast(F, intrinsic(typed))

    return decorated


@functools.cache
def _shared_digest() -> bytes:
    return hashlib.sha256(b"".join((Path(__file__).parent / name).read_bytes() for name in SHARED)).digest()


def _stamp(cache: Any) -> None:
    """Make numba's cache depend on the files of `SHARED`, too.

    If the cache cannot be written, for example on a full disk, compilation is repeated and results stay the same.
    """
    file = cache._cache_file
    file._source_stamp += _shared_digest()
    save = cache.save_overload

    def try_to_save(*arguments: Any) -> None:
        with contextlib.suppress(OSError):
            save(*arguments)

    cache.save_overload = try_to_save


def _load_alone(cache: Any) -> None:
    """Load stored code without numba's 200 modules of Python functions that it can compile: 0.3 s a process.

    Stored code needs the runtime, and the loop of a ufunc around it constants. numba loads the modules itself before
    it compiles anything else.
    """
    from numba.core.imputils import builtin_registry
    from numba.core.runtime.nrt import rtsys
    from numba.cpython import numbers  # noqa: F401, adds constants to the registry

    def load_overload(signature: Any, context: Any) -> Any:
        rtsys.initialize(context)
        context.install_registry(builtin_registry)
        try:
            return cache._load_overload(signature, context)
        except ImportError:  # stored by a process that knew the file as another module: it is compiled again
            return None

    cache.load_overload = load_overload


def is_cached(kernel: Any) -> bool:
    """Return True if compiled code of a kernel is stored, or cannot be, or kernels are not compiled at all."""
    if INTERPRETED or not hasattr(kernel._cache, "_cache_file"):
        return True
    return bool(kernel._cache._cache_file._load_index())


@contextlib.contextmanager
def when_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call a function when the first kernel is compiled in this context; never if all are stored."""
    if INTERPRETED:
        yield
        return
    from numba.core import event

    events: Any = event  # numba leaves it untyped

    class First(event.Listener):
        announced = False

        def on_start(self, _: Any) -> None:
            if not self.announced:  # numba's lock is held
                self.announced = True
                tell()

        def on_end(self, _: Any) -> None:
            pass

    listener = First()
    events.register("numba:compile", listener)
    try:
        yield
    finally:
        events.unregister("numba:compile", listener)


def elementwise(function: F) -> Callable[..., Any]:
    """Wrap a scalar kernel as a NumPy ufunc, which broadcasts without copying: work on one axis is done once.

    It is compiled at the first call, under a lock, because numba's own lazy ufuncs warn if two threads call first.
    Floating-point flags are ignored, because a vectorised select raises them in the branch not taken, too. Tests
    check that values are finite.
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
    if INTERPRETED:
        return np.vectorize(function, otypes=[np.float64])  # numba would compile, and fail on kernels that are Python
    import numba

    vectorize: Any = numba.vectorize  # numba leaves it untyped
    try:
        ufunc = vectorize(cache=True)(function)
        _stamp(ufunc._dispatcher.cache)
        _load_alone(ufunc._dispatcher.cache)
    except RuntimeError:  # as in `_compiled`
        ufunc = vectorize()(function)
    try:
        ufunc.add(numba.float64(*[numba.float64] * arity))
    except numba.core.errors.NumbaError as error:  # its first line is the stage of the compilation
        lines = str(error).strip().splitlines()
        sentence = f"the formula cannot be compiled: {lines[min(1, len(lines) - 1)]}"
        raise ParameterError(function.__name__, sentence) from None
    ufunc.disable_compile()
    return cast(Callable[..., Any], ufunc)
