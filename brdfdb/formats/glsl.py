"""GLSL: the closed form of a table's model as a function.

The function gives f_r in 1/sr, without the cosine. It computes the model with the parameters of the material, so
nothing is interpolated. Tables of Oren and Nayar's integrals over facets are the exception: the function is the
functional fit of their paper, up to 14 % off for presets, and the remarks of the file say so. The stated error is that
of the function against the table.

Anisotropic models can be written, and colours in linear sRGB. Other models with integrals, and spectra of refractive
indices, have no closed form, and are refused. The specular part is left out.
"""

from __future__ import annotations

import functools

from brdfdb.formats._shader_source import Language, write_source

suffix = ".glsl"
media_type = "text/plain"
summary = "closed-form models, or the published fit of a model, as source code in GLSL"
tools = "OpenGL, Vulkan, Blender, Houdini and other programs with shaders in GLSL"
kinds: tuple[str, ...] = ()
options = ()

LANGUAGE = Language("vec3", "vec3")
write = functools.partial(write_source, LANGUAGE)
