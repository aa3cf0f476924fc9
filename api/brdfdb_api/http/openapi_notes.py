"""Notes of the OpenAPI document beyond signatures: answers, bodies, and queries that are read by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from brdfdb.formats import EXPORTERS, Option, options_of
from brdfdb_api.http.responses import NPY, Problem

ANGLE_SCHEMA = {"anyOf": [{"type": "number"}, {"type": "array", "items": {}}]}
BODY = {
    "description": "Angles in degrees, numbers or nested lists of numbers that broadcast as numpy arrays do; or a .npy "
    "array of shape (..., 4), float32 or float64, with the wavelengths in the query. A body of any other media type is "
    "read as JSON.",
    "required": True,
    "content": {
        "application/json": {
            "schema": {
                "type": "object",
                "required": ["theta_i", "theta_r"],
                "additionalProperties": False,
                "properties": {
                    "theta_i": {**ANGLE_SCHEMA, "description": "polar angle of the light [degrees], 0 to 180"},
                    "phi_i": {**ANGLE_SCHEMA, "description": "azimuth of the light [degrees]", "default": 0},
                    "theta_r": {**ANGLE_SCHEMA, "description": "polar angle of the viewer [degrees], 0 to 180"},
                    "phi_r": {**ANGLE_SCHEMA, "description": "azimuth of the viewer [degrees]", "default": 0},
                    "wavelength_nm": {
                        "anyOf": [
                            {"type": "number"},
                            {"type": "array", "items": {"type": "number"}, "minItems": 1},
                            {"type": "null"},
                        ],
                        "description": "wavelengths [nm]; missing or null: every wavelength of the table",
                    },
                },
            },
            "example": {"theta_i": 45, "theta_r": [0, 30, 60], "phi_r": 180},
        },
        NPY: {"schema": {"type": "string", "format": "binary", "description": "theta_i, phi_i, theta_r, phi_r"}},
    },
}

NPY_ANSWER = {NPY: "brdf alone, or brdf and error on a first axis, as a .npy file"}
LOBE_NPY_ANSWER = {NPY: "brdf as a .npy file"}


def _parameter(name: str, schema: dict[str, Any], description: str, *, required: bool = False) -> dict[str, Any]:
    return {"name": name, "in": "query", "required": required, "description": description, "schema": schema}


def _format(held: str) -> dict[str, Any]:
    chosen = f"missing: npy if the Accept header names {NPY}, or of a .npy body does not name JSON; npy holds {held}"
    return _parameter("format", {"type": "string", "enum": ["json", "npy"]}, chosen)


_THETA = {"type": "number", "minimum": 0, "maximum": 180}
_PHI = {"type": "number", "default": 0}

POINT = [
    _parameter("theta_i", _THETA, "polar angle of the light [degrees]", required=True),
    _parameter("phi_i", _PHI, "azimuth of the light [degrees], any finite number"),
    _parameter("theta_r", _THETA, "polar angle of the viewer [degrees]", required=True),
    _parameter("phi_r", _PHI, "azimuth of the viewer [degrees]; phi_r - phi_i = 180 is the mirror"),
]
WAVELENGTHS = _parameter(
    "wavelength_nm",
    {"type": "array", "items": {"type": "number"}},
    "wavelength [nm], repeatable; missing: all of the table",
)
_CHOICES = [
    _parameter(
        "from",
        {"type": "string", "enum": ["table", "model"], "default": "table"},
        "the table, or the model that it was made of",
    ),
    _parameter(
        "output",
        {"type": "string", "enum": ["spectrum", "xyz", "linear-srgb"], "default": "spectrum"},
        "colours are in 1/sr like f_r: white is Y = 1/pi",
    ),
    _parameter("illuminant", {"type": "string"}, "of a colour: a name of colour-science, such as A or FL2; else D65"),
]
OPTIONS = [*_CHOICES, _format("brdf alone, with error=true brdf and error on a first axis")]
LOBE_OPTIONS = [*_CHOICES, _format("brdf")]
ERROR = _parameter(
    "error",
    {"type": "string", "enum": ["false", "true"], "default": "false"},
    "the error that the table states beside the values; not of a model",
)


# Sizes that the service makes a file of: larger ones take gigabytes or minutes, and are for `brdfdb export`
_SERVED = {
    "eradiate": {"nodes": 129.0},
    "png": {"size": 512.0},
    "radiance": {"cells": 600_000.0},
    "rgl": {"megabytes": 64.0},
    **{file_format: {"size": 16.0} for file_format in ("astm", "fred", "ssdd", "zemax")},
}


def served_options(file_format: str) -> dict[str, Option]:
    """Return the options of a format by name, with the ranges that the service allows."""
    highest = _SERVED.get(file_format, {})
    return {
        name: replace(option, high=min(option.high, highest.get(name, math.inf)))
        for name, option in options_of(EXPORTERS[file_format]).items()
    }


def _option(name: str) -> dict[str, Any]:
    """Return the parameter of an option of one or more formats, with the values that any of them allows."""
    formats: dict[Option, list[str]] = {}
    for file_format in EXPORTERS:
        if option := served_options(file_format).get(name):
            formats.setdefault(option, []).append(file_format)
    options, defaults = list(formats), {option.default for option in formats}
    if all(isinstance(option.default, str) for option in options):
        choices = [choice for option in options for choice in option.choices]
        schema: dict[str, Any] = {"type": "string", "enum": list(dict.fromkeys(choices))}
    elif all(isinstance(option.default, bool) for option in options):
        schema = {"type": "string", "enum": ["false", "true"]}
    elif any(isinstance(option.default, bool | str) for option in options):
        schema = {"type": "string"}
    else:
        low = min(end for option in options for end in (option.low, float(option.default)))
        high = max(end for option in options for end in (option.high, float(option.default)))
        schema = {"type": "number", "minimum": low, "maximum": high}
    if len(defaults) == 1:
        default = defaults.pop()
        schema["default"] = str(default).lower() if isinstance(default, bool) else default
    texts = [f"{', '.join(names)}: {option.help}; {option.allowed}" for option, names in formats.items()]
    return _parameter(name, schema, ". ".join(texts))


# Of all formats: an option that a format does not have is refused
EXPORT_OPTIONS = [_option(name) for name in dict.fromkeys(name for key in EXPORTERS for name in served_options(key))]


def answers(model: type | None, *statuses: int, media: dict[str, str] | None = None) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of the answers of an address: `model` at 200 or other media, and `statuses`."""
    others: dict[int, dict[str, Any]] = {
        304: {"description": "The ETag in If-None-Match still holds"},
        404: {"description": "No such material or revision; the closest names are listed", "model": Problem},
        413: {"description": "Too large a body, or too many points for one answer", "model": Problem},
        422: {"description": "A parameter is missing, unknown or out of range; it is named", "model": Problem},
        503: {
            "description": "The store, or the files of this material, cannot be read; or too much is asked for at once",
            "model": Problem,
        },
    }
    success: dict[str, Any] = {"description": "Success"}
    if model is not None:
        success["model"] = model
    if media is not None:
        success["content"] = {
            kind: {"schema": {"type": "string", "format": "binary", "description": text}}
            for kind, text in media.items()
        }
    return {200: success, **{status: others[status] for status in statuses}}
