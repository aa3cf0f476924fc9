"""Closed-form models as shader source: statements that GLSL, Slang and OSL have in common; Radiance's own Ward.

`$color` stands for the type of a colour. Parameters are macros, named as in the models, in capitals after `P_`.
Reflectances are colours. Directions are arrays of three numbers. The statements are those of a function of `wi` and
`wr` with the cosines `cos_i` and `cos_r`, both positive. The formulas are those of `brdfdb.models`, which has the
equations and their sources.
"""

from __future__ import annotations

from typing import NamedTuple


class ShaderModel(NamedTuple):
    """The source of one model: functions that it calls, by name, and the statements of f_r [1/sr]."""

    functions: tuple[str, ...]
    statements: str


# Models without a closed form, and a closed form of the same paper with parameters that it is given
FITS: dict[str, tuple[str, dict[str, bool]]] = {"oren_nayar_gaussian": ("oren_nayar", {"interreflection": True})}

# Abramowitz and Stegun 1964, 4.4.46 and 7.1.26: within 2e-8 and 1.5e-7
FUNCTIONS = {
    "brdf_angle": """\
// polar angle [rad] of a unit vector, from its sine and its cosine
float brdf_angle(float s, float c)
{
    float x = max(c, 0.0);
    float p = -0.0012624911 * x + 0.0066700901;
    p = p * x - 0.0170881256;
    p = p * x + 0.0308918810;
    p = p * x - 0.0501743046;
    p = p * x + 0.0889789874;
    p = p * x - 0.2145988016;
    p = p * x + 1.5707963050;
    return s / sqrt(1.0 + x) * p;
}
""",
    "brdf_erfcx": """\
// exp(x^2) erfc(x) for x >= 0
float brdf_erfcx(float x)
{
    float t = 1.0 / (1.0 + 0.3275911 * x);
    return t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
}
""",
    "brdf_oren_nayar": """\
// Oren and Nayar 1994, eqs 27 to 29
$color brdf_oren_nayar($vector wi, $vector wr, $color rho, float sigma, float interreflection)
{
    float cos_i = wi[2];
    float cos_r = wr[2];
    float sin_i = sqrt(wi[0] * wi[0] + wi[1] * wi[1]);
    float sin_r = sqrt(wr[0] * wr[0] + wr[1] * wr[1]);
    float sin_a = max(sin_i, sin_r);
    float cos_a = min(cos_i, cos_r);
    float sin_b = min(sin_i, sin_r);
    float cos_b = max(cos_i, cos_r);
    float angle_a = brdf_angle(sin_a, cos_a);
    float angle_b = brdf_angle(sin_b, cos_b);
    float product = max(sin_i * sin_r, 1e-30);
    float cos_dphi = (wi[0] * wr[0] + wi[1] * wr[1]) / product;
    float sin_dphi = (wi[0] * wr[1] - wi[1] * wr[0]) / product;
    float s2 = sigma * sigma;
    float ratio = s2 / (s2 + 0.09);
    float b = 2.0 / BRDF_PI * angle_b;
    float rest = 2.0 / BRDF_PI * brdf_angle(cos_b, sin_b);
    float c_1 = 1.0 - 0.5 * s2 / (s2 + 0.33);
    float backward = 0.45 * ratio * sin_a;
    float forward = 0.45 * ratio * (rest * (3.0 - rest * (3.0 - rest)) - cos_a * cos_a / (1.0 + sin_a));
    float both = 4.0 / (BRDF_PI * BRDF_PI) * angle_a * angle_b;
    float c_3 = 0.125 * ratio * both * both;
    float c_2 = (cos_dphi >= 0.0 ? backward : forward) * sin_b / cos_b;
    float mean = (sin_i + sin_r) / (cos_i + cos_r);
    float single = c_1 + c_2 * cos_dphi + c_3 * mean * sin_dphi * sin_dphi / (1.0 + abs(cos_dphi));
    float twice = interreflection * 0.17 * s2 / (s2 + 0.13) * (1.0 - b * b * cos_dphi);
    return max(rho / BRDF_PI * (single + twice * rho), $color(0.0, 0.0, 0.0));
}
""",
    "brdf_torrance_sparrow": """\
// Oren and Nayar 1994, eq. 31
float brdf_torrance_sparrow($vector wi, $vector wr, float sigma)
{
    float cos_i = wi[2];
    float cos_r = wr[2];
    float h_x = wi[0] + wr[0];
    float h_y = wi[1] + wr[1];
    float h_z = cos_i + cos_r;
    float h_xy = sqrt(h_x * h_x + h_y * h_y);
    float size = sqrt(h_xy * h_xy + h_z * h_z);
    float cos_a = h_z / size;
    float x = brdf_angle(h_xy / size, cos_a) / max(sigma, 1e-6);
    float shadow = min(1.0, 4.0 * min(cos_i, cos_r) * cos_a / size);
    return shadow / (cos_i * cos_r * cos_a) * exp(-0.5 * x * x);
}
""",
    "brdf_lost": """\
// share of the light that Fujii's lobe loses, over A r
float brdf_lost($vector w)
{
    float c = w[2];
    float s = sqrt(w[0] * w[0] + w[1] * w[1]);
    float rest = 0.5 * BRDF_PI - brdf_angle(s, c);
    float chord = 2.0 / 3.0 * s * c * (1.0 + s + s * s) / (1.0 + s);
    return ((0.5 * BRDF_PI - 2.0 / 3.0) * c * c / (1.0 + s) + s * (rest + s * c) - chord) / BRDF_PI;
}
""",
    "brdf_fresnel": """\
// reflectance of unpolarised light at a facet of the index n + ik
float brdf_fresnel(float c, float n, float k)
{
    float c2 = min(c * c, 1.0);
    float s2 = 1.0 - c2;
    float t0 = n * n - k * k - s2;
    float ab = sqrt(t0 * t0 + 4.0 * n * n * k * k);
    float a = sqrt(max(0.5 * (ab + t0), 0.0));
    float r_s = (ab + c2 - 2.0 * a * c) / (ab + c2 + 2.0 * a * c);
    float r_p = r_s * (c2 * ab + s2 * s2 - 2.0 * a * c * s2) / (c2 * ab + s2 * s2 + 2.0 * a * c * s2);
    return 0.5 * (r_s + r_p);
}
""",
}

