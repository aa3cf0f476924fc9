"""MaterialX documents: judged by MaterialX itself, and its shaders, which OpenGL runs, against what the files state."""

from __future__ import annotations

import importlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb import formats
from brdfdb.formats import materialx
from brdfdb.formats._channels import channels_of
from brdfdb.formats.materialx._fit import fitted, of_alphas
from brdfdb.formats.materialx._surface import OPEN_PBR, STANDARD, darkest_edge
from brdfdb.formats.materialx._surface import MaterialXSurface as Surface
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import FunctionSource, Material
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import block
from tests.formats import opengl
from tests.formats.a_file import check_texts_refused, exported
from tests.formats.round_trip import round_trip
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, KINDS, SMOOTH, SPECTRAL, small_table

# f_r of the shader, in single precision, against the reader, relative to f_r: worst seen 6e-5
SHADER_RTOL = 2e-4
# l1 of the closest surface, the larger of the two kinds: 0.087, 0.26, 0.043, 0.50 and 0.070
MOST_L1 = {GREY: 0.1, ANISOTROPIC: 0.3, DIFFUSE: 0.05, SPECTRAL: 0.55, SMOOTH: 0.08}

SURFACES = {
    "painted": Surface(OPEN_PBR, (0.6, 0.3, 0.1), (1.0, 0.8, 0.9), 0.9, 0.7, 0.0, 0.8, 0.5, 1.7, 0.3),
    "metal": Surface(OPEN_PBR, (0.9, 0.5, 0.2), (0.8, 0.2, 1.0), 1.0, 0.0, 1.0, 0.6, 0.4, 1.5, 0.0),
    "mixed": Surface(OPEN_PBR, (0.4, 0.4, 0.4), (0.1, 0.1, 0.1), 1.0, 0.2, 0.57, 0.99, 0.3, 5.4, 0.66, True),
    "diffuse": Surface(OPEN_PBR, (0.8,), (1.0,), 1.0, 1.0, 0.0, 0.0, 1.0),
    "standard painted": Surface(STANDARD, (0.6, 0.3, 0.1), (1.0, 0.8, 0.9), 0.9, 0.7, 0.0, 0.8, 0.5, 1.7, 0.3),
    "standard metal": Surface(STANDARD, (0.9, 0.5, 0.2), (0.8, 0.2, 1.0), 1.0, 0.0, 1.0, 1.0, 0.4, 1.5, 0.0),
    "standard mixed": Surface(STANDARD, (0.4, 0.4, 0.4), (0.1, 0.1, 0.1), 1.0, 0.2, 0.57, 0.99, 0.3, 5.4, 0.66, True),
}


def validated(path: Path) -> tuple[Any, Any]:
    """Return a document with the libraries of MaterialX, which it says is valid, and the libraries."""
    mx = pytest.importorskip("MaterialX")
    document, library = mx.createDocument(), mx.createDocument()
    mx.readFromXmlFile(document, str(path))
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    document.setDataLibrary(library)
    valid, message = document.validate()
    assert valid, message
    return document, library


def generator_of(language: str) -> tuple[Any, Any]:
    """Return the generator of a language, and its context."""
    generator = getattr(importlib.import_module(f"MaterialX.PyMaterialXGen{language}"), f"{language}ShaderGenerator")
    generator = generator.create()
    context = importlib.import_module("MaterialX.PyMaterialXGenShader").GenContext(generator)
    context.registerSourceCodeSearchPath(importlib.import_module("MaterialX").getDefaultDataSearchPath())
    return generator, context


def pixel_shader(path: Path) -> str:
    """Return the pixel shader that MaterialX generates for a document, lit by one light."""
    document, library = validated(path)
    shaders = importlib.import_module("MaterialX.PyMaterialXGenShader")
    generator, context = generator_of("Glsl")
    options = context.getOptions()
    options.hwSpecularEnvironmentMethod = shaders.HwSpecularEnvironmentMethod.SPECULAR_ENVIRONMENT_NONE
    options.hwMaxActiveLightSources = 1
    options.shaderInterfaceType = shaders.ShaderInterfaceType.SHADER_INTERFACE_REDUCED
    shaders.HwShaderGenerator.bindLightShader(library.getNodeDef("ND_directional_light"), 1, context)
    return str(generator.generate("surface", document.getMaterialNodes()[0], context).getSourceCode("pixel"))


