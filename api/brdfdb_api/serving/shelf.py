"""The tables that are served: a store that may change or vanish, the summaries for lists, and tables in memory."""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import orjson

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.store.decoding import read_metadata
from brdfdb.store.manifest import check_manifest
from brdfdb.store.reader import Store
from brdfdb_api.serving.colours import swatch
from brdfdb_api.serving.settings import Settings

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

COLOURED_BYTES = 16 * 2**20  # size [byte] of a table above which it is not decoded for its colour in a list

IDLE_S = 1.0  # time after which the idle thread for colours ends [s]
WARMED = 100  # materials whose colours are found when a server starts


class Verdict(NamedTuple):
    """The audit of a material: the findings, their date, and whether they are about the current revision."""

    finding: dict[str, Any]
    when: str
    current: bool


class Shelf:
    """The materials that an application serves.

    Parameters
    ----------
    settings : Settings
        Where the store is.
    store : Store, optional
        An open one. By default it is opened when it is first needed, so that there may be none yet.
    """

    def __init__(self, settings: Settings, store: Store | None = None) -> None:
        self._settings = settings
        self._root = settings.store.absolute()  # resolved now: the working directory may change
        self._store = store
        self._seen: set[str] = set()
        self._summaries: dict[str, tuple[str, dict[str, Any]]] = {}
        self._colours: dict[str, tuple[str, str | None]] = {}
        self._audit: tuple[tuple[int, int], dict[str, Any]] | None = None
        self._lock = threading.Lock()
        self._waiting: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._painter: threading.Thread | None = None
        self._swatches: WeakKeyDictionary[Table, str | None] = WeakKeyDictionary()
        self._closed = False
        self.warming = False  # kernels are being loaded, or compiled for half a minute

    @property
    def store(self) -> Store:
        """Open store; StoreError if there is none."""
        if self._store is None:
            self._store = Store(self._root, self._settings.cache_bytes, snapshot=self._settings.snapshot)
        return self._store

    def held(self, name: str) -> Table | None:
        """Return the current table of a material if it is decoded already, else None: `table` raises the reason."""
        try:
            return self.store.held(name)
        except StoreError:
            return None

    def table(self, name: str, revision: str | None = None) -> Table:
        """Return the table of a material, of its current revision or another.

        Raises
        ------
        UnknownMaterialError, UnknownRevisionError
            If there is none.
        StoreError
            If it cannot be read, or was there and is gone; the sentence names the material.
        """
        try:
            table = self.store[name] if revision is None else self.store.table(name, revision)
        except (UnknownMaterialError, StoreError) as error:
            raise self._named(name, error) from error
        self._seen.add(name)
        return table

    def head(self, name: str) -> str:
        """Return the current revision of a material; errors as of `table`."""
        try:
            return self.store.head(name)
        except (UnknownMaterialError, StoreError) as error:
            raise self._named(name, error) from error

    def _named(self, name: str, error: Exception) -> Exception:
        """Return the error of a material: StoreError with its name if it was served before."""
        if isinstance(error, UnknownMaterialError) and name not in self._seen:
            return error
        if isinstance(error, UnknownMaterialError):
            return StoreError(f"{name} is gone from the store")
        return error if name in str(error) else StoreError(f"{name} cannot be read: {error}")

    def names(self) -> list[str]:
        """Return the sorted names of all materials."""
        names = list(self.store)
        self._seen.update(names)
        return names

    def summary(self, name: str) -> dict[str, Any]:
        """Return the line of a material in lists; for a damaged one its name and a sentence."""
        try:
            group, digest, head = self.store.current(name)
            known = self._summaries.get(name)
            if known is None or known[0] != digest:
                known = self._summaries[name] = digest, _described(name, group, digest, head)
        except (UnknownMaterialError, StoreError) as error:
            return {"name": name, "damaged": str(error), "href": f"/v1/materials/{name}"}
        verdict = self.verdict(name)
        cached, colour = self._colours.get(name, ("", None))
        return {
            **known[1],
            "verdict": verdict.finding["verdict"] if verdict and verdict.current else None,
            **answers_of(verdict.finding if verdict and verdict.current else {}),
            "colour": colour if cached == digest else None,
        }

    def colour(self, names: Iterable[str]) -> None:
        """Have the colours of materials found, one after the other by a thread: they take a decoded table each."""
        for name in names:
            self._waiting.put(name)
        with self._lock:
            if not self._closed and (self._painter is None or not self._painter.is_alive()):
                self._painter = threading.Thread(target=self._paint, daemon=True)
                self._painter.start()

    def _paint(self) -> None:
        while not self._closed:
            try:
                name = self._waiting.get(timeout=IDLE_S)
            except queue.Empty:
                return
            with contextlib.suppress(UnknownMaterialError, StoreError):
                self.paint(name)

    def close(self) -> None:
        """End the thread that finds colours: decoding while the interpreter ends leaves a warning."""
        with self._lock:
            self._closed = True
            painter = self._painter
        if painter is not None:
            self._waiting.put("")  # it may be waiting for a name
            painter.join()

    def paint(self, name: str) -> None:
        """Find the colour of a material for lists, unless it is known or the table is large; errors as of the store."""
        _, digest, head = self.store.current(name)
        if self._colours.get(name, ("",))[0] == digest:
            return
        if (head.get("bytes") or 0) > COLOURED_BYTES:
            self._colours[name] = digest, None
        else:
            table = self.store[name]
            self._colours[name] = table.digest, self.swatch(table)

    def swatch(self, table: Table) -> str | None:
        """Return the colour of a table, cached; None for an unknown model."""
        if table not in self._swatches:
            try:
                self._swatches[table] = swatch(table)
            except ValueError:
                self._swatches[table] = None
        return self._swatches[table]

    def warm(self) -> None:
        """Load the kernels of lookups, then find the colours that the first page of a list shows."""
        self.warming = True
        try:
            with contextlib.suppress(UnknownMaterialError, StoreError):
                names = self.names()
                for name in names[:1]:
                    self.store[name].lookup(0.0, 0.0, 0.0, 0.0)
                self.colour(names[:WARMED])
        finally:
            self.warming = False

    def verdict(self, name: str) -> Verdict | None:
        """Return the last audit of a material; None if there is none, or its report cannot be read."""
        report = self._report()
        finding = report["by_name"].get(name)
        if finding is None:
            return None
        return Verdict(finding, report["when"], finding["revision"] == self.head(name))

    def _report(self) -> dict[str, Any]:
        path = self._settings.audit_file
        try:
            at = os.stat(path)
        except OSError:
            return {"when": "", "by_name": {}}
        seen = at.st_mtime_ns, at.st_size
        with self._lock:
            if self._audit is None or self._audit[0] != seen:
                self._audit = seen, _read(path)
            return self._audit[1]


