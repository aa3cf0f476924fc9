"""The command `brdfdb fit`."""

from __future__ import annotations

import argparse
import sys

from brdfdb_pipelines.commands._arguments import place, share_cores
from brdfdb_pipelines.commands._reading import add_reading, reading_keys
from brdfdb_pipelines.exit_codes import INTERRUPTED

HELP = "Fit models to measured samples: their parameters with intervals, ranked by the error at incidences left out."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the file, the models, the residual, and the forms of the answer."""
    parser.add_argument(
        "data",
        nargs="+",
        type=place,
        metavar="DATA",
        help="a file of samples, or several of one surface; a table of another program; or published fits (NAME.fit)",
    )
    add_reading(parser)
    parser.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="NAME",
        help="a model, or a sum such as 'A + 2 B'; may be repeated (default: every model, and sums with a uniform f_r)",
    )
    parser.add_argument(
        "--residual",
        choices=("log", "relative", "cosine", "uncertainty"),
        default="log",
        help="what is made small (default: log, the difference of logarithms)",
    )
    parser.add_argument("--channel", metavar="NAME", help="the channel that is fitted (default: all together)")
    parser.add_argument(
        "--refractive-index",
        metavar="ENTRY",
        help="shelf/book/page of models with n and k (default: n and k are searched)",
    )
    parser.add_argument(
        "--receiver-deg",
        type=float,
        metavar="DEG",
        help="full angle of the receiver, as the sample sees it: lobes are averaged over it (default: as DATA states)",
    )
    parser.add_argument("--source-deg", type=float, metavar="DEG", help="the same of the light")
    parser.add_argument("--json", type=place, metavar="FILE", help="write all fits as JSON")
    parser.add_argument("--page", type=place, metavar="FILE", help="write a page with figures, FILE.html")
    parser.add_argument("--recipe", type=place, metavar="FILE", help="write the best model as a recipe, FILE.toml")


def run(options: argparse.Namespace) -> int:
    """Fit, and print the ranking."""
    share_cores()
    from brdfdb.errors import counted, import_extra
    from brdfdb.fitting.published import SUFFIX
    from brdfdb_pipelines import fit

    import_extra("scipy")
    if any(file.suffix.lower() == SUFFIX for file in options.data):
        return _published(options)
    if options.page is not None:
        import_extra("matplotlib")  # before the time is spent
        import_extra("jinja2")
    document = fit.run(
        options.data,
        options.model or None,
        keys=reading_keys(options),
        residual=options.residual,
        channel=options.channel,
        refractive_index=options.refractive_index,
        receiver_deg=options.receiver_deg,
        source_deg=options.source_deg,
        json=options.json,
        page=options.page,
        recipe=options.recipe,
    )
    if document.interrupted:
        print(f"brdfdb: interrupted; {counted(len(document.fits), 'model')} of the search are above", file=sys.stderr)
        return INTERRUPTED
    return 0


def _published(options: argparse.Namespace) -> int:
    """List published fits; options of searches are refused."""
    from brdfdb.errors import ParameterError
    from brdfdb_pipelines import published_fits

    first, *others = options.data
    if others:
        raise ParameterError("DATA", f"{first} and {len(others)} more: published fits are listed one file at a time")
    of_samples = ("format", "column", "quantity", "angles", "azimuth", "wavelength_nm", "member", "side")
    for name in (*of_samples, "model", "refractive_index", "receiver_deg", "source_deg", "page"):
        if getattr(options, name):
            option = f"--{name.replace('_', '-')}"
            raise ParameterError(option, f"{first} holds the fits of others and no samples; leave it out")
    published_fits.run(first, channel=options.channel, json=options.json, recipe=options.recipe)
    return 0
