"""The command `brdfdb fit`."""

from __future__ import annotations

import argparse
import sys

from brdfdb_pipelines.commands import INTERRUPTED
from brdfdb_pipelines.commands._arguments import place, share_cores
from brdfdb_pipelines.commands._reading import OPTIONS, add_reading, reading_keys

HELP = "Fit models to measured samples; rank them by their error at incidences left out of the fit."

# Options that only a fit to samples has
_OF_SAMPLES = (*OPTIONS, "model", "refractive_index", "nuisance", "receiver_deg", "source_deg", "page")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the file, the models, the residual, and the forms of the answer."""
    parser.add_argument(
        "data",
        nargs="+",
        type=place,
        metavar="DATA",
        help="a file of samples, or several files of the same surface; a table of another program; or published fits "
        "(NAME.fit)",
    )
    add_reading(parser)
    parser.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="NAME",
        help="a model, or a sum such as 'A + 2 B'; may be repeated (default: all models, and sums with a uniform f_r)",
    )
    parser.add_argument(
        "--residual",
        choices=("noise", "log", "relative", "cosine", "uncertainty"),
        default="noise",
        help="difference to minimise (default: noise, that of logarithms, with a floor if samples show one)",
    )
    parser.add_argument(
        "--nuisance",
        type=lambda text: tuple(part.strip() for part in text.split(",")),
        default=(),
        metavar="KIND,KIND",
        help="errors of the measurement to fit as well: tilt (of the sample), drift (of the lamp, over the rows), dark "
        "(a signal without light)",
    )
    parser.add_argument("--channel", metavar="NAME", help="fit one channel (default: all channels together)")
    parser.add_argument(
        "--refractive-index",
        metavar="ENTRY",
        help="refractive index for models with n and k: shelf/book/page (default: n and k are fitted)",
    )
    parser.add_argument(
        "--receiver-deg",
        type=float,
        metavar="DEG",
        help="full angle of the receiver, seen from the sample; lobes are averaged over it (default: as DATA states)",
    )
    parser.add_argument(
        "--source-deg", type=float, metavar="DEG", help="full angle of the light source, in the same way"
    )
    parser.add_argument("--json", type=place, metavar="FILE", help="write all fits as JSON")
    parser.add_argument("--page", type=place, metavar="FILE", help="write a page with figures, FILE.html")
    parser.add_argument(
        "--recipe", type=place, metavar="FILE", help="write the best single model as a recipe, FILE.toml"
    )


def run(options: argparse.Namespace) -> int:
    """Fit, and print the ranking."""
    share_cores()
    from brdfdb.errors import ParameterError, counted, import_extra
    from brdfdb.fitting.published import SUFFIX
    from brdfdb_pipelines import fit

    import_extra("scipy")
    first, *others = options.data
    if any(file.suffix.lower() == SUFFIX for file in options.data):
        if others:
            raise ParameterError("DATA", f"{len(options.data)} files; a file of published fits is listed by itself")
        for name in _OF_SAMPLES:
            if getattr(options, name):
                option = f"--{name.replace('_', '-')}"
                raise ParameterError(option, f"{first} contains published fits and no samples; leave the option out")
        fit.list_published(first, channel=options.channel, json=options.json, recipe=options.recipe)
        return 0
    if options.page is not None:
        import_extra("matplotlib")  # before the time is spent
        import_extra("jinja2")
    settings = fit.FitSettings(
        models=options.model or None,
        reading=reading_keys(options),
        residual=options.residual,
        channel=options.channel,
        refractive_index=options.refractive_index,
        nuisance=options.nuisance,
        receiver_deg=options.receiver_deg,
        source_deg=options.source_deg,
    )
    document = fit.run(options.data, settings, fit.FitOutputs(options.json, options.page, options.recipe))
    if document.interrupted:
        print(f"brdfdb: interrupted; {counted(len(document.fits), 'finished model')} printed above", file=sys.stderr)
        return INTERRUPTED
    return 0
