"""A store that may change or vanish while it is read: its tables, the lines of lists, and the verdicts of its audit."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.store import open_tables
from brdfdb.store.catalogue import AuditFile, Verdict, line_of
from brdfdb.store.edition.records import Member
from brdfdb.store.reader import Store, StoredRevision
from brdfdb.store.table_cache import CACHE_BYTES

if TYPE_CHECKING:
    from brdfdb.store.edition.reader import Edition
    from brdfdb.store.edition.records import Member
    from brdfdb.tables.table import Table


class Shelf:
    """The materials of a store, for a program that runs while the store changes.

    The store or the edition at `root`, or an open one, is opened when it is first needed: there may be none yet.
    `audit_files` are what ``brdfdb audit`` wrote as JSON, such as the reports on all materials and on some; each may be
    missing.
    """

    def __init__(
        self,
        root: Path | str,
        audit_files: Sequence[Path],
        cache_bytes: int = CACHE_BYTES,
        snapshot: str | None = None,
        store: Store | Edition | None = None,
    ) -> None:
        # resolved now: the working directory may change
        self._root = root.absolute() if isinstance(root, Path) else root
        self._cache_bytes = cache_bytes
        self._snapshot = snapshot
        self._store = store
        self._seen: set[str] = set()
        self._lines: dict[str, tuple[str, dict[str, Any]]] = {}  # with the digest of the manifest
        self._checked: dict[str, str] = {}  # digests of manifests
        self._audits = [AuditFile(path) for path in audit_files]
        self.warming = False  # kernels are being loaded, or compiled for half a minute

    @property
    def store(self) -> Store | Edition:
        """The open store or edition; StoreError if it does not exist."""
        if self._store is None:
            self._store = open_tables(self._root, self._cache_bytes, snapshot=self._snapshot)
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

    def revision(self, name: str, revision: str | None = None) -> StoredRevision | Member:
        """Return a revision, for reading its files; errors as of `table`."""
        with self._named(name):
            stored = self.store.revision(name, revision)
            stored.manifest  # noqa: B018  # a damaged one is named now
        self._seen.add(name)
        return stored

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
        """Return the line of a material after a look at its files; for a damaged one its name and a sentence."""
        try:
            stored = self.store.revision(name)
            if self._checked.get(name) != stored.digest:
                stored.manifest  # noqa: B018  # checks the sizes of all files
                self._checked[name] = stored.digest
        except (UnknownMaterialError, StoreError) as error:
            return {"name": name, "damaged": str(error)}
        return self.line(name)

    def line(self, name: str) -> dict[str, Any]:
        """Return the line of a material from its pointer alone, for filters; `summary` notices more damage."""
        try:
            digest = self.store.revision(name).digest
            known = self._lines.get(name)
            if known is None or known[0] != digest:
                line = line_of(name, self.store.summary(name), partial(self.store.metadata, name))
                known = self._lines[name] = digest, line
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
            current = self.store.revision(name)
        verdicts = [Verdict(audited, when, audited.is_of(current.number, current.digest)) for audited, when in audits]
        # leave out a report on another table with the number of the current revision, as of a store that was rebuilt
        verdicts = [verdict for verdict in verdicts if verdict.current or verdict.finding.revision != current.number]
        return max(verdicts, key=lambda verdict: (verdict.current, verdict.when), default=None)
