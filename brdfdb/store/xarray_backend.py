"""Backend of xarray: ``xarray.open_dataset(path, engine="brdfdb")`` for a revision, a material or a service."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import BackendEntrypoint

from brdfdb.errors import ParameterError, StoreError
from brdfdb.place import is_bucket, is_service, path_of
from brdfdb.store import open as open_store
from brdfdb.store.http_client import RemoteStore
from brdfdb.store.paths import METADATA, is_edition, marker_path, number_of, store_of
from brdfdb.store.reader import Store
from brdfdb.tables.xarray_view import opened


class BrdfdbBackend(BackendEntrypoint):
    """Read tables of brdfdb lazily, with ``brdf`` [1/sr] over all axes."""

    description = "Tables of brdfdb: f_r over all axes, computed when it is read"
    open_dataset_parameters = (
        *("filename_or_obj", "drop_variables", "material", "revision", "snapshot", "storage_options"),
    )

    def open_dataset(  # type: ignore[override]
        self,
        filename_or_obj: str | os.PathLike[str],
        *,
        drop_variables: str | Iterable[str] | None = None,
        material: str | None = None,
        revision: str | None = None,
        snapshot: str | None = None,
        storage_options: Mapping[str, Any] | None = None,
    ) -> xr.Dataset:
        """Open a table as a lazy Dataset, as `Store.dataset` gives it.

        Parameters
        ----------
        filename_or_obj : path or address
            A store (``brdf-store``), an edition (a directory, ``https://``, ``s3://`` or ``gs://``) or a service
            (``http://127.0.0.1:8000``), with the keyword `material`; or a material (``brdf-store/materials/NAME``); or
            a revision (``brdf-store/materials/NAME/r000001``, of a service
            ``http://127.0.0.1:8000/v1/store/materials/NAME/r000001``), be it a copy outside of a store.
        drop_variables : str or iterable of str, optional
            Variables to leave out, such as ``parts``.
        material : str, optional
            Name of a material of the store.
        revision : str, optional
            Its revision; by default the current one.
        snapshot : str, optional
            Name of a snapshot of the store, whose revision of the material is opened.
        storage_options : mapping, optional
            Options of obstore for an edition in a bucket, as of `brdfdb.open`.

        Raises
        ------
        ParameterError
            If a store or a service is named without a material.
        StoreError, UnknownMaterialError, UnknownRevisionError
            If there is no such table, or it is damaged.
        """
        place = filename_or_obj
        if material is not None:
            dataset = open_store(place, snapshot=snapshot, storage_options=storage_options).dataset(material, revision)
        elif is_bucket(place):
            raise ParameterError("material", f"{place} is an edition; name one of its materials")
        elif is_service(place):
            service, _, named = place.rstrip("/").partition("/v1/store/materials/")
            material, _, revision = named.partition("/")
            if not number_of(revision.partition("-")[0]):
                raise ParameterError("material", f"{place} is not the address of a revision; name one of its materials")
            dataset = RemoteStore(service).dataset(material, revision)
        else:
            dataset = _local(path_of(place, "filename_or_obj").absolute(), revision, snapshot)
        dropped = [drop_variables] if isinstance(drop_variables, str) else list(drop_variables or ())
        return dataset.drop_vars(dropped, errors="ignore")

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        """Return True for the directory of a store or an edition; revisions are zarr groups, which others read, too."""
        with contextlib.suppress(ParameterError):
            if isinstance(filename_or_obj, str | os.PathLike):
                path = path_of(filename_or_obj)
                return marker_path(path).is_file() or is_edition(path)
        return False


def _local(path: Path, revision: str | None, snapshot: str | None) -> xr.Dataset:
    """Open the directory of a material or of a revision."""
    if marker_path(path).is_file() or is_edition(path):
        names = ", ".join(list(open_store(path))[:5]) or "none"
        kind = "an edition" if is_edition(path) else "a store"
        raise ParameterError("material", f"{path} is {kind}; name one of its materials, such as {names}")
    if (root := store_of(path / "r000001")) is not None:
        return Store(root, snapshot=snapshot).dataset(path.name, revision)
    if (root := store_of(path)) is not None:
        if revision not in (None, path.name):
            raise ParameterError("revision", f"{revision!r} is not the revision of {path}", revision, path.name)
        return Store(root, snapshot=snapshot).dataset(path.parent.name, path.name)
    if not (path / METADATA).is_file():
        raise StoreError(f"no table at {path}: name a revision, a material of a store, or a store with `material`")
    try:
        return opened(path)
    except (ValueError, FileNotFoundError) as error:
        raise StoreError(f"{path} is not a table: {error}") from error