def run_pixel_shader(source: str, wi: NDArray[np.float64], wr: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return f_r (N, 3) of a pixel shader, whose inputs become variables of a compute shader.

    Compute shaders have no `fwidth`, which is for subsurface. Without an environment MaterialX 1.39 forgets the other.
    """
    for pattern, replacement in (
        (r"#version 400", "#version 430\n#define fwidth(x) (x)\nconst bool u_refractionTwoSided = false;"),
        (r"uniform vec3 u_viewPosition = .*;", "vec3 u_viewPosition;"),
        (r"uniform int u_numActiveLightSources = 0;", "const int u_numActiveLightSources = 1;"),
        (r"uniform LightData", "LightData"),
        (r"in VertexData(\s*\{[^}]*\}) vd;", r"struct VertexData\1; VertexData vd;"),
        (r"out vec4 out1;", "vec4 out1;"),
        (r"void main\(\)", "void shade()"),
    ):
        source, count = re.subn(pattern, replacement, source, count=1)
        assert count == 1, pattern
    judged = """
    vec3 judged(vec3 wi, vec3 wr)
    {
        vd.normalWorld = vec3(0.0, 0.0, 1.0); vd.tangentWorld = vec3(1.0, 0.0, 0.0); vd.positionWorld = vec3(0.0);
        u_viewPosition = wr;
        u_lightData[0].type = 1; u_lightData[0].direction = -wi;
        u_lightData[0].color = vec3(1.0); u_lightData[0].intensity = 1.0;
        shade();
        return out1.rgb / wi.z;
    }
    """
    return opengl.run(source + judged, wi, wr).astype(np.float64)


def pairs(count: int = 4096) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unit vectors of light and viewer up to 88 degrees, half of the viewers near the mirror direction."""
    rng = np.random.default_rng(7)
    theta, phi = radians(rng.uniform(0.0, 88.0, (2, count))), rng.uniform(0.0, 2.0 * np.pi, (2, count))
    near = np.arange(count) % 2 == 0
    theta[1] = np.where(near, np.minimum(theta[0] * rng.uniform(0.9, 1.1, count), radians(88.0)), theta[1])
    phi[1] = np.where(near, phi[0] + np.pi + rng.normal(0.0, 0.1, count), phi[1])
    return unit_vector(theta[0], phi[0]), unit_vector(theta[1], phi[1])


@pytest.mark.judge
@pytest.mark.parametrize("name", SURFACES)
def test_the_reader_sees_what_the_shader_of_materialx_computes(name: str, tmp_path: Path) -> None:
    pytest.importorskip("MaterialX")
    pytest.importorskip("OpenGL")
    if reason := opengl.missing():
        pytest.skip(reason)
    path = tmp_path / "a.mtlx"
    path.write_text(materialx._document("a-surface", SURFACES[name], ""), encoding="utf-8")
    wi, wr = pairs()
    seen = formats.read(path).lookup_vectors(wi, wr).reshape(len(wi), -1)
    shaded = run_pixel_shader(pixel_shader(path), wi, wr)
    np.testing.assert_allclose(np.broadcast_to(seen, shaded.shape), shaded, rtol=SHADER_RTOL)


@pytest.mark.parametrize("kind", materialx.kinds)
@pytest.mark.parametrize("name", KINDS)
def test_the_closest_surface_is_as_near_as_was_measured(name: str, kind: str, tmp_path: Path) -> None:
    trip = round_trip(small_table(name), tmp_path, "materialx", kind=kind)
    assert trip.measured == pytest.approx(trip.stated, rel=1e-9)
    assert trip.reading.record["error_of_file"]["l1"] < MOST_L1[name]
    assert ("its facets mirror" in " ".join(trip.reading.record["remarks"])) == (name == SMOOTH)


@pytest.mark.judge
@pytest.mark.parametrize("kind", materialx.kinds)
@pytest.mark.parametrize("name", KINDS)
def test_materialx_says_that_a_document_is_valid(name: str, kind: str, tmp_path: Path) -> None:
    materialx.write(small_table(name), tmp_path / "a.mtlx", kind=kind)
    document, _ = validated(tmp_path / "a.mtlx")
    assert document.getMaterialNodes()


@pytest.mark.judge
def test_every_language_of_materialx_takes_a_document(tmp_path: Path) -> None:
    path = tmp_path / "a.mtlx"
    path.write_text(materialx._document("a", SURFACES["mixed"], ""), encoding="utf-8")
    document, _ = validated(path)
    for language in ("Osl", "Mdl"):
        generator, context = generator_of(language)
        shader = generator.generate("a", document.getMaterialNodes()[0], context)
        assert "0.66" in shader.getSourceCode("pixel")


@pytest.mark.parametrize("kind", materialx.kinds)
def test_widths_of_slopes_become_roughness_anisotropy_and_a_turn(kind: str) -> None:
    for alpha_x, alpha_y in ((0.05, 0.16), (0.16, 0.05), (0.2, 0.2)):
        facets = of_alphas(kind, alpha_x, alpha_y)
        surface = Surface(kind, (0.5,), **facets)
        wide_first = (alpha_x, alpha_y) if not surface.quarter_turn else (alpha_y, alpha_x)
        np.testing.assert_allclose(surface.alphas, wide_first, rtol=1e-12)
    assert of_alphas(OPEN_PBR, 0.04, 0.04) == {
        "specular_roughness": pytest.approx(0.2),
        "specular_anisotropy": 0.0,
        "quarter_turn": False,
    }


def test_a_highlight_is_wider_across_the_grain(tmp_path: Path) -> None:
    """Ward's alphas are 0.15 along x and 0.3 along y: the highlight is wider towards y."""
    reading = formats.read(exported(tmp_path, "materialx", ANISOTROPIC))
    slope = radians(20.0)
    towards_x, towards_y = (
        float(reading.lookup_vectors(unit_vector(slope, phi), unit_vector(slope, phi))) for phi in (0.0, np.pi / 2)
    )
    assert towards_y > 2.0 * towards_x


@pytest.mark.parametrize("kind", materialx.kinds)
def test_a_black_surface_is_black(kind: str, tmp_path: Path) -> None:
    black = FunctionSource(brdf=lambda wi, _wr, _: np.zeros(len(wi)), name="black", title="Black", provenance="made up")
    axes = {"theta_i": [0.0, 45.0, 90.0], "theta_r": [0.0, 45.0, 90.0], "delta_phi": [0.0, 180.0]}
    layout = Layout(black, Grid(axes))
    table = Table.of(layout, np.concatenate([block(layout, rows) for rows in layout.blocks]))
    written = formats.write(table, tmp_path / "black.mtlx", "materialx", kind=kind)
    assert written.error is not None
    assert written.error.largest == 0.0
    assert not np.any(formats.read(written.paths[0]).lookup_vectors(*pairs()))


@pytest.mark.parametrize("normal", [0.0, 0.05, 0.3, 0.9])
def test_the_darkest_edge_is_the_least_that_is_nowhere_negative(normal: float) -> None:
    def metal(edge: float) -> float:
        surface = Surface(OPEN_PBR, (normal,), (edge,), base_metalness=1.0, specular_roughness=1.0)
        return float(surface.brdf(*pairs(1 << 16)).min())

    edge = float(darkest_edge(np.array([normal]))[0])
    assert metal(edge) >= 0.0
    assert edge < 2e-4 or metal(edge - 0.01) < 0.0


def test_a_narrow_lobe_does_not_become_negative() -> None:
    ward = {"rho_d": 0.0, "rho_s": 0.02, "alpha_x": 0.01, "alpha_y": 0.01}
    source = Material.from_table("w", {"title": "w", "model": "ward", "source": "no paper", "parameters": ward})
    layout = plan(source, None, 0.05)
    table = Table.of(layout, np.concatenate([block(layout, rows) for rows in layout.blocks]))
    table = replace(table, attrs={**table.attrs, "source_record": source.document()})
    surface = fitted(OPEN_PBR, table, channels_of(table, "grey"))
    wi, _ = pairs()
    near = wi * [-1.0, -1.0, 1.0] + np.random.default_rng(2).normal(0.0, 0.02, wi.shape)  # at the mirror direction
    near[:, 2] = np.abs(near[:, 2])
    assert surface.brdf(wi, near / np.linalg.norm(near, axis=1, keepdims=True)).min() >= 0.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("no xml", "not XML"),
        ("<materialx/>", "has no node open_pbr_surface or standard_surface"),
        ('<materialx><open_pbr_surface><input name="coat_weight" value="1"/></open_pbr_surface></materialx>', "coat"),
        ('<materialx><standard_surface><input name="base" value="nan"/></standard_surface></materialx>', "input base"),
        ('<materialx><standard_surface><input name="specular_IOR" value="-1"/></standard_surface></materialx>', "_IOR"),
        ('<materialx><standard_surface><input name="base_color" value="1,2"/></standard_surface></materialx>', "'1,2'"),
    ],
)
def test_a_document_that_is_not_read_is_named(text: str, words: str, tmp_path: Path) -> None:
    check_texts_refused(tmp_path / "b.mtlx", {text: words}, "materialx")
