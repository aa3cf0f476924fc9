"""The text of code and pages: one word for one thing, as the glossary says."""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = [path for folder in ("brdfdb", "pipelines", "api") for path in sorted((ROOT / folder).rglob("*.py"))]
GLOSSARY = ROOT / "docs" / "reference" / "glossary.md"
# Folders of pages that the build of the site writes, and of records that quote what was rejected
_WRITTEN = {"_build", "generated", "figures", "materials", "papers", "api"}
_DECISIONS = ROOT / "docs" / "explanation" / "decisions"
_OF_THE_SITE = {path for path in (ROOT / "docs").rglob("*.md") if not _WRITTEN & {*path.relative_to(ROOT).parts}}
PAGES = [ROOT / "README.md", ROOT / "brdfdb" / "DESIGN.md", *sorted(_OF_THE_SITE - {GLOSSARY, *_DECISIONS.iterdir()})]


@cache
def _retired() -> list[str]:
    """Return the words in the last column of the glossary."""
    rows = GLOSSARY.read_text(encoding="utf-8").splitlines()
    cells = [row.strip("|").split("|")[-1] for row in rows if row.startswith("|") and "---" not in row][1:]
    return [word.strip() for cell in cells for word in cell.split(",") if word.strip()]


def _prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line number and text of comments and of strings with a space."""
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type == tokenize.COMMENT or (token.type == tokenize.STRING and " " in token.string):
            yield token.start[0], token.string


def test_the_glossary_retires_words() -> None:
    assert {"Dirac part", "representation", "candidate"} <= set(_retired())


def test_no_retired_word_is_used() -> None:
    words = re.compile(r"\b(" + "|".join(map(re.escape, _retired())) + r")s?\b", flags=re.IGNORECASE)
    pages = ((path, enumerate(path.read_text(encoding="utf-8").splitlines(), 1)) for path in PAGES)
    lines = (*((path, _prose(path)) for path in SOURCES), *pages)
    text = ((path, number, line) for path, prose in lines for number, line in prose)
    assert [f"{path}:{number}: {hit.group()}" for path, number, line in text if (hit := words.search(line))] == []


def test_no_line_of_a_page_is_read_as_a_comment() -> None:
    # MyST leaves out lines that begin with a percent sign; those of code cells are in fences
    outside = {path: re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.M | re.S) for path in PAGES}
    assert [str(path) for path, text in outside.items() if re.search(r"^\s*%", text, flags=re.M)] == []
