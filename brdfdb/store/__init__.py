"""The store of tables on disk; `open` opens one, an edition, or a store behind a service."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from brdfdb.errors import NoEditionError, NoServiceError, ParameterError, StoreError
from brdfdb.place import is_service, tables_place
from brdfdb.store.paths import is_edition
from brdfdb.store.table_cache import CACHE_BYTES

if TYPE_CHECKING:
    from brdfdb.store.edition.reader import Edition
    from brdfdb.store.http_client import RemoteStore
    from brdfdb.store.reader import Store


def default_root() -> str:
    """Return the default store: ``$BRDFDB_STORE``, or else ``brdf-store`` in this directory."""
    return os.environ.get("BRDFDB_STORE", "brdf-store")


def open(
    root: str | os.PathLike[str] | None = None,
    *,
    snapshot: str | None = None,
    storage_options: Mapping[str, Any] | None = None,
) -> Store | Edition | RemoteStore:
    """Open a store of tables, an edition or a service for reading.

    Parameters
    ----------
    root : path or address, optional
        The directory that ``brdfdb build --store`` wrote, also as ``file:///data/store``; the place of an edition that
        ``brdfdb publish`` wrote: a directory, ``https://...``, ``s3://bucket/prefix``, ``gs://...`` or ``az://...``; or
        the address of a service (``brdfdb serve``), such as ``http://127.0.0.1:8000``. By default that of the
        environment variable ``BRDFDB_STORE``, or ``brdf-store``.
    snapshot : str, optional
        Name of a snapshot of a directory (``brdfdb snapshot NAME``): the store is then what it names, for good.
    storage_options : mapping, optional
        Options of obstore for a bucket, such as ``{"endpoint": "http://127.0.0.1:9000", "region": "eu-1"}``.

    Returns
    -------
    Store, Edition or RemoteStore
        A mapping from material names to tables: ``brdfdb.open(root)["rolled-brass"].lookup(...)``.

    Raises
    ------
    brdfdb.errors.StoreError
        If there is no store at `root`, or one of another format version; if it has no such snapshot; if no server
        answers there.
    ParameterError
        If `root` is neither a path nor such an address, as ``ftp://host/store``; if `storage_options` are given for
        another place than a bucket.
    ValueError
        If a snapshot is given with an address: a service serves the snapshot that it was started with, and an edition
        is one itself.
    """
    parameter = "root" if root is not None else "BRDFDB_STORE"
    root = default_root() if root is None else root
    try:
        return open_tables(root, snapshot=snapshot, storage_options=storage_options, parameter=parameter)
    except NoEditionError:
        if not is_service(root):
            raise
        from brdfdb.store.http_client import RemoteStore

        try:
            return RemoteStore(root)
        except NoServiceError:
            raise StoreError(f"{root} has neither an edition nor a brdfdb service") from None


def open_tables(
    place: str | os.PathLike[str],
    cache_bytes: int = CACHE_BYTES,
    *,
    snapshot: str | None = None,
    storage_options: Mapping[str, Any] | None = None,
    parameter: str = "store",
) -> Store | Edition:
    """Open a store or an edition, whose tables are decoded here, with arguments and errors of `open`.

    `cache_bytes` is the largest size of the decoded tables in memory; errors call the place `parameter`. An address
    where a service answers raises NoEditionError.
    """
    at = tables_place(place, parameter)
    if isinstance(at, str) or is_edition(at):
        from brdfdb.store.edition.reader import Edition

        if snapshot is not None:
            which = "of a service is chosen there, by `brdfdb serve --snapshot`, that of an edition by `brdfdb publish`"
            raise ParameterError("snapshot", f"{snapshot!r} {which}", snapshot)
        return Edition(at, cache_bytes, storage_options=storage_options)
    if storage_options:
        raise ParameterError("storage_options", f"{str(at)!r} takes none; they are for s3://, gs:// and az://")
    from brdfdb.store.reader import Store

    return Store(at, cache_bytes, snapshot=snapshot)
