"""The command `brdfdb plot`."""

from __future__ import annotations

import argparse
import io

from brdfdb_pipelines.commands._arguments import add_out, add_tables

HELP = "Plot lobe, cuts, albedo and slices of materials as PNG or SVG."

KINDS = ("lobe", "cuts", "albedo", "slices")
_SIZE = (6.4, 3.9)  # width and height [inch]
_DPI = 150


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the materials, the kind of plot and the format."""
    parser.add_argument("names", nargs="+", metavar="NAME", help="materials")
    add_tables(parser)
    parser.add_argument("--kind", choices=KINDS, metavar="KIND", help=f"{', '.join(KINDS)} (default: all)")
    parser.add_argument("--format", choices=("png", "svg"), default="png", help="format of the files (default: png)")
    parser.add_argument("--wavelength", type=float, metavar="NM", help="wavelength in nanometres (default: 550)")
    add_out(parser, "brdf-plots")


def run(options: argparse.Namespace) -> int:
    """Write NAME-KIND.FORMAT for each material and kind, and print where."""
    from brdfdb.errors import counted, import_extra

    import_extra("matplotlib")  # before the store is read
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from brdfdb.store import open_tables
    from brdfdb.store.files import write_file
    from brdfdb_pipelines import terminal

    kinds = KINDS if options.kind is None else (options.kind,)
    store = open_tables(options.store)
    revisions = {name: store.head(name) for name in options.names}  # refuses an unknown name before anything is drawn
    options.out.mkdir(parents=True, exist_ok=True)
    known: list[str] = []
    with terminal.progress() as bar:
        task = bar.add_task("plotting", total=len(revisions) * len(kinds))
        for name in revisions:
            table = store[name]
            measured = table.metadata.measured
            if measured is not None and measured.share:
                known.append(f"{name}: {measured.share} of all pairs of directions {measured.origin}, the rest made up")
            if table.glints is not None:
                known.append(f"{name}: {table.glints.sentence}")
            for kind in kinds:
                # a fixed salt and no date: the same table gives the same bytes
                with mpl.rc_context({"svg.hashsalt": f"{name}-{kind}"}):
                    figure = Figure(figsize=_SIZE, layout="constrained")
                    getattr(table.plot, kind)(wavelength_nm=options.wavelength, ax=figure.add_subplot())
                    undated = {"Date": None} if options.format == "svg" else None
                    drawn = io.BytesIO()
                    figure.savefig(drawn, format=options.format, dpi=_DPI, metadata=undated)
                    write_file(options.out / f"{name}-{kind}.{options.format}", drawn.getvalue(), options.out)
                bar.advance(task)
    for sentence in known:
        print(terminal.plain(sentence))
    print(f"{counted(len(revisions) * len(kinds), f'{options.format.upper()} file')} in {options.out}")
    return 0
