"""A revision of an edition as zarr reads it."""

from __future__ import annotations

import asyncio

from zarr.abc.store import ByteRequest
from zarr.core.buffer import Buffer, BufferPrototype, default_buffer_prototype
from zarr.storage import MemoryStore

from brdfdb.store.edition.records import Member


class PublishedRevision(MemoryStore):
    """A revision of an edition as zarr reads it: each file is fetched, and checked, when it is needed."""

    def __init__(self, member: Member) -> None:
        empty = default_buffer_prototype().buffer.from_bytes(b"")
        super().__init__(dict.fromkeys(member.manifest["files"], empty), read_only=True)
        self._member = member
        self._fetched: set[str] = set()

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return a file, as `MemoryStore.get` does; StoreError if it is missing or changed."""
        if key in self._store_dict and key not in self._fetched:
            content = await asyncio.to_thread(self._member.read, key)
            self._store_dict[key] = default_buffer_prototype().buffer.from_bytes(content)
            self._fetched.add(key)
        return await super().get(key, prototype, byte_range)
