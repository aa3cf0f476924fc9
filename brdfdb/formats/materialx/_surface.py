"""The closures of MaterialX as its GLSL evaluates them, and the surfaces OpenPBR and Standard Surface made of them.

Transcribed from the formulas of the pixel shaders that MaterialX 1.39 generates: `mx_oren_nayar_diffuse_bsdf`,
`mx_dielectric_bsdf`, `mx_generalized_schlick_bsdf` and `mx_conductor_bsdf`, with its analytic directional albedo. The
layers, and the compensation of facets, depend only on the viewer: the surfaces are not quite reciprocal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brdfdb.parameters import Floats

OPEN_PBR, STANDARD = "open_pbr_surface", "standard_surface"

_LEAST = 1e-8  # M_FLOAT_EPS of the shaders
# Of Fujii's diffuse lobe: its albedo, and the mean of that
_FUJII_1, _FUJII_2 = 0.5 - 2.0 / (3.0 * np.pi), 2.0 / 3.0 - 28.0 / (15.0 * np.pi)
_MOST_METAL = 0.99  # largest reflectance of the metal of a standard surface
_MOST_ANISOTROPY = 0.98  # of a standard surface
_MOST_F_0 = 0.99999  # of the dielectric of OpenPBR
_EDGE = 1.0 / 7.0  # cosine of about 82 degrees, at which the colour of the edge of OpenPBR's metal is stated

_SLACK = (
    1e-4  # added to a factor at the edge, for the six digits of a file and the cosines between those that are tried
)

# Coefficients of the rational function of cosine x and alpha y that MaterialX has for the directional albedo of GGX:
# columns for 1, x, y, xy, x^2, y^2, x^2 y, x y^2, x^2 y^2; two rows of numerators, two of denominators
_ALBEDO = np.array(
    [
        [0.1003, -0.6303, 9.748, -2.038, 29.34, -8.245, -26.44, 19.99, -5.448],
        [0.9345, -2.323, 2.229, -3.748, 1.424, -0.7684, 1.436, 0.2913, 0.6286],
        [1.0, -1.765, 8.263, 11.53, 28.96, -7.507, -36.11, 15.86, 33.37],
        [1.0, 0.2281, 15.94, -55.83, 13.08, 41.26, 54.9, 300.2, -285.1],
    ]
)


@dataclass(frozen=True)
class MaterialXSurface:
    """A surface without coat, fuzz, transmission and subsurface. Names are those of OpenPBR, all numbers are [1]."""

    kind: str  #: "open_pbr_surface" or "standard_surface"
    #: linear sRGB, or one number of a grey surface
    base_color: tuple[float, ...]
    specular_color: tuple[float, ...] = (1.0,)
    #: As in the specifications. A standard surface calls them base, diffuse_roughness, metalness, specular,
    #: specular_roughness and specular_IOR.
    base_weight: float = 1.0
    base_diffuse_roughness: float = 0.0
    base_metalness: float = 0.0
    specular_weight: float = 1.0
    specular_roughness: float = 0.3
    specular_ior: float = 1.5
    specular_anisotropy: float = 0.0  #: the slopes are wider, and the highlight longer, along the tangent
    quarter_turn: bool = False  #: true if the tangent is y instead of x

    @property
    def alphas(self) -> tuple[float, float]:
        """Widths of the slopes of GGX [1] along the tangent and across it."""
        square, narrow = self.specular_roughness**2, 1.0 - self.specular_anisotropy
        if self.kind == OPEN_PBR:
            along = square * np.sqrt(2.0 / (1.0 + narrow * narrow))
            across = narrow * along
        else:
            aspect = np.sqrt(1.0 - np.clip(self.specular_anisotropy, 0.0, _MOST_ANISOTROPY))
            square = max(square, _LEAST)
            along, across = min(square / aspect, 1.0), square * aspect
        return float(np.clip(along, _LEAST, 1.0)), float(np.clip(across, _LEAST, 1.0))

    @property
    def smooth(self) -> bool:
        """True if the facets mirror: alpha is then 1e-8 in the shaders, a Dirac delta that is no part of f_r."""
        return self.specular_roughness == 0.0

    def brdf(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr], shape (N, C), at unit vectors (N, 3) of light and viewer above the horizon."""
        at = _geometry(wi, wr, self.alphas, self.quarter_turn)
        return self._shaded(at._replace(facets=np.zeros_like(at.facets)) if self.smooth else at)

    def specular_reflectance(self, theta: Floats) -> Floats:
        """Return the reflectance [1] of smooth facets in the mirror direction, shape (N, C), at theta (N,) [rad]."""
        wi, wr = (np.stack([sign * np.sin(theta), 0.0 * theta, np.cos(theta)], axis=-1) for sign in (-1.0, 1.0))
        at = _geometry(wi, wr, self.alphas, self.quarter_turn)
        with_facets, without = (at._replace(facets=np.full_like(at.facets, share)) for share in (1.0, 0.0))
        return self._shaded(with_facets) - self._shaded(without)

    def _shaded(self, at: _Geometry) -> Floats:
        base, edge = np.maximum(self.base_color, 0.0), np.asarray(self.specular_color)
        return self._open_pbr(at, base, edge) if self.kind == OPEN_PBR else self._standard(at, base, edge)

    def _open_pbr(self, at: _Geometry, base: Floats, edge: Floats) -> Floats:
        eta = self.specular_ior
        f_0 = np.clip(self.specular_weight * ((eta - 1.0) / (eta + 1.0)) ** 2, 0.0, _MOST_F_0)
        root = np.sign(eta - 1.0) * np.sqrt(f_0)
        gloss, below = _dielectric(at, (1.0 + root) / (1.0 - root), 1.0)
        body = self.base_weight * _compensated_diffuse(at, base, self.base_diffuse_roughness)
        painted = gloss * np.maximum(edge, 0.0) + below * body
        reflectance = _schlick(at.cos_half, self.base_weight * base, np.maximum(edge, 0.0))
        metal = self.specular_weight * _metal(at, reflectance)
        return painted + self.base_metalness * (metal - painted)

    def _standard(self, at: _Geometry, base: Floats, edge: Floats) -> Floats:
        gloss, below = _dielectric(at, self.specular_ior, self.specular_weight)
        body = self.base_weight * _diffuse(at, self.base_diffuse_roughness) * base
        painted = gloss * np.maximum(edge, 0.0) + below * body
        n, k = artistic_index(self.base_weight * base, self.specular_weight * edge)
        metal = _metal(at, _conductor(at.cos_half, n, k))
        return painted + self.base_metalness * (metal - painted)


