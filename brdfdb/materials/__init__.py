"""Sources of f_r: the materials of the papers, materials of your own, and functions."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from brdfdb.errors import BrdfdbError, sentence_of
from brdfdb.materials.function_source import FunctionRecord, FunctionSource
from brdfdb.materials.material import Material, exact_material
from brdfdb.materials.preset_files import PAPERS, libraries, presets
from brdfdb.materials.source import Source
from brdfdb.materials.written_parameters import written_name

__all__ = [
    "PAPERS",
    "FunctionRecord",
    "FunctionSource",
    "Material",
    "Source",
    "exact_material",
    "libraries",
    "presets",
    "source_of",
    "written_name",
]


def source_of(document: Mapping[str, Any]) -> Material | FunctionRecord:
    """Return the source in a document of `Source.document`: a complete material, or a function without its callable.

    Other keys are ignored. BrdfdbError says that the document describes no source, or a material whose model is not
    installed or has other parameters.
    """
    try:
        if "material" in document:
            return Material.model_validate(document["material"])
        return FunctionRecord.model_validate(document["function"])
    except KeyError:
        raise BrdfdbError("source: the document names neither a material nor a function") from None
    except ValidationError as error:
        raise BrdfdbError(f"source: {sentence_of(error.errors(include_url=False)[0])}") from None
