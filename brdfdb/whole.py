"""A revision as zarr reads it: chunks that went missing are errors, not nan."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from zarr.core.buffer import Buffer
from zarr.storage import LocalStore

from brdfdb.manifest import StoreError, manifest_of


class Whole(LocalStore):
    """A revision as zarr reads it, but that a file of it that goes missing is an error and not nan.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    files : mapping
        By the path of each file that belongs there.
    """

    def __init__(self, group: Path, files: Mapping[str, Any]) -> None:
        super().__init__(group, read_only=True)
        self._files = frozenset(files)

    async def get(self, key: str, *arguments: Any, **keywords: Any) -> Buffer | None:
        """As `LocalStore.get`; StoreError for a file that should be there."""
        value = await super().get(key, *arguments, **keywords)
        if value is None and key in self._files:
            where = f"{self.root.parent.name} {self.root.name}"
            if not manifest_of(self.root).is_file():
                raise StoreError(f"{where} was removed while it was read; open the material anew")
            raise StoreError(f"{where} is damaged: {key} is missing")
        return value
