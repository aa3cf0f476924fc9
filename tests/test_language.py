"""The text of code and pages: one word for one thing, variables that are nouns, docstrings that begin with a verb."""

from __future__ import annotations

import ast
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


def test_no_retired_word_is_used() -> None:
    words = re.compile(r"\b(" + "|".join(map(re.escape, _retired())) + r")s?\b", flags=re.IGNORECASE)
    pages = ((path, enumerate(path.read_text(encoding="utf-8").splitlines(), 1)) for path in PAGES)
    lines = (*((path, _prose(path)) for path in SOURCES), *pages)
    text = ((path, number, line) for path, prose in lines for number, line in prose)
    assert [f"{path}:{number}: {hit.group()}" for path, number, line in text if (hit := words.search(line))] == []


def test_variables_are_nouns() -> None:
    stored = (
        (f"{path}:{node.lineno}", node.id if isinstance(node, ast.Name) else node.arg)
        for path in SOURCES
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.arg) or (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store))
    )
    assert [f"{place}: {name}" for place, name in stored if name in EMPTY_NAMES] == []


def test_docstrings_of_functions_begin_with_a_verb() -> None:
    plain = (
        (path, node)
        for path in SOURCES
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and not any("property" in ast.unparse(each) for each in node.decorator_list)
    )
    first = ((path, node.name, text) for path, node in plain if (text := ast.get_docstring(node)))
    assert [f"{path}: {name}: {text.splitlines()[0]}" for path, name, text in first if NO_VERB.match(text)] == []


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))
