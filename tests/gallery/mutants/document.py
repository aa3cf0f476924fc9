"""The list of wrong models, as the page docs/results/mutants.md."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from tests.gallery.mutants import he_torrance_1991, oren_nayar_1994, ward_1992
from tests.gallery.mutants.mutation import BASES

PATH = Path("docs/results/mutants.md")
PAPERS: dict[str, ModuleType] = {
    "Oren and Nayar 1994": oren_nayar_1994,
    "He, Torrance, Sillion and Greenberg 1991": he_torrance_1991,
    "Ward 1992": ward_1992,
}

_INTRODUCTION = """\
# Wrong models

The gallery compares figures of the papers with sentences of the papers. A sentence that a wrong model satisfies, too,
proves nothing. Therefore the tests plant the wrong models below, one at a time, and compute all figures of the paper
again. Every statement that holds must fail for at least one of them. At least two statements must notice each of them.

`python tests/benchmarks/mutants.py` prints the number of statements that notice each wrong model, and with
`--statements` the statements. With `--write` it writes this list. A test compares it with `tests/gallery/mutants`.

Each statement names the basis of its threshold, on the page of an audit and in `threshold_from`:
"""


def text() -> str:
    """Return the text of the page."""
    bases = [f"* *{basis}*: {meaning}" for basis, meaning in BASES.items()]
    tables = [table(paper, module) for paper, module in PAPERS.items()]
    return "\n".join([_INTRODUCTION, *bases, *tables, ""])


def table(paper: str, module: ModuleType) -> str:
    """Return the table of the wrong models of a paper."""
    rows = [
        f"| {mutant.name} | {mutant.changes} | {mutant.because} |".replace("|F|", "\\|F\\|")
        for mutant in module.MUTANTS
    ]
    head = ["", f"## {paper}", "", "| wrong model | what is wrong | why one would write it |", "|---|---|---|"]
    return "\n".join([*head, *rows])
