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
def open(root: os.PathLike[str], *, snapshot: str | None = None) -> Store: ...
@overload
def open(root: str, *, snapshot: str | None = None) -> Store | RemoteStore: ...
def open(root: str | os.PathLike[str], *, snapshot: str | None = None) -> Store | RemoteStore:
    """Open a store of tables for reading.

    Parameters
    ----------
    root : path or address
        The directory that ``brdfdb build --store`` wrote, or the address of a service (``brdfdb serve``), such as
        ``http://127.0.0.1:8000``.
    snapshot : str, optional
        Name of a snapshot of a directory (``brdfdb snapshot NAME``): the store is then what it names, for good.

    Returns
    -------
    Store or RemoteStore
        A mapping from material names to tables: ``brdfdb.open(root)["rolled-brass"].lookup(...)``.

    Raises
    ------
    brdfdb.store.StoreError
        If there is no store at `root`, or one of another format version; if it has no such snapshot; if no service
        answers there.
    ValueError
        If a snapshot is named beside an address: a service serves the one that it was started with.
    """
    if isinstance(root, str) and root.startswith(("http://", "https://")):
        from brdfdb.remote import RemoteStore

        if snapshot is not None:
            raise ValueError(f"snapshot: {snapshot!r} of a service is chosen there, by `brdfdb serve --snapshot`")
        return RemoteStore(root)
    from brdfdb.store import Store

    return Store(root, snapshot=snapshot)


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