_HALF = """\
float h_x = wi[0] + wr[0];
float h_y = wi[1] + wr[1];
float h_z = cos_i + cos_r;
float u_x = h_x / P_ALPHA_X;
float u_y = h_y / P_ALPHA_Y;
float s2 = u_x * u_x + u_y * u_y;
"""
_WARD = _HALF + "float peak = 1.0 / (4.0 * BRDF_PI * P_ALPHA_X * P_ALPHA_Y);\n"
_WARD_SUM = "return P_RHO_D / BRDF_PI + P_RHO_S * (peak * lobe);\n"

# G / (4 cos_i cos_r) of facets, then D, then the reflectance of a facet
_FACETS = (
    _HALF
    + """\
float i_x = wi[0] * P_ALPHA_X;
float i_y = wi[1] * P_ALPHA_Y;
float r_x = wr[0] * P_ALPHA_X;
float r_y = wr[1] * P_ALPHA_Y;
float size2 = h_x * h_x + h_y * h_y + h_z * h_z;
float u = min(0.5 * sqrt(size2), 1.0);
"""
)
_SMITH = {
    "ggx": """\
float reach_i = sqrt(cos_i * cos_i + i_x * i_x + i_y * i_y);
float reach_r = sqrt(cos_r * cos_r + r_x * r_x + r_y * r_y);
float shadow = 0.5 / (cos_r * reach_i + cos_i * reach_r);
""",
    "ggx_separable": """\
float reach_i = cos_i + sqrt(cos_i * cos_i + i_x * i_x + i_y * i_y);
float reach_r = cos_r + sqrt(cos_r * cos_r + r_x * r_x + r_y * r_y);
float shadow = 1.0 / (reach_i * reach_r);
""",
    "beckmann": """\
float t_i = sqrt(i_x * i_x + i_y * i_y) + 1e-30;
float t_r = sqrt(r_x * r_x + r_y * r_y) + 1e-30;
float a_i = min(cos_i / t_i, 9.0);
float a_r = min(cos_r / t_r, 9.0);
float reach_i = 0.5 * exp(-a_i * a_i) * (t_i / sqrt(BRDF_PI) - cos_i * brdf_erfcx(a_i));
float reach_r = 0.5 * exp(-a_r * a_r) * (t_r / sqrt(BRDF_PI) - cos_r * brdf_erfcx(a_r));
float shadow = 0.25 / (cos_i * cos_r + cos_r * reach_i + cos_i * reach_r);
""",
    "beckmann_separable": """\
float t_i = sqrt(i_x * i_x + i_y * i_y) + 1e-30;
float t_r = sqrt(r_x * r_x + r_y * r_y) + 1e-30;
float a_i = min(cos_i / t_i, 9.0);
float a_r = min(cos_r / t_r, 9.0);
float reach_i = a_i >= 1.6 ? cos_i : t_i * (1.0 + a_i * (2.276 + a_i * 2.577)) / (3.535 + a_i * 2.181);
float reach_r = a_r >= 1.6 ? cos_r : t_r * (1.0 + a_r * (2.276 + a_r * 2.577)) / (3.535 + a_r * 2.181);
float shadow = 0.25 / (reach_i * reach_r);
""",
}
_SLOPES = {
    "ggx": "float q = size2 / (h_z * h_z + s2);\n",
    "beckmann": "float q = size2 / (h_z * h_z) * exp(-0.5 * s2 / (h_z * h_z));\n",
}
_LOBE = "float lobe = q * q * shadow / (BRDF_PI * P_ALPHA_X * P_ALPHA_Y);\n"
_SCHLICK = """\
float d_x = wi[0] - wr[0];
float d_y = wi[1] - wr[1];
float d_z = cos_i - cos_r;
float m = 0.25 * (d_x * d_x + d_y * d_y + d_z * d_z) / (1.0 + u);
$color facet = P_F_0 + (1.0 - P_F_0) * (m * m * m * m * m);
return P_RHO_D / BRDF_PI + lobe * facet;
"""
_EXACT = """\
float f_r = lobe * brdf_fresnel(u, P_N, P_K);
return $color(f_r, f_r, f_r);
"""


