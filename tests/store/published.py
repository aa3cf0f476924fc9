"""Tables that are published, where a pointer lies, and what a served table says of itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from brdfdb.store.publication import publish_dataset
from brdfdb.store.reader import Store


def publish(root: Path, **tables: xr.Dataset) -> list[str]:
    """One revision a table; returns the revisions."""
    return [publish_dataset(root, name, dataset)[0] for name, dataset in tables.items()]


def rho(store: Store, name: str = "white") -> float:
    """Return the albedo that tells which table is current."""
    return float(np.round(store[name].brdf[0, 0, 0] * np.pi, 6))


def pointer(root: Path, name: str = "white") -> Path:
    return root / "materials" / name / "HEAD.json"
