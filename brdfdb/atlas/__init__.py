"""Where methods fail: forms of the models, ours and others, against high-precision values."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from brdfdb.figure import Figure

ATLAS: Mapping[str, Callable[[], Figure]] = {}