class _Geometry(NamedTuple):
    """Cosines (N, 1) of light, viewer, their angle, and that on a facet; and D G / (4 cos_i cos_r) [1/sr] of GGX."""

    cos_i: Floats
    cos_r: Floats
    cos_between: Floats
    cos_half: Floats
    facets: Floats
    albedo: tuple[Floats, Floats]


def _geometry(wi: Floats, wr: Floats, alphas: tuple[float, float], quarter_turn: bool) -> _Geometry:
    cos_i, cos_r = (np.clip(w[:, 2:], _LEAST, 1.0) for w in (wi, wr))
    between = np.einsum("ij,ij->i", wi, wr)[:, np.newaxis]
    half = (wi + wr) / np.sqrt(2.0 * (1.0 + between))
    along, across = (half[:, 1:2], -half[:, :1]) if quarter_turn else (half[:, :1], half[:, 1:2])
    alpha_x, alpha_y = alphas
    slopes = (along / alpha_x) ** 2 + (across / alpha_y) ** 2 + half[:, 2:] ** 2
    density = 1.0 / (np.pi * alpha_x * alpha_y * slopes**2)
    alpha2 = alpha_x * alpha_y  # of the mean of both, which the shadowing has for all azimuths
    hidden_i, hidden_r = (np.sqrt(alpha2 + (1.0 - alpha2) * cos**2) for cos in (cos_i, cos_r))
    return _Geometry(
        cos_i,
        cos_r,
        np.clip(between, _LEAST, 1.0),
        np.sqrt(np.clip(0.5 * (1.0 + between), _LEAST, 1.0)),  # half the angle between light and viewer
        density / (2.0 * (hidden_i * cos_r + hidden_r * cos_i)),
        _albedo(cos_r, np.sqrt(alpha2)),
    )


def _albedo(x: Floats, y: float) -> tuple[Floats, Floats]:
    """Return the parts (N, 1) of the directional albedo of GGX that belong to the reflectances at 0 and 90 degrees."""
    terms = np.concatenate(
        [np.ones_like(x), x, np.full_like(x, y), x * y, x**2, np.full_like(x, y * y), x**2 * y, x * y**2, x**2 * y**2],
        axis=1,
    )
    r = terms @ _ALBEDO.T
    return np.clip(r[:, 0:1] / r[:, 2:3], 0.0, 1.0), np.clip(r[:, 1:2] / r[:, 3:4], 0.0, 1.0)


def _compensation(at: _Geometry, reflectance: Floats) -> Floats:
    """Return the factor [1] by which facets are brightened for light that they reflect more than once."""
    single = at.albedo[0] + at.albedo[1]
    return 1.0 + reflectance * (1.0 - single) / single


def _dielectric(at: _Geometry, ior: float, weight: float) -> tuple[Floats, Floats]:
    """Return f_r [1/sr] of the facets, without tint, and the share [1] of light that goes on to what lies below."""
    if weight < _LEAST:
        return np.zeros_like(at.cos_r), np.ones_like(at.cos_r)
    c = at.cos_half
    g2 = ior * ior + c * c - 1.0
    g = np.sqrt(np.maximum(g2, 0.0))
    first, second = (g - c) / (g + c), ((g + c) * c - 1.0) / ((g - c) * c + 1.0)
    reflectance = np.where(g2 < 0.0, 1.0, 0.5 * first**2 * (1.0 + second**2))
    factor = _compensation(at, reflectance)
    f_0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    below = 1.0 - weight * factor * (f_0 * at.albedo[0] + at.albedo[1])
    return weight * at.facets * reflectance * factor, below


