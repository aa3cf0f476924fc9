"""OSL: the closed form of a table's model as a function.

The function gives f_r in 1/sr, without the cosine. It computes the model with the parameters of the material, so
nothing is interpolated. Tables of Oren and Nayar's integrals over facets are the exception: the function is the
functional fit of their paper, up to 14 % off for presets, and the remarks of the file say so. The stated error is that
of the function against the table. A shader that calls the function stands below it.

Anisotropic models can be written, and colours in linear sRGB. Other models with integrals, and spectra of refractive
indices, have no closed form, and are refused. The specular part is left out.
"""

from __future__ import annotations

import functools

from brdfdb.formats._shader_source import Language, write_source

suffix = ".osl"
media_type = "text/plain"
summary = "closed-form models, or the published fit of a model, as source code in OSL"
tools = "renderers with the Open Shading Language: Cycles, Arnold, RenderMan, V-Ray"
kinds: tuple[str, ...] = ()
options = ()

# oslc compiles shaders, and no functions alone
_SHADER = """\
shader $name(vector wi = vector(0.0, 0.0, 1.0), vector wr = vector(0.0, 0.0, 1.0), output color f_r = 0.0)
{
    f_r = brdf(wi, wr);
}
"""
LANGUAGE = Language("vector", "color", _SHADER)
write = functools.partial(write_source, LANGUAGE)
