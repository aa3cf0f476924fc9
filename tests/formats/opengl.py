"""Shaders run by the OpenGL of this machine, without a window: the judge of GLSL, or None where there is none."""

from __future__ import annotations

import ctypes
import functools
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

_PAIRS = """
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Lights { float wi_of[]; };
layout(std430, binding = 1) readonly buffer Viewers { float wr_of[]; };
layout(std430, binding = 2) writeonly buffer Values { float f_of[]; };
void main()
{
    uint i = 3u * gl_GlobalInvocationID.x;
    if (i >= uint(wi_of.length())) return;
    vec3 f = judged(vec3(wi_of[i], wi_of[i + 1u], wi_of[i + 2u]), vec3(wr_of[i], wr_of[i + 1u], wr_of[i + 2u]));
    f_of[i] = f.x; f_of[i + 1u] = f.y; f_of[i + 2u] = f.z;
}
"""


def missing() -> str:
    """Return why no shader can be run; empty if one can."""
    try:
        _gl()
    except Exception as error:  # whatever the driver raises
        return f"no OpenGL 4.3 without a window: {type(error).__name__} {error}"
    return ""


@functools.cache
def _gl() -> Any:
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    os.environ.setdefault("EGL_PLATFORM", "surfaceless")
    import OpenGL

    OpenGL.ERROR_LOGGING = False
    from OpenGL import EGL, GL

    display = EGL.eglGetDisplay(EGL.EGL_DEFAULT_DISPLAY)
    EGL.eglInitialize(display, ctypes.c_long(), ctypes.c_long())
    EGL.eglBindAPI(EGL.EGL_OPENGL_API)
    configs, count = (EGL.EGLConfig * 1)(), ctypes.c_long()
    EGL.eglChooseConfig(display, [EGL.EGL_RENDERABLE_TYPE, EGL.EGL_OPENGL_BIT, EGL.EGL_NONE], configs, 1, count)
    version = [0x3098, 4, 0x30FB, 3, EGL.EGL_NONE]  # major, minor
    context = EGL.eglCreateContext(display, configs[0], EGL.EGL_NO_CONTEXT, version)
    EGL.eglMakeCurrent(display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, context)
    return GL


def run(source: str, wi: NDArray[np.float64], wr: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the values (N, 3) of ``vec3 judged(vec3 wi, vec3 wr)`` of a source at unit vectors (N, 3)."""
    return run_whole(source + _PAIRS, wi, wr)


def run_whole(source: str, wi: NDArray[np.float64], wr: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return what a compute shader writes to buffer 2, (N, 3), from lights and viewers in the buffers 0 and 1."""
    GL = _gl()
    shader = GL.glCreateShader(GL.GL_COMPUTE_SHADER)
    GL.glShaderSource(shader, source)
    GL.glCompileShader(shader)
    assert GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS), GL.glGetShaderInfoLog(shader)
    program = GL.glCreateProgram()
    GL.glAttachShader(program, shader)
    GL.glLinkProgram(program)
    assert GL.glGetProgramiv(program, GL.GL_LINK_STATUS), GL.glGetProgramInfoLog(program)
    GL.glUseProgram(program)
    given = [np.ascontiguousarray(w, dtype=np.float32) for w in (wi, wr, np.zeros_like(wi))]
    buffers = GL.glGenBuffers(3)
    for place, (buffer, values) in enumerate(zip(buffers, given, strict=True)):
        GL.glBindBuffer(GL.GL_SHADER_STORAGE_BUFFER, buffer)
        GL.glBufferData(GL.GL_SHADER_STORAGE_BUFFER, values.nbytes, values, GL.GL_STATIC_DRAW)
        GL.glBindBufferBase(GL.GL_SHADER_STORAGE_BUFFER, place, buffer)
    GL.glDispatchCompute(-(-len(wi) // 64), 1, 1)
    GL.glMemoryBarrier(GL.GL_ALL_BARRIER_BITS)
    raw = GL.glGetBufferSubData(GL.GL_SHADER_STORAGE_BUFFER, 0, given[2].nbytes)
    GL.glDeleteBuffers(3, buffers)
    GL.glDeleteProgram(program)
    return np.frombuffer(bytes(raw), dtype=np.float32).reshape(-1, 3)
