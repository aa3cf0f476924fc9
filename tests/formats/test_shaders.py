"""Shader source: compiled and run by OpenGL, by the compiler of Slang and by C++, against the models."""

from __future__ import annotations

import functools
import importlib
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError
from brdfdb.formats import glsl, osl, slang
from brdfdb.formats._shader_source import source
from brdfdb.formats._stated_error import Comparison
from brdfdb.models import MODELS
from brdfdb.models.shaders import SHADERS
from tests.formats import opengl, slang_compiler
from tests.formats.small_tables import ALPHA_X, ALPHA_Y, ANISOTROPIC, SPECTRAL, small_table
from tests.formats.test_materialx import pairs

# Single precision against the model, relative to f_r and a hundredth of its mean: worst seen 1.6e-6, up to 88 degrees
RTOL = 5e-6
FLOOR = 1e-2

WARD = {"rho_d": [0.1, 0.2, 0.3], "rho_s": [0.33, 0.2, 0.1], "alpha_x": 0.05, "alpha_y": 0.16}
PAINTED = {"rho_d": [0.1, 0.2, 0.3], "f_0": [0.05, 0.2, 0.9], "alpha_x": 0.2, "alpha_y": 0.4}
METAL = {"alpha_x": 0.2, "alpha_y": 0.4, "n": 0.6, "k": 3.1}
OREN_NAYAR = {"rho": [0.9, 0.5, 0.1], "sigma": 0.6, "interreflection": True}
PARAMETERS: dict[str, dict[str, Any]] = {
    "lambert": {"rho": [0.9, 0.5, 0.1]},
    "minnaert": {"k": 0.7, "rho": [0.9, 0.5, 0.1]},
    "oren_nayar": OREN_NAYAR,
    "oren_nayar_body_surface": {**OREN_NAYAR, "sigma": 0.35, "k_s": 0.05, "k_b": 0.9, "e_0": 2.0},
    "oren_nayar_qualitative": {"rho": [0.9, 0.5, 0.1], "sigma": 0.6, "offset": 0.57},
    "oren_nayar_fujii": {"rho": [0.9, 0.5, 0.1], "sigma": 0.6},
    "oren_nayar_energy_preserving": {"rho": [0.9, 0.5, 0.1], "roughness": 0.8},
    **dict.fromkeys(("ward", "ward_half_vector", "ward_duer", "ward_bounded"), WARD),
    **dict.fromkeys(("ggx_schlick", "beckmann_schlick"), PAINTED),
    **dict.fromkeys(("ggx", "ggx_separable", "beckmann", "beckmann_separable"), METAL),
}


def of_model(model: str, wi: NDArray[np.float64], wr: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return f_r (N, 3) of a model at the directions that single precision has."""
    wi, wr = (w.astype(np.float32).astype(np.float64) for w in (wi, wr))
    channels = []
    for channel in range(3):
        one = {name: np.ravel(value)[channel % np.size(value)] for name, value in PARAMETERS[model].items()}
        channels.append(MODELS[model].vectors(wi, wr, **one))
    return np.stack(channels, axis=-1)


def assert_is_model(model: str, values: NDArray[Any], wi: NDArray[np.float64], wr: NDArray[np.float64]) -> None:
    truth = of_model(model, wi, wr)
    error = np.abs(values - truth) / (truth + FLOOR * truth.mean(axis=0))
    assert error.max() < RTOL, f"{model}: {error.max():.2g} at {wi[error.max(axis=1).argmax()]}"


@pytest.fixture
def machine() -> None:
    pytest.importorskip("OpenGL")
    if reason := opengl.missing():
        pytest.skip(reason)


def test_every_model_with_a_source_is_here() -> None:
    assert sorted(PARAMETERS) == sorted(SHADERS)


@pytest.mark.judge
@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize("model", PARAMETERS)
def test_glsl_is_the_model(model: str) -> None:
    wi, wr = pairs()
    judged = "vec3 judged(vec3 wi, vec3 wr) { return brdf(wi, wr); }\n"
    text = "#version 430\n" + source(model, PARAMETERS[model], glsl.LANGUAGE, "a-b")
    assert_is_model(model, opengl.run(text + judged, wi, wr), wi, wr)


@pytest.mark.judge
@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize("model", PARAMETERS)
def test_slang_is_the_model(model: str) -> None:
    if slang_compiler.folder() is None:
        pytest.skip("slangpy is not installed")
    wi, wr = pairs()
    text = slang_compiler.glsl_of(source(model, PARAMETERS[model], slang.LANGUAGE, "a-b"))
    assert_is_model(model, opengl.run_whole(text, wi, wr), wi, wr)


PRELUDE = """\
#include <cmath>
#include <cstdio>
using std::max; using std::min; using std::abs; using std::sqrt; using std::exp; using std::pow;
namespace osl {
inline float max(double a, double b) { return a > b ? a : b; }
inline float min(double a, double b) { return a < b ? a : b; }
struct color {
    float v[3];
    color(float a, float b, float c) : v{a, b, c} {}
    float operator[](int i) const { return v[i]; }
};
typedef color vector;
inline color max(color a, color b) { return color(max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])); }
#define OPERATOR(O) \\
    inline color operator O(color a, color b) { return color(a[0] O b[0], a[1] O b[1], a[2] O b[2]); } \\
    inline color operator O(float a, color b) { return color(a, a, a) O b; } \\
    inline color operator O(color a, float b) { return a O color(b, b, b); }