def _facets(smith: str, reflectance: str) -> ShaderModel:
    slopes = smith.removesuffix("_separable")
    functions = (
        *(("brdf_erfcx",) if smith == "beckmann" else ()),
        *(("brdf_fresnel",) if reflectance == _EXACT else ()),
    )
    return ShaderModel(functions, _FACETS + _SMITH[smith] + _SLOPES[slopes] + _LOBE + reflectance)


SHADERS = {
    "lambert": ShaderModel((), "return P_RHO / BRDF_PI;\n"),
    "minnaert": ShaderModel((), "return P_RHO * ((P_K + 1.0) / (2.0 * BRDF_PI) * pow(cos_i * cos_r, P_K - 1.0));\n"),
    "oren_nayar": ShaderModel(
        ("brdf_angle", "brdf_oren_nayar"), "return brdf_oren_nayar(wi, wr, P_RHO, P_SIGMA, P_INTERREFLECTION);\n"
    ),
    "oren_nayar_body_surface": ShaderModel(
        ("brdf_angle", "brdf_oren_nayar", "brdf_torrance_sparrow"),
        "return P_K_B * brdf_oren_nayar(wi, wr, P_RHO, P_SIGMA, P_INTERREFLECTION)\n"
        "    + P_K_S * (brdf_torrance_sparrow(wi, wr, P_SIGMA) / P_E_0);\n",
    ),
    "oren_nayar_qualitative": ShaderModel(
        (),
        """\
float s2 = P_SIGMA * P_SIGMA;
float a = s2 > 0.0 ? 1.0 - 0.5 * s2 / (s2 + P_OFFSET) : 1.0;
float along = max(wi[0] * wr[0] + wi[1] * wr[1], 0.0) / max(cos_i, cos_r);
return P_RHO * ((a + 0.45 * s2 / (s2 + 0.09) * along) / BRDF_PI);
""",
    ),
    "oren_nayar_fujii": ShaderModel(
        (),
        """\
float s = wi[0] * wr[0] + wi[1] * wr[1];
float t = s > 0.0 ? max(cos_i, cos_r) : 1.0;
float a = 1.0 / (BRDF_PI + (0.5 * BRDF_PI - 2.0 / 3.0) * P_SIGMA);
return P_RHO * max(a * (1.0 + P_SIGMA * s / t), 0.0);
""",
    ),
    "oren_nayar_energy_preserving": ShaderModel(
        ("brdf_angle", "brdf_lost"),
        """\
float c_1 = 0.5 - 2.0 / (3.0 * BRDF_PI);
float c_2 = 2.0 / 3.0 - 28.0 / (15.0 * BRDF_PI);
float a = 1.0 / (1.0 + c_1 * P_ROUGHNESS);
float s = wi[0] * wr[0] + wi[1] * wr[1];
float t = s > 0.0 ? max(cos_i, cos_r) : 1.0;
float single = a * max(1.0 + P_ROUGHNESS * s / t, 0.0);
float lost = a * P_ROUGHNESS * (c_1 - c_2);
float multiple = a * P_ROUGHNESS / (c_1 - c_2) * brdf_lost(wi) * brdf_lost(wr);
return P_RHO / BRDF_PI * (single + multiple * (1.0 - lost) * P_RHO / (1.0 - lost * P_RHO));
""",
    ),
    "ward": ShaderModel((), _WARD + "float lobe = exp(-s2 / (h_z * h_z)) / sqrt(cos_i * cos_r);\n" + _WARD_SUM),
    "ward_half_vector": ShaderModel(
        (),
        _WARD
        + "float size = sqrt(h_x * h_x + h_y * h_y + h_z * h_z);\n"
        + "float lobe = exp(-2.0 * s2 / (size * (size + h_z))) / sqrt(cos_i * cos_r);\n"
        + _WARD_SUM,
    ),
    "ward_duer": ShaderModel((), _WARD + "float lobe = exp(-s2 / (h_z * h_z)) / (cos_i * cos_r);\n" + _WARD_SUM),
    "ward_bounded": ShaderModel(
        (),
        _WARD
        + "float q = 1.0 / (h_z * h_z);\n"
        + "float lobe = 4.0 * exp(-s2 * q) * (h_x * h_x + h_y * h_y + h_z * h_z) * q * q;\n"
        + _WARD_SUM,
    ),
    "ggx": _facets("ggx", _EXACT),
    "ggx_separable": _facets("ggx_separable", _EXACT),
    "ggx_schlick": _facets("ggx", _SCHLICK),
    "beckmann": _facets("beckmann", _EXACT),
    "beckmann_separable": _facets("beckmann_separable", _EXACT),
    "beckmann_schlick": _facets("beckmann", _SCHLICK),
}

