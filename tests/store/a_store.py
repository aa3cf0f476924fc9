"""Stores of one white material: its tables, the albedo that tells which one is current, and files of a directory."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr

import brdfdb
from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.store.reader import Store
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.tabulation import tabulate

GRID = Grid({"theta_i": [0, 30, 60, 80], "theta_r": [0, 40, 80], "delta_phi": [0, 90, 180]})


def layout(rho: float) -> Layout:
    table = {"title": "White", "model": "lambert", "source": "no paper", "parameters": {"rho": rho}}
    return Layout(Material.from_table("white", table), GRID)


def lambert(rho: float) -> xr.Dataset:
    """Return a table whose values tell which one it is."""
    return tabulate(layout(rho))


def requested(rho: float) -> xr.Dataset:
    """Return the same table, with a request of its albedo alone."""
    dataset = lambert(rho)
    del dataset.attrs["source_record"]
    return dataset.assign_attrs(request={"rho": rho}, request_sha256=digest({"rho": rho}))


def publish(root: Path, **tables: xr.Dataset) -> list[str]:
    """Publish one revision a table; return the revisions."""
    return [publish_dataset(root, name, dataset).revision for name, dataset in tables.items()]


def rho(store: Path | Store, name: str = "white") -> float:
    """Return the albedo that tells which table is current."""
    opened = brdfdb.open(store) if isinstance(store, Path) else store
    return float(np.round(opened[name].brdf[0, 0, 0] * np.pi, 6))


def pointer(root: Path, name: str = "white") -> Path:
    return root / "materials" / name / "HEAD.json"


def chunk(root: Path, revision: str = "r000001", name: str = "white") -> Path:
    """Return the path of the first chunk of f_r."""
    return root / "materials" / name / revision / "brdf" / "c" / "0" / "0" / "0"


def flip(path: Path) -> None:
    """Flip a bit in the middle of a file."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0x10
    path.write_bytes(data)


def in_threads(count: int, work: Callable[[], object]) -> Callable[[], list[BaseException]]:
    """Start a function in several threads; the result waits for them and returns their errors."""
    errors: list[BaseException] = []

    def guarded() -> None:
        try:
            work()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=guarded) for _ in range(count)]
    for thread in threads:
        thread.start()

    def joined() -> list[BaseException]:
        for thread in threads:
            thread.join()
        return errors

    return joined


def contents(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def staged(root: Path) -> list[str]:
    return sorted(str(path.relative_to(root / ".staging")) for path in (root / ".staging").rglob("*"))
