"""A revision as zarr reads it: chunks that went missing or changed are errors, not nan."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from zarr.abc.store import ByteRequest
from zarr.core.buffer import Buffer, BufferPrototype
from zarr.storage import LocalStore

from brdfdb.errors import StoreError
from brdfdb.store.chunks import check_file
from brdfdb.store.files import Entry


class Whole(LocalStore):
    """A revision as zarr reads it, but that a file of it that is missing or changed is an error with its name.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    files : mapping
        Size and sha256 of each file that belongs there, by its path.
    """

    def __init__(self, group: Path, files: Mapping[str, Entry]) -> None:
        super().__init__(group, read_only=True)
        self._files = dict(files)

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return a file, as `LocalStore.get` does; StoreError for one that should be there, or is another one."""
        try:
            value = await super().get(key, prototype, byte_range)
        except OSError as error:
            where = f"{self.root.parent.name} {self.root.name}"
            raise StoreError(f"{where} is damaged: {key} cannot be read: {error.strerror}") from error
        content = None if value is None or key not in self._files else value.to_bytes()
        check_file(self.root, key, content, self._files, whole=byte_range is None)
        return value
