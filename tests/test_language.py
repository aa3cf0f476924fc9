"""The text of code and pages: one word for one thing, variables that are nouns, docstrings that begin with a verb."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = [path for folder in ("brdfdb", "pipelines", "api") for path in sorted((ROOT / folder).rglob("*.py"))]
GLOSSARY = ROOT / "docs" / "reference" / "glossary.md"
# Folders of pages that the build of the site writes, and of records that quote what was rejected
_WRITTEN = {"_build", "generated", "figures", "materials", "papers", "api"}
_DECISIONS = ROOT / "docs" / "explanation" / "decisions"
_OF_THE_SITE = {path for path in (ROOT / "docs").rglob("*.md") if not _WRITTEN & {*path.relative_to(ROOT).parts}}
PAGES = [ROOT / "README.md", ROOT / "brdfdb" / "DESIGN.md", *sorted(_OF_THE_SITE - {GLOSSARY, *_DECISIONS.iterdir()})]
# Names of variables that say nothing of what they hold
EMPTY_NAMES = {"found", "each", "said", "told", "asked", "here"}
# A function's docstring begins with a verb in the imperative; these begin another kind of sentence
NO_VERB = re.compile(
    r"(What|How|Where|Whether|Which|Who|When|Of|From|As|The|A|An|All|Each|Every|It|If|True|False|Is|Are|Has|Its|To|On|"
    r"In|For|With|By|So|Such|Those|That|This|At)\b"
)


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


@pytest.mark.parametrize("path", [*SOURCES, *PAGES], ids=lambda path: str(path.relative_to(ROOT)))
def test_no_retired_word_is_used(path: Path) -> None:
    prose = _prose(path) if path.suffix == ".py" else enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    words = re.compile(r"\b(" + "|".join(map(re.escape, _retired())) + r")s?\b", flags=re.IGNORECASE)
    assert [f"line {number}: {hit.group()}" for number, text in prose if (hit := words.search(text))] == []


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_variables_are_nouns(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = [
        *((n.lineno, n.id) for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)),
        *((n.lineno, n.arg) for n in ast.walk(tree) if isinstance(n, ast.arg)),
    ]
    assert [f"line {line}: {name}" for line, name in names if name in EMPTY_NAMES] == []


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_docstrings_of_functions_begin_with_a_verb(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    plain = [n for n in functions if not any("property" in ast.unparse(d) for d in n.decorator_list)]
    first = [(n.name, text) for n in plain if (text := ast.get_docstring(n))]
    assert [f"{name}: {text.splitlines()[0]}" for name, text in first if NO_VERB.match(text)] == []