# How the lobes of Ward's models differ from `ward_bounded`, which is what Radiance evaluates as plastic2 and metal2
OF_RADIANCE = {
    "ward": (
        "Ward 1992, eq. (5a), has 1 / (4 sqrt(cos theta_i cos theta_r)) where Radiance has |h|^2 / (h.n)^4 with h the",
        "sum of the unit vectors of light and viewer. The exponent is the same. In the mirror direction Radiance is",
        "higher by 1 / cos theta: equal at normal incidence, 1.15 times at 30 degrees, 2 times at 60 degrees.",
        "The lobe of Ward loses about 1 - cos theta of rho_s towards grazing; that of Radiance keeps it.",
    ),
    "ward_half_vector": (
        "Ward 1992, eq. (5b), differs from Radiance in the factor 1 / (4 sqrt(cos theta_i cos theta_r)), which is",
        "|h|^2 / (h.n)^4 there, and in the exponent: it falls off with sin(delta / 2), Radiance with tan(delta).",
        "In the mirror direction Radiance is higher by 1 / cos theta.",
    ),
    "ward_duer": (
        "Duer 2006 has 1 / (4 cos theta_i cos theta_r) where Radiance has |h|^2 / (h.n)^4 with h the sum of the unit",
        "vectors of light and viewer. The exponent is the same. They are equal in the mirror direction. Duer's albedo",
        "exceeds 1 near grazing, that of Radiance does not.",
    ),
    "ward_bounded": ("This model is what Radiance evaluates; they are equal but for a widening by flat sources.",),
}