OPERATOR(+) OPERATOR(-) OPERATOR(*) OPERATOR(/)
"""
MAIN = """
}
int main()
{
    float w[6];
    while (fread(w, sizeof(float), 6, stdin) == 6) {
        osl::color f = osl::brdf(osl::vector(w[0], w[1], w[2]), osl::vector(w[3], w[4], w[5]));
        fwrite(f.v, sizeof(float), 3, stdout);
    }
}
"""


@pytest.mark.judge
@pytest.mark.parametrize("model", ["ward", "oren_nayar_energy_preserving", "ggx_schlick"])
def test_the_function_of_osl_is_the_model_in_cpp(model: str, tmp_path: Path) -> None:
    """A function of OSL is one of C++ if its two types are given: the values, not the grammar of OSL."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler on PATH")
    function = source(model, PARAMETERS[model], osl.LANGUAGE, "a-b").partition("\nshader ")[0]
    code, program = tmp_path / "osl.cpp", tmp_path / "osl"
    code.write_text(PRELUDE + function + MAIN, encoding="utf-8")
    subprocess.run([compiler, "-o", str(program), str(code)], check=True)
    wi, wr = pairs()
    given = np.concatenate([wi, wr], axis=1).astype(np.float32).tobytes()
    answer = subprocess.run([str(program)], input=given, check=True, capture_output=True).stdout
    assert_is_model(model, np.frombuffer(answer, dtype=np.float32).reshape(-1, 3), wi, wr)


@pytest.mark.judge
@pytest.mark.parametrize("model", PARAMETERS)
def test_compilers_take_the_source(model: str, tmp_path: Path) -> None:
    compilers = {"glslangValidator": glsl, "oslc": osl}
    there = {name: module for name, module in compilers.items() if shutil.which(name)}
    if not there:
        pytest.skip("neither glslangValidator nor oslc on PATH")
    for name, module in there.items():
        text = source(model, PARAMETERS[model], module.LANGUAGE, "a-b")
        path = tmp_path / f"a{module.suffix}"
        if module is glsl:
            path = tmp_path / "a.frag"
            text = f"#version 330\n{text}in vec3 a; out vec3 b; void main() {{ b = brdf(a, a); }}\n"
        path.write_text(text, encoding="utf-8")
        subprocess.run([name, str(path)], check=True, cwd=tmp_path, capture_output=True)


@pytest.mark.parametrize("name", ["glsl", "slang", "osl"])
def test_a_file_has_its_record_and_the_error_of_the_model(name: str, tmp_path: Path) -> None:
    module = importlib.import_module(f"brdfdb.formats.{name}")
    table = small_table(ANISOTROPIC)
    path = tmp_path / f"brass{module.suffix}"
    written = module.write(table, path, verdict="ok")
    text = path.read_text(encoding="ascii")
    assert "// audit: ok\n" in text
    assert f'"p99": {written.error.document()["p99"]}' in text
    assert f"#define P_ALPHA_X {ALPHA_X}\n" in text
    ward = functools.partial(MODELS["ward"].vectors, rho_d=0.1, rho_s=0.33, alpha_x=ALPHA_X, alpha_y=ALPHA_Y)
    assert Comparison(table).error_of(lambda wi, wr: ward(wi, wr)[:, np.newaxis]) == written.error


def test_what_has_no_closed_form_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CannotHoldError, match="copper: the model he_torrance has no closed form in"):
        glsl.write(small_table(SPECTRAL), tmp_path / "a.glsl")
    assert not list(tmp_path.iterdir())
