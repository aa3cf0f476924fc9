"""The number of statements of the gallery that notice each wrong model: ``python tests/benchmarks/mutants.py``.

Plants every wrong model of a paper, computes the figures of the paper, and prints a line for each wrong model. Exits
with 1 if a statement fails for none of them, or fewer than two statements notice one. It takes about a minute.
``--quick`` takes the first two wrong models of one paper, and then statements may well fail for none.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.gallery import GALLERY
from tests.benchmarks.recording import Column, Run
from tests.gallery.mutants import document
from tests.gallery.mutants.mutation import matrix_of

QUICK_PAPER, QUICK_MUTANTS = "Ward 1992", 2
MEASURED = "The number of statements of the gallery that fail when a model is replaced by a wrong one."


def main(arguments: Sequence[str] | None = None) -> int:
    """Plant the wrong models, and return 1 if one is overlooked."""
    run = Run("mutants", "accuracy", "Wrong models that the gallery notices", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("papers", nargs="*", choices=[[], *document.PAPERS], help="papers, by default all")
    parser.add_argument("--statements", action="store_true", help="print which statements notice each wrong model")
    parser.add_argument("--write", action="store_true", help=f"write {document.PATH.name} and do nothing else")
    options = run.parse(parser, arguments)
    if options.write:
        document.PATH.write_text(document.text(), encoding="utf-8")
        return 0
    wrong = 0
    for paper in options.papers or ([QUICK_PAPER] if options.quick else document.PAPERS):
        module = document.PAPERS[paper]
        keys = [key for key in GALLERY if key.startswith(module.PREFIX)]
        matrix = matrix_of(keys, module.MUTANTS[:QUICK_MUTANTS] if options.quick else module.MUTANTS)
        table = run.table(paper, Column(name="wrong model", width=60), "statements that notice it")
        for name, failing in matrix.noticed.items():
            table.add(name, len(failing))
            if options.statements:
                print("\n".join(f"    {sentence.figure}: {sentence.says}" for sentence in sorted(failing)))
        run.say(f"{paper}: {len(matrix.holding)} statements hold.")
        if not options.quick:
            run.say(f"{paper}: {len(matrix.blind)} statements fail for none of the wrong models.")
            wrong += len(matrix.blind)
        wrong += len(matrix.overlooked)
        table.keep_worst("statements that notice it", lambda _: None, smallest=True)
    run.say("For each paper, the page shows the wrong model that the fewest statements notice.")
    run.end()
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
