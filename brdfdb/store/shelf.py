"""A store that may change or vanish while it is read: its tables, the lines of lists, and the verdicts of its audit."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.store.catalogue import AuditFile, Verdict, line_of
from brdfdb.store.paths import manifest_path
from brdfdb.store.reader import CACHE_BYTES, Location, Store
from brdfdb.store.records import check_manifest

if TYPE_CHECKING:
    from brdfdb.tables.table import Table


class Shelf:
    """The materials of a store, for a program that runs while the store changes.

    The store at `root`, or an open one, is opened when it is first needed: there may be none yet. `audit_files` are
    what ``brdfdb audit`` wrote as JSON, such as the reports on all materials and on some; each may be missing.
    """

    def __init__(
        self,
        root: Path,
        audit_files: Sequence[Path],
        cache_bytes: int = CACHE_BYTES,
        snapshot: str | None = None,
        store: Store | None = None,
    ) -> None:
        self._root = root.absolute()  # resolved now: the working directory may change
        self._cache_bytes = cache_bytes
        self._snapshot = snapshot
        self._store = store
        self._seen: set[str] = set()
        self._summaries: dict[str, tuple[str, dict[str, Any]]] = {}
        self._audits = [AuditFile(path) for path in audit_files]
        self.warming = False  # kernels are being loaded, or compiled for half a minute

    @property
    def store(self) -> Store:
        """The open store; StoreError if it does not exist."""
        if self._store is None:
            self._store = Store(self._root, self._cache_bytes, snapshot=self._snapshot)
        return self._store

    def held(self, name: str) -> Table | None:
        """Return the current table of a material if it is decoded already, else None; `table` raises the reason."""
        try:
            return self.store.held(name)
        except StoreError:
            return None

    def table(self, name: str, revision: str | None = None) -> Table:
        """Return the table of a material, of its current revision or another.

        UnknownMaterialError and UnknownRevisionError say that there is none; StoreError, naming the material, that it
        cannot be read, or was there and is gone.
        """
        with self._named(name):
            table = self.store[name] if revision is None else self.store.table(name, revision)
        self._seen.add(name)
        return table

    def head(self, name: str) -> str:
        """Return the current revision of a material; errors as of `table`."""
        with self._named(name):
            return self.store.head(name)

    def located(self, name: str, revision: str | None = None) -> Location:
        """Return where a revision lies; errors as of `table`."""
        with self._named(name):
            location = self.store.location(name) if revision is None else self.store.located(name, revision)
            if not manifest_path(location.group).is_file():
                raise StoreError(f"{name} {location.group.name} is damaged: its manifest is missing")
        self._seen.add(name)
        return location

    @contextlib.contextmanager
    def _named(self, name: str) -> Iterator[None]:
        """Give errors the name of the material; one that was served before is not unknown, but gone."""
        try:
            yield
        except UnknownMaterialError as error:
            if name not in self._seen:
                raise
            raise StoreError(f"{name} is gone from the store") from error
        except StoreError as error:
            raise error if name in str(error) else StoreError(f"{name} cannot be read: {error}") from error

    def names(self) -> list[str]:
        """Return the sorted names of all materials."""
        names = list(self.store)
        self._seen.update(names)
        return names

    def summary(self, name: str) -> dict[str, Any]:
        """Return the line of a material in lists; for a damaged one its name and a sentence."""
        try:
            current = self.store.current(name)
            group, digest = current.location
            known = self._summaries.get(name)
            if known is None or known[0] != digest:
                check_manifest(group, digest, contents=False)
                known = self._summaries[name] = digest, line_of(name, group, current.head)
        except (UnknownMaterialError, StoreError) as error:
            return {"name": name, "damaged": str(error)}
        verdict = self.verdict(name)
        audited = verdict.finding.model_dump() if verdict and verdict.current else {}
        return {
            **known[1],
            **{key: audited.get(key) for key in ("verdict", "verdict_in_words", "as_published", "conserves_energy")},
        }

    def warm(self) -> None:
        """Load the kernels of lookups."""
        self.warming = True
        try:
            with contextlib.suppress(UnknownMaterialError, StoreError):
                for name in self.names()[:1]:
                    self.store[name].lookup(0.0, 0.0, 0.0, 0.0)
        finally:
            self.warming = False

    def verdict(self, name: str) -> Verdict | None:
        """Return the last audit of a material, preferably of its current revision; None without one."""
        reports = [audit.read() for audit in self._audits]
        audits = [(report.by_name[name], report.when) for report in reports if name in report.by_name]
        if not audits:
            return None
        with self._named(name):
            group, digest = self.store.location(name)
        verdicts = [Verdict(audited, when, audited.is_of(group.name, digest)) for audited, when in audits]
        # leave out a report on another table with the number of the current revision, as of a store that was rebuilt
        verdicts = [verdict for verdict in verdicts if verdict.current or verdict.finding.revision != group.name]
        return max(verdicts, key=lambda verdict: (verdict.current, verdict.when), default=None)
