"""Decoded tables, or what else is read once, that were used last; without NumPy, which lists do not need."""

from __future__ import annotations

import os
import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Generic, Protocol, TypeVar

CACHE_BYTES = 256 * 2**20  # largest size of the decoded tables in memory
_OBJECTS_BYTES = 20_000  # size of a decoded table without its arrays: metadata and arguments of kernels


class _Sized(Protocol):
    @property
    def nbytes(self) -> int: ...


Value = TypeVar("Value", bound=_Sized)


class TableCache(Generic[Value]):
    """The values used last, such as tables by the name of the material and the digest of the revision.

    Threads may share it. `most_bytes` is the largest size of the values in memory; at least one value stays.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._bytes = 0
        self._values: OrderedDict[Hashable, tuple[Value, int]] = OrderedDict()
        self.renew_locks()
        _ALL.add(self)

    def renew_locks(self) -> None:
        """Make new locks: a fork copies locks that threads of the parent hold, and the threads stay behind."""
        self._lock = threading.Lock()
        self._turns: dict[Hashable, threading.Lock] = {}

    def used(self, key: Hashable) -> Value | None:
        """Return a value, and count it as the one used last; None if there is none."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def get(self, key: Hashable, decoded: Callable[[], Value]) -> Value:
        """Return a value, which `decoded` makes if it is not there; a thread that asks for the same value waits."""
        if (value := self.used(key)) is not None:
            return value
        with self._lock:
            turn = self._turns.setdefault(key, threading.Lock())
        with turn:
            try:
                if (value := self.used(key)) is None:
                    value = decoded()
                    self._add(key, value)
                return value
            finally:
                with self._lock:
                    self._turns.pop(key, None)

    def _add(self, key: Hashable, value: Value) -> None:
        with self._lock:
            size = value.nbytes + _OBJECTS_BYTES
            self._bytes += size - self._values.pop(key, (value, 0))[1]
            self._values[key] = value, size
            while self._bytes > self._most_bytes and len(self._values) > 1:
                self._bytes -= self._values.popitem(last=False)[1][1]


_ALL: weakref.WeakSet[TableCache[Any]] = weakref.WeakSet()


def _after_fork() -> None:
    """Give the caches of a child new locks, because a fork copies one thread, and locks of the others stay locked.

    The state behind the locks is valid at any moment. Waiting for the threads before a fork fails: they may need locks
    that the fork has taken already, such as that of thread pools.
    """
    for cache in list(_ALL):
        cache.renew_locks()


if hasattr(os, "register_at_fork"):  # Windows does not fork
    os.register_at_fork(after_in_child=_after_fork)
