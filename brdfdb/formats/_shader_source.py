"""Source code of the model of a table in a shading language, with the error of the model against the table."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from brdfdb.errors import CannotHoldError
from brdfdb.formats._channels import RGB, channels_of, has_spectrum
from brdfdb.formats._record import CONVENTION, frame_remark, lines, record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.parameters import Floats
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._channels import Channels
    from brdfdb.tables.table import Table

_FIT = "the functional fit of the paper, eqs 27 to 29, in place of the integrals over facets that the table holds"
_X = "the x axis of wi and wr, which the caller chooses, such as the tangent of the geometry"
_INDEX = "n", "k"  # of models with a refractive index
_FRAME = "wi and wr are unit vectors towards light and viewer in the frame of the surface: x, y, and z its normal"


@dataclass(frozen=True)
class Language:
    """A shading language: the names of its types, and what stands after the function."""

    vector: str
    color: str
    after: str = ""


def write_source(
    language: Language, table: Table, path: str | os.PathLike[str], *, verdict: str | None = None
) -> Written:
    """Write the function ``brdf(wi, wr)`` of a table's model in a shading language, with the record as comments.

    The error compares the model, or its fit, with the table in float64. The source computes in single precision, which
    is within a hundred-thousandth of the model but next to grazing.

    Raises
    ------
    CannotHoldError
        If the table does not say which model it holds, or the model has no closed form here.
    """
    from brdfdb.formats._stated_error import Comparison
    from brdfdb.models import MODELS

    model, parameters, channels, remarks = _closed_form(table)

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        values = []
        for channel in range(len(channels.names)):
            numbers = {name: np.ravel(value)[channel % np.size(value)] for name, value in parameters.items()}
            values.append(MODELS[model].vectors(wi, wr, **numbers))
        return np.stack(values, axis=-1)

    error = Comparison(table, channels).error_of(evaluate)
    remarks = (*remarks, *channels.remarks, *specular_remark(table), *frame_remark(table, _X))
    document = record(table, error, verdict, holds=CONVENTION, remarks=remarks)
    comments = [*lines(document), f"f_r [1/sr] of the model {model}, {channels.meaning}", _FRAME]
    # In ASCII, as old compilers want comments, and without a backslash at the end, which would join the next line
    comments = [line.encode("ascii", "backslashreplace").decode("ascii").rstrip("\\ ") for line in comments]
    text = "".join(f"// {line}\n" for line in comments) + "\n" + source(model, parameters, language, table.name)
    with whole(path) as (temporary,):
        temporary.write_text(text, encoding="utf-8")
    return Written((path_of(path),), error, remarks=remarks)


def source(model: str, parameters: Mapping[str, Any], language: Language, name: str) -> str:
    """Return the functions of a model, one of `brdfdb.models.shaders.SHADERS`, without the record.

    Parameters are the arguments of the model; reflectances may have three numbers.
    """
    from brdfdb.models import MODELS
    from brdfdb.models.shaders import FUNCTIONS, SHADERS

    shader = SHADERS[model]
    colors = {parameter.name for parameter in MODELS[model].parameters if parameter.reflectance}
    macros = ["#define BRDF_PI 3.14159265"]
    for key, value in parameters.items():
        numbers = [_literal(number) for number in np.ravel(value).astype(np.float64)]
        text = f"{language.color}({', '.join((numbers * len(RGB))[: len(RGB)])})" if key in colors else numbers[0]
        macros.append(f"#define P_{key.upper()} {text}")
    statements = "".join(f"    {line}\n" for line in shader.statements.splitlines())
    function = (
        "$color brdf($vector wi, $vector wr)\n{\n    float cos_i = wi[2];\n    float cos_r = wr[2];\n"
        "    if (cos_i <= 0.0 || cos_r <= 0.0) return $color(0.0, 0.0, 0.0);\n" + statements + "}\n"
    )
    parts = ["\n".join(macros) + "\n", *(FUNCTIONS[called] for called in shader.functions), function]
    identifier = "brdf_" + "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)
    whole_text = "\n".join([*parts, *([language.after] if language.after else [])])
    return Template(whole_text).substitute(vector=language.vector, color=language.color, name=identifier)


def _literal(number: float) -> str:
    """Return a number with the digits of single precision, and a point, as all these languages read it."""
    text = f"{number:.9g}"
    mantissa, exponent, power = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{exponent}{power}"


def _closed_form(table: Table) -> tuple[str, dict[str, Any], Channels, tuple[str, ...]]:
    """Return the model, its arguments in the channels, the channels, and remarks."""
    from brdfdb.materials import Material
    from brdfdb.models import MODELS
    from brdfdb.models.shaders import FITS, SHADERS

    material = table.source
    if table.metadata.measured is not None:
        raise CannotHoldError(
            f"{table.name}: the table is measured, and source code needs a model; `brdfdb fit` fits one"
        )
    if not isinstance(material, Material):
        raise CannotHoldError(f"{table.name}: the table does not name its model, so no source code can be written")
    several = has_spectrum(table)
    model, changes = FITS.get(material.model, (material.model, {}))
    indexed = MODELS[model].spectral
    if model not in SHADERS or (several and indexed):
        reason = "a spectrum of refractive indices" if model in SHADERS else "no closed form"
        raise CannotHoldError(f"{table.name}: the model {model} has {reason} in a shader; use a format of tables")
    channels = channels_of(table, "rgb" if several else "")
    defaults = {parameter.name: parameter.default for parameter in MODELS[model].parameters}
    given = {**defaults, **changes, **material.arguments(channels.wavelength_nm)}
    wanted = [*defaults, *(_INDEX if indexed else ())]
    if not indexed and any(given.get(name) is not None for name in _INDEX if name not in defaults):
        raise CannotHoldError(f"{table.name}: the model {model} with a refractive index has no closed form in a shader")
    arguments = {}
    for name in wanted:
        value = np.asarray(given[name], dtype=np.float64)
        arguments[name] = channels.of_spectra(value) if value.ndim and several else value
    return model, arguments, channels, (_FIT,) if model != material.model else ()
