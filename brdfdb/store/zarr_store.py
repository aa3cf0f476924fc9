"""A revision as zarr reads it, here or behind a service: chunks that went missing or changed are errors, not nan."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from zarr.abc.store import ByteRequest
from zarr.core.buffer import Buffer, BufferPrototype
from zarr.storage import FsspecStore, LocalStore

from brdfdb.errors import StoreError
from brdfdb.store.files import FileEntry
from brdfdb.store.records import check_file


class CheckedRevision(LocalStore):
    """A revision as zarr reads it; a file of its manifest that is missing or changed raises StoreError."""

    def __init__(self, group: Path, files: Mapping[str, FileEntry]) -> None:
        super().__init__(group, read_only=True)
        self._files = dict(files)

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return a file, as `LocalStore.get` does; StoreError if it is missing or changed."""
        try:
            value = await super().get(key, prototype, byte_range)
        except OSError as error:
            where = f"{self.root.parent.name} {self.root.name}"
            raise StoreError(f"{where} is damaged: {key} cannot be read: {error.strerror}") from error
        content = None if value is None or key not in self._files else value.to_bytes()
        check_file(self.root, key, content, self._files, complete=byte_range is None)
        return value


class CheckedRemoteRevision(FsspecStore):
    """A revision at an address, called `where` in errors; a missing or changed file raises StoreError."""

    def __init__(self, url: str, where: str, files: Mapping[str, FileEntry]) -> None:
        from fsspec.implementations.http import HTTPFileSystem

        super().__init__(HTTPFileSystem(asynchronous=True), read_only=True, path=url)
        self._where = where
        self._files = dict(files)

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        """Return a file, as `FsspecStore.get` does; StoreError if it is missing or changed."""
        value = await super().get(key, prototype, byte_range)
        entry = self._files.get(key)
        if entry is None:
            return None
        if value is None:
            raise StoreError(
                f"{self._where} was removed or replaced while it was read ({key}); open the material again"
            )
        if byte_range is None and hashlib.sha256(value.to_bytes()).hexdigest() != entry["sha256"]:
            raise StoreError(f"{self._where}: {key} differs from its manifest; a cache in between may hold an old one")
        return value
