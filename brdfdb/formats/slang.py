"""Slang: the closed form of a table's model as a function.

The function gives f_r in 1/sr, without the cosine. It computes the model itself with the parameters of the material, so
nothing is interpolated. The stated error is that of the model against the table.

Anisotropic models fit, and colours in linear sRGB. Models with integrals or spectra of refractive indices have no
closed form, and are refused. The specular part is left out.
"""

from __future__ import annotations

import functools

from brdfdb.formats._shader_source import Language, write_source

suffix = ".slang"
media_type = "text/plain"
summary = "closed-form models as source code of Slang"
tools = "Slang and the programs that compile it: Falcor, RTX Kit, Vulkan, CUDA; HLSL has the same text"
kinds: tuple[str, ...] = ()
options = ()

LANGUAGE = Language("float3", "float3")
write = functools.partial(write_source, LANGUAGE)
