"""The number of statements of the gallery that notice each wrong model: ``python tests/benchmarks/mutants.py``.

Plants every wrong model of a paper, computes the figures of the paper, and prints a line a wrong model; exits with 1 if
a statement fails for none of them, or fewer than two statements notice one. About a minute in all. ``--quick`` takes
the first three wrong models of each paper, and then statements may well fail for none.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.gallery import GALLERY
from tests.gallery.mutants import document
from tests.gallery.mutants.mutation import matrix_of


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("papers", nargs="*", choices=[[], *document.PAPERS], help="papers, by default all")
    parser.add_argument("--statements", action="store_true", help="print which statements notice each wrong model")
    parser.add_argument("--quick", action="store_true", help="take three wrong models of each paper")
    parser.add_argument("--write", action="store_true", help=f"write {document.PATH} and do nothing else")
    arguments = parser.parse_args()
    if arguments.write:
        document.PATH.write_text(document.text(), encoding="utf-8")
        return 0
    wrong = 0
    for paper in arguments.papers or document.PAPERS:
        module = document.PAPERS[paper]
        keys = [key for key in GALLERY if key.startswith(module.PREFIX)]
        matrix = matrix_of(keys, module.MUTANTS[:3] if arguments.quick else module.MUTANTS)
        print(f"{paper}: {matrix}", flush=True)
        for name, failing in matrix.noticed.items() if arguments.statements else ():
            print("\n".join([name, *(f"    {sentence.figure}: {sentence.says}" for sentence in sorted(failing))]))
        wrong += len(matrix.overlooked) + (0 if arguments.quick else len(matrix.blind))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
