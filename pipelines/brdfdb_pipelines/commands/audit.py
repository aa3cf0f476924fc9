"""The command `brdfdb audit`."""

from __future__ import annotations

import argparse
import sys

from brdfdb_pipelines.commands import INTERRUPTED, VIOLATED
from brdfdb_pipelines.commands._arguments import add_jobs, add_store, place, share_cores

HELP = "Audit tables, their models and their metadata; exit with 1 for a new violation or an unjudged table."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the materials, the store and the report."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="materials (default: all)")
    add_store(parser)
    parser.add_argument(
        "--report",
        type=place,
        metavar="FILE",
        help="JSON report, FILE.json; the page is FILE.html (default: DIR/audit.json; with names DIR/audit-part.json)",
    )
    add_jobs(parser, "number of processes")
    parser.add_argument(
        "--allow",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="materials whose models may have an albedo above 1; the report names them as accepted",
    )
    parser.add_argument(
        "--all",
        action="store_true",
        help="audit everything again (default: results of the last report are reused for unchanged tables)",
    )
    parser.add_argument("--no-figures", action="store_true", help="leave out the stability atlas and the gallery")


def run(options: argparse.Namespace) -> int:
    """Audit the materials; return `VIOLATED` if there is a new violation, or a table that nothing can judge."""
    share_cores()
    from brdfdb.store.summary_words import REPORT_OF_ALL, REPORT_OF_SOME
    from brdfdb_pipelines import audit

    default = options.store / (REPORT_OF_SOME if options.names else REPORT_OF_ALL)
    try:
        report = audit.run(
            options.store,
            options.names,
            options.report or default,
            jobs=options.jobs,
            figures=not (options.names or options.no_figures),
            allow=options.allow,
            again=options.all,
        )
    except KeyboardInterrupt:
        print("brdfdb: interrupted; no report was written, an earlier one is unchanged", file=sys.stderr)
        return INTERRUPTED
    return VIOLATED if report.violations or report.not_judged or report.families_wrong else 0
