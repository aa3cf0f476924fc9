"""The compiler of Slang, from the package slangpy: the judge of Slang source, by way of GLSL."""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import os
from pathlib import Path
from typing import Any

_GLSL, _SLANG, _COMPUTE = 2, 1, 6  # a target, a language and a stage in the interface of the compiler

_PAIRS = """
[shader("compute")] [numthreads(64, 1, 1)]
void judge(
    uint3 id : SV_DispatchThreadID,
    uniform StructuredBuffer<float> wi_of,
    uniform StructuredBuffer<float> wr_of,
    uniform RWStructuredBuffer<float> f_of)
{
    uint i = 3 * id.x;
    float3 f = brdf(float3(wi_of[i], wi_of[i + 1], wi_of[i + 2]), float3(wr_of[i], wr_of[i + 1], wr_of[i + 2]));
    f_of[i] = f.x; f_of[i + 1] = f.y; f_of[i + 2] = f.z;
}
"""


def folder() -> Path | None:
    """Return the folder of slangpy: of this environment, or below $BRDFDB_SLANG; None where it is missing."""
    if root := os.environ.get("BRDFDB_SLANG"):
        return Path(root) / "slangpy"
    spec = importlib.util.find_spec("slangpy")
    return None if spec is None or spec.origin is None else Path(spec.origin).parent


@functools.cache
def _library() -> Any:
    package = folder()
    assert package is not None
    library = ctypes.CDLL(str(next(package.glob("libslang-compiler.so*"))))
    for name in ("spCreateSession", "spCreateCompileRequest"):
        getattr(library, name).restype = ctypes.c_void_p
    for name in ("spGetDiagnosticOutput", "spGetEntryPointSource"):
        getattr(library, name).restype = ctypes.c_char_p
    return library, ctypes.c_void_p(library.spCreateSession(None))


def glsl_of(source: str) -> str:
    """Return the compute shader in GLSL for the function `brdf` of a source in Slang, for `opengl.run_whole`."""
    library, session = _library()
    request = ctypes.c_void_p(library.spCreateCompileRequest(session))
    target = library.spAddCodeGenTarget(request, _GLSL)
    library.spSetTargetProfile(request, target, library.spFindProfile(session, b"glsl_450"))
    unit = library.spAddTranslationUnit(request, _SLANG, b"brdf")
    library.spAddTranslationUnitSourceString(request, unit, b"brdf.slang", (source + _PAIRS).encode())
    entry = library.spAddEntryPoint(request, unit, b"judge", _COMPUTE)
    failed = library.spCompile(request)
    assert not failed, library.spGetDiagnosticOutput(request).decode()
    text = library.spGetEntryPointSource(request, entry).decode()
    library.spDestroyCompileRequest(request)
    return str(text)
