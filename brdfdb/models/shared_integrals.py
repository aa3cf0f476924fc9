"""Integrals that materials of one model share: kept while errors are measured, where directions repeat."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np
from numpy.typing import NDArray

_KEPT_BYTES = 64 << 20  # of 400 materials that differ in their sigma
_Arrays = tuple[NDArray[np.float64], ...]

_sharing: ContextVar[bool] = ContextVar("sharing", default=False)
_kept: OrderedDict[bytes, _Arrays] = OrderedDict()
_lock = threading.Lock()


@contextmanager
def sharing() -> Iterator[None]:
    """Keep the integrals of models in this context. Elsewhere each call integrates, so that timings are those of it."""
    token = _sharing.set(True)
    try:
        yield
    finally:
        _sharing.reset(token)


def shared(features: NDArray[np.float64], others: tuple[Any, ...], integrate: Callable[[], _Arrays]) -> _Arrays:
    """Return what `integrate` returns, which is kept in a context of `sharing`.

    Parameters
    ----------
    features : array
        Numbers that decide the integrals, together with `others`.
    others : tuple
        The name of the integral, and its options.
    integrate : callable
        A function that computes the arrays.
    """
    if not _sharing.get():
        return integrate()
    content = hashlib.sha256(repr((others, features.shape)).encode())
    content.update(np.ascontiguousarray(features).data)
    key = content.digest()
    with _lock:
        if key in _kept:
            _kept.move_to_end(key)
            return _kept[key]
    arrays = integrate()
    for array in arrays:
        array.setflags(write=False)
    with _lock:
        _kept[key] = arrays
        while len(_kept) > 1 and sum(array.nbytes for kept in _kept.values() for array in kept) > _KEPT_BYTES:
            _kept.popitem(last=False)
    return arrays
