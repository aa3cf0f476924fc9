"""Kernels as tests call them: compiled, where Python would run what it calls itself as Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that calls a kernel as other kernels do."""
    call: Callable[..., Any] = numba.njit(lambda *arguments: kernel(*arguments))
    return call
