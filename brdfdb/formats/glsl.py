"""GLSL: the closed form of a table's model as a function."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from brdfdb.formats._shader_source import Language, write_source

if TYPE_CHECKING:
    from brdfdb.formats._written import Written
    from brdfdb.tables.table import Table

suffix = ".glsl"
media_type = "text/plain"
summary = "closed-form models as source code of GLSL"
tools = "OpenGL, Vulkan, Blender, Houdini and other programs with shaders in GLSL"
kinds: tuple[str, ...] = ()
options = ()

LANGUAGE = Language("vec3", "vec3")


def write(table: Table, path: str | os.PathLike[str], *, verdict: str | None = None) -> Written:
    """Write the function `vec3 brdf(vec3 wi, vec3 wr)` of the model of a table: whole, or not at all.

    Parameters
    ----------
    table : Table
        Table in memory, of a model with a closed form.
    path : path
        The file; one that is there is replaced. The record is in its first lines, as comments.
    verdict : str, optional
        Verdict of the audit of this revision.

    Returns
    -------
    Written
        The file, with the error of the model against the table.

    Raises
    ------
    CannotHoldError
        If the table does not say which model it holds, or the model has no closed form in a shader.
    WriteError
        If the file cannot be written.
    """
    return write_source(table, path, LANGUAGE, verdict)
