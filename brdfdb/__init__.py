"""brdfdb: spectral BRDF tables from published surface parameters.

Importing this package is cheap: the models, the store and the exports load when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:
    import os

    from brdfdb.remote import RemoteStore
    from brdfdb.store import Store

__all__ = ["open"]


@overload
def open(root: os.PathLike[str]) -> Store: ...
@overload
def open(root: str) -> Store | RemoteStore: ...
def open(root: str | os.PathLike[str]) -> Store | RemoteStore:
    """Open a store of tables for reading.

    Parameters
    ----------
    root : path or address
        The directory that ``brdfdb build --store`` wrote, or the address of a service (``brdfdb serve``), such as
        ``http://127.0.0.1:8000``.

    Returns
    -------
    Store or RemoteStore
        A mapping from material names to tables: ``brdfdb.open(root)["rolled-brass"].lookup(...)``.

    Raises
    ------
    brdfdb.store.StoreError
        If there is no store at `root`, or one of another format version; if no service answers there.
    """
    if isinstance(root, str) and root.startswith(("http://", "https://")):
        from brdfdb.remote import RemoteStore

        return RemoteStore(root)
    from brdfdb.store import Store

    return Store(root)


_LOADED_WHEN_USED = (
    *("atlas", "audit", "chart", "energy", "exr", "family", "fresnel", "gallery", "geometry", "grids", "lookup"),
    *(
        "materials",
        "misprints",
        "models",
        "quadrature",
        "remote",
        "representations",
        "roughness",
        "sampling",
        "spectra",
    ),
    *("store", "tabulate"),
)


def __getattr__(name: str) -> Any:
    if name in _LOADED_WHEN_USED:
        return importlib.import_module(f"brdfdb.{name}")
    raise AttributeError(f"module 'brdfdb' has no attribute {name!r}")
