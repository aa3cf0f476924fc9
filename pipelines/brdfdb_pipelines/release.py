"""The release: wheel and sdist, the default database as an edition, the site, documents that cite it, and checksums.

Everything is made of a clean clone. Stores, logs and the trees of Sphinx stay in its folder ``build/release``, from
which a second run goes on.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import brdfdb
from brdfdb.errors import BrdfdbError, ParameterError, import_extra
from brdfdb.materials import PAPERS, libraries, presets
from brdfdb.store.edition.publishing import publish_edition
from brdfdb.store.files import sha256_of
from brdfdb_pipelines import release_documents as documents
from brdfdb_pipelines import terminal

CHECKSUMS = "SHA256SUMS"
_NEEDED = ("hatchling", "sphinx", "myst_nb", "pyarrow")  # to begin with


class ReleaseError(BrdfdbError):
    """A release that cannot be made."""


def run(out: Path) -> documents.EditionFacts:
    """Make a release in a new directory, and return what it says of its edition.

    Raises
    ------
    ParameterError
        If `out` exists and is not an empty directory, or lies in the clone.
    ReleaseError
        If this program does not run from a clean clone; if a step fails.
    MissingExtraError
        If an extra that a step needs is not installed.
    """
    clone = Path(brdfdb.__file__).parents[1]
    check_clone(clone)
    for module in _NEEDED:
        import_extra(module)
    out = out.absolute()
    if out.is_file() or (out.is_dir() and any(out.iterdir())):
        raise ParameterError("OUT", f"{out} is not an empty directory; name a new one")
    if out.resolve().is_relative_to(clone.resolve()):
        raise ParameterError("OUT", f"{out} lies in the clone, which must stay as it is; name a directory outside")
    work = clone / "build" / "release"
    work.mkdir(parents=True, exist_ok=True)
    part = out.with_name(f".{out.name}.{uuid.uuid4().hex}")  # `out` has everything, or does not exist
    part.mkdir(parents=True)
    try:
        edition = _made(clone, work, part)
        os.replace(part, out)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return edition


def _made(clone: Path, work: Path, part: Path) -> documents.EditionFacts:
    """Make all parts of a release; the site, which runs page by page, beside the tables that it does not show."""
    command = partial(_run, clone, work)
    program = partial(command, "brdfdb_pipelines.cli")
    papers, database = work / "papers", work / "database"
    others = [name for name in libraries() if name != PAPERS]
    with terminal.progress() as bar, contextlib.ExitStack() as stack:
        task = bar.add_task("", total=6 + len(others))

        def begin(text: str) -> None:
            if bar.tasks[0].description:
                bar.advance(task)
            bar.update(task, description=text)
            bar.console.print(text)

        begin("building wheel and sdist")
        command("hatchling", "build", "-d", str(part))
        begin("building the tables of the papers")
        program("build", "--store", str(papers))
        begin("auditing them")
        program("audit", "--store", str(papers))
        pages = part / "pages"  # notebooks that were run are written there, too
        options = ("-W", "-q", "-j", "auto", "-d", str(work / "doctrees"))
        site = _running(clone, work, "sphinx", *options, "docs", str(pages / "site"), store=papers)
        site_done = stack.enter_context(site)
        shutil.copytree(papers, database, dirs_exist_ok=True)
        for name in others:
            begin(f"building the site, and the tables of {name}")
            program("build", "--library", name, "--store", str(database))
        begin("building the site")
        site_done()
        os.replace(pages / "site", part / "site")
        shutil.rmtree(pages)
        begin("publishing the edition")
        edition = _publish(clone, database, part)
        begin("describing it")
        _describe(clone, part, edition)
        bar.advance(task)
    return edition


def check_clone(clone: Path) -> None:
    """Raise ReleaseError unless a directory is a clone of the repository in which every change is committed."""
    if not (clone / ".git").exists() or shutil.which("git") is None:
        raise ReleaseError(
            f"{clone} is not a clone of the repository, or git is missing; clone it, install the program there with "
            "pip install -e '.[release]', and release from it"
        )
    changed = git(clone, "status", "--porcelain").splitlines()
    if changed:
        raise ReleaseError(
            f"{clone} has changes that are not committed, such as {changed[0][3:]}; commit or remove them"
        )


def git(clone: Path, *arguments: str) -> str:
    """Return what git says of a clone."""
    return subprocess.run(["git", "-C", str(clone), *arguments], capture_output=True, text=True, check=True).stdout


def _run(clone: Path, work: Path, module: str, *arguments: str) -> None:
    """Run a module of Python in the clone; ReleaseError names the log if it fails."""
    with _running(clone, work, module, *arguments) as done:
        done()


@contextlib.contextmanager
def _running(
    clone: Path, work: Path, module: str, *arguments: str, store: Path | None = None
) -> Iterator[Callable[[], None]]:
    """Start a module of Python in the clone, and yield a function that waits for its end, as `_run` does."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("BRDFDB_")}
    environment |= {} if store is None else {"BRDFDB_STORE": str(store)}
    log = work / f"{module.partition('.')[0]}.log"
    with log.open("a", encoding="utf-8") as output:
        command = [sys.executable, "-m", module, *arguments]
        process = subprocess.Popen(
            command, cwd=clone, env=environment, stdout=output, stderr=output, start_new_session=True
        )

    def done() -> None:
        if process.wait():
            last = log.read_text(encoding="utf-8", errors="replace").strip().rpartition("\n")[2]
            raise ReleaseError(f"{module} {' '.join(arguments[:1])} failed: {last}; {log} has its output")

    try:
        yield done
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)  # Sphinx does not end the processes that it forked
            process.wait()


def _publish(clone: Path, store: Path, part: Path) -> documents.EditionFacts:
    """Publish the store as an edition and return its facts."""
    of_library = {title: set(presets(name)) for name, title in libraries().items()}
    names = set(brdfdb.open(store))
    if names != set().union(*of_library.values()):
        raise ReleaseError(f"{store} has materials of other recipes; remove {store.parent}, and release again")
    published = publish_edition(store, part / "edition")
    for lock in (part / "edition").glob(".*"):  # of publishers on this machine
        lock.unlink()
    (catalogue,) = (part / "edition" / "catalogue").iterdir()
    columns = import_extra("pyarrow.parquet").read_schema(catalogue)
    return documents.EditionFacts(
        digest=published.digest,
        date=git(clone, "show", "-s", "--format=%cs").strip(),
        libraries={title: len(members & names) for title, members in of_library.items()},
        objects=published.objects,
        bytes=published.bytes,
        catalogue=catalogue.relative_to(part).as_posix(),
        catalogue_bytes=catalogue.stat().st_size,
        columns={field.name: str(field.type) for field in columns},
    )


def _describe(clone: Path, part: Path, edition: documents.EditionFacts) -> None:
    """Write the documents of an edition, and the checksums of all files."""
    citation = (clone / "CITATION.cff").read_text(encoding="utf-8")
    page = part / "site" / "index.html"
    texts = {
        part / "CITATION.cff": documents.citation(citation, edition),
        part / "datacite.json": json.dumps(documents.datacite(citation, edition), indent=2, ensure_ascii=False),
        part / "croissant.json": json.dumps(documents.croissant(edition), indent=2, ensure_ascii=False),
        page: documents.front_page(page.read_text(encoding="utf-8"), documents.schema_org(edition)),
    }
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8")
    files = sorted(path for path in part.rglob("*") if path.is_file())
    lines = [f"{sha256_of(path)}  {path.relative_to(part).as_posix()}\n" for path in files]
    (part / CHECKSUMS).write_text("".join(lines), encoding="utf-8")