def _described(name: str, group: Path, digest: str, head: Mapping[str, Any]) -> dict[str, Any]:
    """Return the line of one revision in a list."""
    check_manifest(group, digest, contents=False)
    metadata = read_metadata(group)
    return {
        "name": name,
        "title": metadata.title or "",
        "model": metadata.model,
        "model_title": metadata.model_title or metadata.model or "",
        "paper": metadata.model_reference or "",
        "source": metadata.source or "",
        "measured": metadata.measured is not None,
        "anisotropic": metadata.anisotropic,
        "wavelength_range_nm": metadata.wavelength_range_nm or None,
        "spectrum": spectrum_of(metadata.wavelength_range_nm),
        "incomplete": metadata.gaps or None,
        "error_p99": head.get("error_p99"),
        "formula_error": None if metadata.formula_error is None else metadata.formula_error.in_lists(),
        "largest_albedo": None if metadata.largest_albedo is None else metadata.largest_albedo.model_dump(mode="json"),
        "revision": group.name,
        "created": head.get("created"),
        "bytes": head.get("bytes"),
        "href": f"/v1/materials/{name}",
    }


def spectrum_of(range_nm: Sequence[float]) -> str:
    """Return whether a table has colours: grey, one wavelength or spectral, by its first and last wavelength [nm]."""
    if not range_nm:
        return "grey"
    return "one wavelength" if range_nm[0] == range_nm[-1] else "spectral"


def answers_of(finding: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answers of an audit to its two questions; None of one that the audit of an older program lacks."""
    given = {key: finding.get(key) for key in ("as_published", "conserves_energy")}
    return {
        key: {"word": answer["word"], "text": answer["text"], "reason": answer["reason"]}
        if isinstance(answer, Mapping) and all(isinstance(answer.get(x), str) for x in ("word", "text", "reason"))
        else None
        for key, answer in given.items()
    }


def _read(path: Path) -> dict[str, Any]:
    """Return the findings of a report by material; none for a file that is no report."""
    try:
        report = orjson.loads(path.read_bytes())
        by_name = {entry["material"]: entry for entry in report["materials"] if _complete(entry)}
        return {"when": str(report["when"]), "by_name": by_name}
    except (OSError, ValueError, KeyError, TypeError):
        return {"when": "", "by_name": {}}


def _complete(finding: Any) -> bool:
    """Return True if the audit of a material has what is shown of it; those of older reports do not."""
    try:
        words = [sentence[field] for sentence in finding["sentences"] for field in ("title", "word", "text")]
        shown = (finding["revision"], finding["verdict"], finding["model"], *words)
    except (KeyError, TypeError):
        return False
    return all(isinstance(text, str) for text in shown)
