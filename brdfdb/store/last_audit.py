"""The report of the last audit as services show it: of each material the verdict, two answers, and sentences."""

from __future__ import annotations

import contextlib
import json
import os
import threading
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError


class ShownAnswer(BaseModel):
    """The answer of an audit to one of its two questions."""

    word: str = Field(description="verdict behind the answer")
    text: str = Field(description="the answer in a few words")
    reason: str = Field(description="the answer in a sentence, with its angle and its wavelength")


class ShownSentence(BaseModel):
    """One sentence of an audit, with the title of its subject."""

    finding: str
    title: str
    word: str
    text: str
    quote: str = Field(default="", description="words of a paper; empty: none")
    where: str = Field(default="", description="place of the quote")


class AuditSummary(BaseModel):
    """The verdict of an audit, its answers to two questions, and its findings in sentences."""

    revision: str = Field(description="that was audited")
    model: str
    verdict: str
    sentences: list[ShownSentence]
    as_published: ShownAnswer = Field(description="of the table: is it what the paper says?")
    conserves_energy: ShownAnswer = Field(description="of the model: does the published model conserve energy?")


class Audited(AuditSummary):
    """Findings of an audit on a material, as far as lists and pages show them; other fields are kept."""

    model_config = ConfigDict(extra="allow")

    material: str
    manifest_sha256: str = Field(default="", description="of the revision; empty in reports of older programs")

    def is_of(self, revision: str, digest: str) -> bool:
        """Return True if the audit is about the table with the number of a revision, and the digest of its manifest."""
        return self.revision == revision and self.manifest_sha256 in ("", digest)


class Verdict(NamedTuple):
    """The audit of a material: the findings, their date, and whether they are about the current revision."""

    finding: Audited
    when: str
    current: bool


class Report(NamedTuple):
    """A report: its date, and what it says of each material."""

    when: str
    by_name: dict[str, Audited]


class AuditFile:
    """The file of a report, read anew when it changes. Threads may share it.

    Parameters
    ----------
    path : Path
        What ``brdfdb audit`` wrote as JSON; it may be missing.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._known: tuple[tuple[int, int], Report] | None = None

    def read(self) -> Report:
        """Return the report. A file that is none says nothing; entries that lack what is shown are left out."""
        try:
            at = os.stat(self._path)
        except OSError:
            return Report("", {})
        seen = at.st_mtime_ns, at.st_size
        with self._lock:
            if self._known is None or self._known[0] != seen:
                self._known = seen, self._read()
            return self._known[1]

    def _read(self) -> Report:
        try:
            document = json.loads(self._path.read_bytes())
            when, entries, by_name = str(document["when"]), list(document["materials"]), {}
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return Report("", {})
        for entry in entries:
            with contextlib.suppress(ValidationError):
                audited = Audited.model_validate(entry)
                by_name[audited.material] = audited
        return Report(when, by_name)
