"""brdfdb: spectral BRDF tables from published surface parameters.

Importing this package is cheap: the models, the store and the exports load when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, overload

from brdfdb.errors import ParameterError

if TYPE_CHECKING:
    import os

    from brdfdb.materials import presets
    from brdfdb.store.http_client import RemoteStore
    from brdfdb.store.reader import Store

    __version__: str

__all__ = ["__version__", "open", "presets"]


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
    brdfdb.errors.StoreError
        If there is no store at `root`, or one of another format version; if it has no such snapshot; if no service
        answers there.
    ValueError
        If a snapshot is named beside an address: a service serves the one that it was started with.
    """
    if isinstance(root, str) and root.startswith(("http://", "https://")):
        from brdfdb.store.http_client import RemoteStore

        if snapshot is not None:
            raise ParameterError(
                "snapshot", f"{snapshot!r} of a service is chosen there, by `brdfdb serve --snapshot`", snapshot
            )
        return RemoteStore(root)
    from brdfdb.store.reader import Store

    return Store(root, snapshot=snapshot)


# Rooms that are imported when they are first used; their modules are imported by name
_ROOMS = (
    *("atlas", "audit", "formats", "forms", "fresnel", "gallery", "geometry", "integrals", "materials", "misprints"),
    *("models", "roughness", "scenes", "spectra", "store", "tables"),
)


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return importlib.import_module(f"brdfdb.{name}")
    if name == "presets":
        return importlib.import_module("brdfdb.materials").presets
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("brdfdb")
    raise AttributeError(f"module 'brdfdb' has no attribute {name!r}")
