"""The store of tables on disk; `open` opens one, or a store behind a service."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, overload

from brdfdb.errors import ParameterError
from brdfdb.place import is_service, path_of

if TYPE_CHECKING:
    from brdfdb.store.http_client import RemoteStore
    from brdfdb.store.reader import Store


def default_root() -> str:
    """Return the default store: ``$BRDFDB_STORE``, or else ``brdf-store`` in this directory."""
    return os.environ.get("BRDFDB_STORE", "brdf-store")


@overload
def open(root: os.PathLike[str], *, snapshot: str | None = None) -> Store: ...
@overload
def open(root: str | None = None, *, snapshot: str | None = None) -> Store | RemoteStore: ...
def open(root: str | os.PathLike[str] | None = None, *, snapshot: str | None = None) -> Store | RemoteStore:
    """Open a store of tables for reading.

    Parameters
    ----------
    root : path or address, optional
        The directory that ``brdfdb build --store`` wrote, also as ``file:///data/store``, or the address of a service
        (``brdfdb serve``), such as ``http://127.0.0.1:8000``. By default that of the environment variable
        ``BRDFDB_STORE``, or ``brdf-store``.
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
    ParameterError
        If `root` is neither a path nor such an address, as ``s3://bucket/store``.
    ValueError
        If a snapshot is given with an address: a service serves the snapshot that it was started with.
    """
    parameter = "root" if root is not None else "BRDFDB_STORE"
    root = default_root() if root is None else root
    if is_service(root):
        from brdfdb.store.http_client import RemoteStore

        if snapshot is not None:
            raise ParameterError(
                "snapshot", f"{snapshot!r} of a service is chosen there, by `brdfdb serve --snapshot`", snapshot
            )
        return RemoteStore(root)
    from brdfdb.store.reader import Store

    return Store(path_of(root, parameter), snapshot=snapshot)
