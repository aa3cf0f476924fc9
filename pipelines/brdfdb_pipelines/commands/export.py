"""The command `brdfdb export FORMAT`: one subcommand a format of `brdfdb.formats.EXPORTERS`."""

from __future__ import annotations

import argparse

from brdfdb.errors import ParameterError
from brdfdb_pipelines.commands import VIOLATED
from brdfdb_pipelines.commands._arguments import add_jobs, add_out, add_tables, place

HELP = "Write tables as files of other formats."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the format and its arguments."""
    from brdfdb.formats import EXPORTERS, options_of

    # a command a format: argparse takes no NAME after an option that follows another positional argument
    formats = parser.add_subparsers(required=True, metavar="FORMAT", dest="file_format")
    formats.hint = (  # type: ignore[attr-defined]  # read by the parser
        "; rgl is for Mitsuba 3 and pbrt; netcdf, csv and numpy are for any program"
    )
    for name, exporter in EXPORTERS.items():
        sentence = f"Write {exporter.summary}.".replace("%", "%%")
        command = formats.add_parser(name, help=sentence, description=sentence)
        command.add_argument("names", nargs="*", metavar="NAME", help="materials")
        add_tables(command)
        command.add_argument("--all", action="store_true", help="export all materials of the store")
        add_out(command, f"brdf-{name}")
        command.add_argument(
            "--audit",
            type=place,
            metavar="FILE",
            help="report of `brdfdb audit` whose verdicts are written to the files (default: the report in the store)",
        )
        add_jobs(command, "number of materials to write at the same time")
        if "tolerance" in options_of(exporter):
            command.add_argument(
                "--strict",
                action="store_true",
                help="exit with 1 if the error of a file is above the requested tolerance",
            )
        for option in options_of(exporter).values():
            flag = f"--{option.name.replace('_', '-')}"
            target = f"option_{option.name}"
            meaning = option.help.replace("%", "%%")  # argparse formats the help with the operator %
            if option.default is False:
                command.add_argument(flag, dest=target, action="store_const", const="true", help=meaning)
            elif option.choices:
                default = option.default if option.name != "kind" else "all"
                text = f"{meaning}: {', '.join(option.choices)} (default: {default})"
                command.add_argument(flag, dest=target, metavar=option.name.upper(), help=text)
            else:
                text = f"{meaning}; {option.allowed} (default: {option.default:g})"
                command.add_argument(flag, dest=target, metavar="X", help=text)


def run(options: argparse.Namespace) -> int:
    """Write the files."""
    from brdfdb.formats import EXPORTERS, options_of, parsed_options
    from brdfdb_pipelines import export

    if options.names and options.all:
        raise ParameterError("export", "name materials or give --all, not both")
    if not options.names and not options.all:
        raise ParameterError("export", "name materials, or give --all")
    exporter = EXPORTERS[options.file_format]
    texts = {name: getattr(options, f"option_{name}") for name in options_of(exporter)}
    given = parsed_options(exporter, {name: text for name, text in texts.items() if text is not None})
    within = export.run(
        options.store, options.names, options.out, options.file_format, given, options.audit, options.jobs
    )
    return VIOLATED if getattr(options, "strict", False) and not within else 0
