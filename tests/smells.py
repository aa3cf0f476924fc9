"""Smells of the house: shapes worth a second look, printed after the tests. They fail none."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
LONG_FILE, LONG_FUNCTION, MANY_PARAMETERS = 800, 80, 9  # lines, lines, parameters outside of kernels
LONG_SENTENCE = 35  # words
EMPTY_NAMES = {"found", "each", "said", "told", "asked", "here"}  # they say nothing of what they hold
_COMPILED = {"kernel", "loop", "inner_loop"}
_Function = ast.FunctionDef | ast.AsyncFunctionDef


def sources(*folders: str) -> list[Path]:
    """Return the Python files below folders of the repository."""
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


def smells() -> list[str]:
    """Return a line for each smell of the library, the command line, the service, their tests and the first pages."""
    lines: list[str] = []
    classes: dict[str, list[str]] = defaultdict(list)
    for path in sources("brdfdb", "pipelines", "api", "tests"):
        name = path.relative_to(ROOT).as_posix()
        text = path.read_text(encoding="utf-8")
        if (count := text.count("\n")) > LONG_FILE:
            lines.append(f"{name}: {count} lines")
        is_test = name.startswith("tests/")
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, _Function):
                lines += [f"{name}:{node.lineno}: {smell}" for smell in _of_function(node, is_test)]
            elif isinstance(node, ast.ClassDef) and not is_test:
                classes[node.name].append(name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and not is_test:
                lines += [f"{name}:{node.lineno}: variable {node.id}"] if node.id in EMPTY_NAMES else []
    shared = {key: places for key, places in classes.items() if len(places) > 1}
    for page in ("README.md", "CONTRIBUTING.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        lines += [f"{page}: {part[:60]}..." for part in sentences(text) if len(part.split()) > LONG_SENTENCE]
    return [*lines, *(f"class {key} is in {', '.join(places)}" for key, places in sorted(shared.items()))]


def _of_function(node: _Function, is_test: bool) -> Iterator[str]:
    """Yield what is long or many of a function."""
    count = (node.end_lineno or node.lineno) - node.lineno + 1
    if count > LONG_FUNCTION:
        yield f"{node.name} has {count} lines"
    decorators = {name.id for each in node.decorator_list for name in ast.walk(each) if isinstance(name, ast.Name)}
    parameters = len(node.args.posonlyargs) + len(node.args.args) + len(node.args.kwonlyargs)
    if parameters >= MANY_PARAMETERS and not is_test and decorators.isdisjoint(_COMPILED):
        yield f"{node.name} has {parameters} parameters"


def sentences(text: str) -> list[str]:
    """Return the sentences of a page: of its paragraphs, list items and cells; headings and code are left out."""
    prose = re.sub(r"^```.*?^```$", "\n", text, flags=re.MULTILINE | re.DOTALL)
    prose = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", prose)
    lines = [line for line in prose.splitlines() if not re.match(r"#|\[!|\|[-|]*$", line)]
    paragraphs = re.split(r"\n\s*\n|\n(?=[*-] )|\n(?=\|)|\|", "\n".join(lines))
    return [part for text in paragraphs for part in re.split(r"(?<=[.?!:;])\s+", text.strip(" \n*|"))]