def _metal(at: _Geometry, reflectance: Floats) -> Floats:
    return np.asarray(at.facets * reflectance * _compensation(at, reflectance))


def _schlick(cos: Floats, normal: Floats, edge: Floats) -> Floats:
    """Return Hoffman's reflectance (N, C) [1] of metals, from that at 0 degrees and a factor at 82 degrees."""
    at_edge = _at_edge(normal)
    less = at_edge * (1.0 - edge) / (_EDGE * (1.0 - _EDGE) ** 6)
    return np.asarray(normal + (1.0 - normal) * (1.0 - cos) ** 5 - less * cos * (1.0 - cos) ** 6)


def _at_edge(normal: Floats) -> Floats:
    return np.asarray(normal + (1.0 - normal) * (1.0 - _EDGE) ** 5)


def darkest_edge(normal: Floats) -> Floats:
    """Return the least factor (C,) [1] at 82 degrees with which Hoffman's reflectance is nowhere negative."""
    cos = np.linspace(0.0, 1.0, 1026)[1:-1, np.newaxis]
    share = (normal + (1.0 - normal) * (1.0 - cos) ** 5) / (cos * (1.0 - cos) ** 6)
    least = 1.0 - share.min(axis=0) * (_EDGE * (1.0 - _EDGE) ** 6) / _at_edge(normal)
    return np.asarray(np.clip(least + _SLACK, 0.0, 1.0))


def artistic_index(reflectivity: Floats, edge: Floats) -> tuple[Floats, Floats]:
    """Return n and k [1] of a metal from its reflectance at 0 degrees and its edge colour (Gulbrandsen 2014)."""
    r = np.clip(reflectivity, 0.0, _MOST_METAL)
    root = np.sqrt(r)
    highest, lowest = (1.0 + root) / (1.0 - root), (1.0 - r) / (1.0 + r)
    n = highest + (lowest - highest) * edge
    k2 = ((n + 1.0) ** 2 * r - (n - 1.0) ** 2) / (1.0 - r)
    return n, np.sqrt(np.maximum(k2, 0.0))


def _conductor(cos: Floats, n: Floats, k: Floats) -> Floats:
    """Return the reflectance (N, C) [1] of unpolarised light at a metal."""
    cos2 = cos * cos
    sin2 = 1.0 - cos2
    t_0 = n * n - k * k - sin2
    both = np.sqrt(t_0 * t_0 + 4.0 * n * n * k * k)
    t_1, t_2 = both + cos2, 2.0 * np.sqrt(np.maximum(0.5 * (both + t_0), 0.0)) * cos
    r_s = (t_1 - t_2) / (t_1 + t_2)
    t_3, t_4 = cos2 * both + sin2 * sin2, t_2 * sin2
    return np.asarray(0.5 * r_s * (1.0 + (t_3 - t_4) / (t_3 + t_4)))


def _diffuse(at: _Geometry, roughness: float) -> Floats:
    """Return f_r [1/sr] of the qualitative model of Oren and Nayar for a white surface, as shaders evaluate it."""
    s = at.cos_between - at.cos_i * at.cos_r
    share = np.where(s > 0.0, s / np.maximum(at.cos_i, at.cos_r), 0.0)
    sigma2 = roughness * roughness
    return np.asarray((1.0 - 0.5 * sigma2 / (sigma2 + 0.33) + 0.45 * sigma2 / (sigma2 + 0.09) * share) / np.pi)


def _compensated_diffuse(at: _Geometry, color: Floats, roughness: float) -> Floats:
    """Return f_r (N, C) [1/sr] of the energy-preserving model of Oren and Nayar, as shaders evaluate it."""
    s = at.cos_between - at.cos_i * at.cos_r
    share = np.where(s > 0.0, s / np.maximum(at.cos_i, at.cos_r), s)
    level = 1.0 / (1.0 + _FUJII_1 * roughness)
    single = color * level * (1.0 + roughness * share)
    mean = level * (1.0 + _FUJII_2 * roughness)
    multiple = color**2 * mean / (1.0 - color * max(0.0, 1.0 - mean))
    lost_i, lost_r = (np.maximum(_LEAST, 1.0 - _diffuse_albedo(cos, roughness, level)) for cos in (at.cos_i, at.cos_r))
    return np.asarray((single + multiple * lost_i * lost_r / max(_LEAST, 1.0 - mean)) / np.pi)


def _diffuse_albedo(cos: Floats, roughness: float, level: float) -> Floats:
    sin = np.sqrt(np.maximum(0.0, 1.0 - cos * cos))
    g = sin * (np.arccos(cos) - sin * cos) + 2.0 / 3.0 * (sin / cos * (1.0 - sin**3) - sin)
    return np.asarray(level + roughness * level * g / np.pi)
