"""The figures of the three papers, computed, with what the papers say one sees in them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from brdfdb.figure import Figure

GALLERY: Mapping[str, Callable[[], Figure]] = {}
