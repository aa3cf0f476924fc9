"""The signatures of the models. ``python -m brdfdb.models.stub`` wrote this file from the declarations."""

# fmt: off
# ruff: noqa: E501
from types import ModuleType
from typing import overload

from numpy.typing import ArrayLike

from brdfdb.models.he_torrance_1991 import Complexes
from brdfdb.models.he_torrance_1991_limits import HeTorranceParts
from brdfdb.models.oren_nayar_1994 import Parts
from brdfdb.models.registry import Registry
from brdfdb.parameters import Floats

MODELS: Registry
PAPERS: tuple[ModuleType, ...]

@overload
def abg(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, a: ArrayLike, b: ArrayLike, g:
    ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the ABg model of scatter, A / (B + x^g)."""
@overload
def abg(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def abg(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def abg_vectors(wi: ArrayLike, wr: ArrayLike, *, a: ArrayLike, b: ArrayLike, g: ArrayLike) -> Floats:
    """Return `abg` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def abg_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def abg_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def beckmann(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, alpha_x: ArrayLike, alpha_y:
    ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of mirror facets with Gaussian slopes (Beckmann), of a metal or a dielectric."""
@overload
def beckmann(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def beckmann(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def beckmann_schlick(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho_d: ArrayLike, f_0: ArrayLike,
    alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of facets with Gaussian slopes and Schlick's reflectance over a uniform part."""
@overload
def beckmann_schlick(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def beckmann_schlick(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def beckmann_schlick_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, f_0: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return `beckmann_schlick` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def beckmann_schlick_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def beckmann_schlick_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def beckmann_separable(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, alpha_x: ArrayLike, alpha_y:
    ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of Gaussian facets with the paper's approximation of their shadowing."""
@overload
def beckmann_separable(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def beckmann_separable(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def beckmann_separable_vectors(
    wi: ArrayLike, wr: ArrayLike, *, alpha_x: ArrayLike, alpha_y: ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm:
    ArrayLike | None = None,
) -> Floats:
    """Return `beckmann_separable` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def beckmann_separable_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def beckmann_separable_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def beckmann_vectors(
    wi: ArrayLike, wr: ArrayLike, *, alpha_x: ArrayLike, alpha_y: ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm:
    ArrayLike | None = None,
) -> Floats:
    """Return `beckmann` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def beckmann_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def beckmann_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, alpha_x: ArrayLike, alpha_y:
    ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of mirror facets with GGX slopes (Trowbridge-Reitz), of a metal or a dielectric."""
@overload
def ggx(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_compensated(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with the light that they reflect to one another (Kulla and Conty)."""
@overload
def ggx_compensated(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_compensated(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_compensated_vectors(wi: ArrayLike, wr: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    """Return `ggx_compensated` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ggx_compensated_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_compensated_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_scaled(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike,
) -> Floats:
    """Return the function [1/sr] of Turquin 2019: GGX facets, brighter by what they lose towards the viewer."""
@overload
def ggx_scaled(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_scaled(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_scaled_vectors(wi: ArrayLike, wr: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    """Return `ggx_scaled` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ggx_scaled_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_scaled_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_schlick(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho_d: ArrayLike, f_0: ArrayLike,
    alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with Schlick's reflectance over a uniform part."""
@overload
def ggx_schlick(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_schlick(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_schlick_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, f_0: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return `ggx_schlick` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ggx_schlick_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_schlick_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_separable(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, alpha_x: ArrayLike, alpha_y:
    ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with the shadowing of light times that of viewer, as the paper prints it."""
@overload
def ggx_separable(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_separable(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_separable_vectors(
    wi: ArrayLike, wr: ArrayLike, *, alpha_x: ArrayLike, alpha_y: ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm:
    ArrayLike | None = None,
) -> Floats:
    """Return `ggx_separable` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ggx_separable_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_separable_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ggx_vectors(
    wi: ArrayLike, wr: ArrayLike, *, alpha_x: ArrayLike, alpha_y: ArrayLike, n: ArrayLike, k: ArrayLike, wavelength_nm:
    ArrayLike | None = None,
) -> Floats:
    """Return `ggx` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ggx_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ggx_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def hapke(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, w: ArrayLike, b: ArrayLike, c:
    ArrayLike, b_0: ArrayLike = 0.0, h: ArrayLike = 1.0, theta_bar: ArrayLike = 0.0,
) -> Floats:
    """Return the BRDF [1/sr] of Hapke's model of a layer of grains, with hot spot and macroscopic roughness."""
@overload
def hapke(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def hapke(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def hapke_vectors(
    wi: ArrayLike, wr: ArrayLike, *, w: ArrayLike, b: ArrayLike, c: ArrayLike, b_0: ArrayLike = 0.0, h: ArrayLike = 1.0,
    theta_bar: ArrayLike = 0.0,
) -> Floats:
    """Return `hapke` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def hapke_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def hapke_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def harvey_shack(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, b_0: ArrayLike, knee: ArrayLike,
    slope: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of Harvey and Shack's scatter, b_0 (1 + (x / L)^2)^(s / 2)."""
@overload
def harvey_shack(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def harvey_shack(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def harvey_shack_vectors(wi: ArrayLike, wr: ArrayLike, *, b_0: ArrayLike, knee: ArrayLike, slope: ArrayLike) -> Floats:
    """Return `harvey_shack` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def harvey_shack_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def harvey_shack_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def he_torrance(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um:
    ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike, a: ArrayLike = 0.0,
) -> Floats:
    """Return the BRDF [1/sr] of a Gaussian rough surface: the directional diffuse and the uniform diffuse part."""
@overload
def he_torrance(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def he_torrance(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

def he_torrance_aperture(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, incident_solid_angle_sr: ArrayLike,
    received_solid_angle_sr: ArrayLike, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n:
    ArrayLike, k: ArrayLike, a: ArrayLike = 0.0, rings: ArrayLike = 2,
) -> Floats:
    """Return the BRDF [1/sr] that an instrument with a cone of light and a cone of its receiver measures."""

def he_torrance_aperture_vectors(
    wi: ArrayLike, wr: ArrayLike, *, incident_solid_angle_sr: ArrayLike, received_solid_angle_sr: ArrayLike,
    wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike, a: ArrayLike = 0.0,
    rings: ArrayLike = 2,
) -> Floats:
    """Return `he_torrance_aperture` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

def he_torrance_facet_mueller(theta_d: ArrayLike, *, n: ArrayLike, k: ArrayLike) -> Floats:
    """Return the Mueller matrix [1] of the facet over its first element, between s and p of the plane of the light."""

def he_torrance_jones(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, n: ArrayLike, k: ArrayLike,
) -> Complexes:
    """Return the Jones matrix [1] of the facet that mirrors light to viewer, between s and p of the mean surface."""

def he_torrance_jones_vectors(wi: ArrayLike, wr: ArrayLike, *, n: ArrayLike, k: ArrayLike) -> Complexes:
    """Return `he_torrance_jones` [1] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

def he_torrance_mueller(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um:
    ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike, a: ArrayLike = 0.0,
) -> Floats:
    """Return the Mueller BRDF [1/sr] of a Gaussian rough surface: directional and uniform diffuse part."""

def he_torrance_mueller_vectors(
    wi: ArrayLike, wr: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike,
    k: ArrayLike, a: ArrayLike = 0.0,
) -> Floats:
    """Return `he_torrance_mueller` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

def he_torrance_parts(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um:
    ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike, a: ArrayLike = 0.0,
) -> HeTorranceParts:
    """Return f_r [1/sr] of the directional diffuse and of the uniform diffuse part of `he_torrance`, separately."""

def he_torrance_parts_vectors(
    wi: ArrayLike, wr: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike,
    k: ArrayLike, a: ArrayLike = 0.0,
) -> HeTorranceParts:
    """Return `he_torrance_parts` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

def he_torrance_smooth(theta_i: ArrayLike, *, n: ArrayLike, k: ArrayLike) -> Floats:
    """Return the specular reflectance [1] of a smooth surface: `he_torrance_specular` as sigma_0 / wavelength -> 0."""

def he_torrance_smooth_vectors(wi: ArrayLike, *, n: ArrayLike, k: ArrayLike) -> Floats:
    """Return `he_torrance_smooth` [1] for unit vectors `wi` (light) of shape (..., 3)."""

def he_torrance_specular(
    theta_i: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k:
    ArrayLike,
) -> Floats:
    """Return the specular reflectance [1], the share of the light that leaves in the exact mirror direction."""

def he_torrance_specular_mueller(
    theta_i: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k:
    ArrayLike,
) -> Floats:
    """Return the Mueller matrix [1] of the specular part, which leaves in the exact mirror direction."""

def he_torrance_specular_mueller_vectors(
    wi: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike,
) -> Floats:
    """Return `he_torrance_specular_mueller` [1] for unit vectors `wi` (light) of shape (..., 3)."""

def he_torrance_specular_vectors(
    wi: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike,
) -> Floats:
    """Return `he_torrance_specular` [1] for unit vectors `wi` (light) of shape (..., 3)."""

@overload
def he_torrance_vectors(
    wi: ArrayLike, wr: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike,
    k: ArrayLike, a: ArrayLike = 0.0,
) -> Floats:
    """Return `he_torrance` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def he_torrance_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def he_torrance_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def he_torrance_very_rough(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, sigma_0_over_tau: ArrayLike, n:
    ArrayLike, k: ArrayLike, a: ArrayLike = 0.0,
) -> Floats:
    """Return the BRDF [1/sr] of a very rough surface: `he_torrance` in the limit g -> infinity, geometrical optics."""
@overload
def he_torrance_very_rough(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def he_torrance_very_rough(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def he_torrance_very_rough_vectors(
    wi: ArrayLike, wr: ArrayLike, *, sigma_0_over_tau: ArrayLike, n: ArrayLike, k: ArrayLike, a: ArrayLike = 0.0,
) -> Floats:
    """Return `he_torrance_very_rough` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def he_torrance_very_rough_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def he_torrance_very_rough_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def lambert(theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike) -> Floats:
    """Return the BRDF [1/sr] of an ideal diffuser, rho / pi, the same in every direction."""
@overload
def lambert(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def lambert(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def lambert_sphere(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of a deep layer of small Lambertian spheres, which lie sparse and at random."""
@overload
def lambert_sphere(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def lambert_sphere(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def lambert_sphere_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike) -> Floats:
    """Return `lambert_sphere` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def lambert_sphere_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def lambert_sphere_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def lambert_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike) -> Floats:
    """Return `lambert` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def lambert_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def lambert_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def minnaert(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, k: ArrayLike, rho: ArrayLike = 1.0,
) -> Floats:
    """Return the BRDF [1/sr] of Minnaert's law, rho (k + 1) / (2 pi) (cos theta_i cos theta_r)^(k - 1)."""
@overload
def minnaert(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def minnaert(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def minnaert_vectors(wi: ArrayLike, wr: ArrayLike, *, k: ArrayLike, rho: ArrayLike = 1.0) -> Floats:
    """Return `minnaert` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def minnaert_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def minnaert_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike,
    interreflection: ArrayLike = True,
) -> Floats:
    """Return the BRDF [1/sr] of Lambertian V-cavities with Gaussian slopes, by the functional fit of the paper."""
@overload
def oren_nayar(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_body_surface(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike,
    k_s: ArrayLike, k_b: ArrayLike = 1.0, e_0: ArrayLike = 1.0, interreflection: ArrayLike = False, n: ArrayLike | None
    = None, k: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of a rough body with a glossy surface: k_b `oren_nayar` + k_s / e_0 `torrance_sparrow`."""
@overload
def oren_nayar_body_surface(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_body_surface(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_body_surface_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, k_s: ArrayLike, k_b: ArrayLike = 1.0, e_0:
    ArrayLike = 1.0, interreflection: ArrayLike = False, n: ArrayLike | None = None, k: ArrayLike | None = None,
) -> Floats:
    """Return `oren_nayar_body_surface` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_body_surface_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_body_surface_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_energy_preserving(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, roughness: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the energy-preserving Oren-Nayar model (EON), which reflects all light if rho = 1."""
@overload
def oren_nayar_energy_preserving(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_energy_preserving(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_energy_preserving_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, roughness: ArrayLike,
) -> Floats:
    """Return `oren_nayar_energy_preserving` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_energy_preserving_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_energy_preserving_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_fujii(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of Fujii's form of the qualitative Oren-Nayar model, rho (A + B s / t)."""
@overload
def oren_nayar_fujii(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_fujii(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_fujii_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Floats:
    """Return `oren_nayar_fujii` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_fujii_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_fujii_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_gaussian(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of V-cavities with Gaussian slopes, integrated, which the fit `oren_nayar` approximates."""
@overload
def oren_nayar_gaussian(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_gaussian(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

def oren_nayar_gaussian_parts(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike,
) -> Parts:
    """Return the parts [1/sr] of `oren_nayar_gaussian`: direct light and the second bounce."""

def oren_nayar_gaussian_parts_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Parts:
    """Return `oren_nayar_gaussian_parts` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

@overload
def oren_nayar_gaussian_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Floats:
    """Return `oren_nayar_gaussian` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_gaussian_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_gaussian_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

def oren_nayar_parts(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike,
) -> Parts:
    """Return the parts [1/sr] of `oren_nayar`: direct light (eq. 27) and the second bounce (eq. 28)."""

def oren_nayar_parts_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Parts:
    """Return `oren_nayar_parts` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

@overload
def oren_nayar_qualitative(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike,
    offset: ArrayLike = 0.33,
) -> Floats:
    """Return the BRDF [1/sr] of the qualitative model: the fit without its third term and without interreflection."""
@overload
def oren_nayar_qualitative(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_qualitative(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_qualitative_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, offset: ArrayLike = 0.33,
) -> Floats:
    """Return `oren_nayar_qualitative` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_qualitative_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_qualitative_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_single_slope(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of V-cavities of one slope in all azimuths, by the closed forms of the paper."""
@overload
def oren_nayar_single_slope(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_single_slope(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

def oren_nayar_single_slope_parts(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike,
) -> Parts:
    """Return the parts [1/sr] of `oren_nayar_single_slope`: direct light and the second bounce."""

def oren_nayar_single_slope_parts_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike) -> Parts:
    """Return `oren_nayar_single_slope_parts` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

@overload
def oren_nayar_single_slope_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike) -> Floats:
    """Return `oren_nayar_single_slope` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_single_slope_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_single_slope_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_unidirectional(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike,
    phi_a: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of parallel V-cavities of one slope, exact in direct light and the second bounce."""
@overload
def oren_nayar_unidirectional(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_unidirectional(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

def oren_nayar_unidirectional_parts(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike,
    phi_a: ArrayLike,
) -> Parts:
    """Return the parts [1/sr] of `oren_nayar_unidirectional`: direct light and the second bounce."""

def oren_nayar_unidirectional_parts_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike, phi_a: ArrayLike,
) -> Parts:
    """Return `oren_nayar_unidirectional_parts` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""

@overload
def oren_nayar_unidirectional_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike, phi_a: ArrayLike,
) -> Floats:
    """Return `oren_nayar_unidirectional` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_unidirectional_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_unidirectional_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def oren_nayar_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, interreflection: ArrayLike = True,
) -> Floats:
    """Return `oren_nayar` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def oren_nayar_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def oren_nayar_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ross_li(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, f_iso: ArrayLike, f_vol: ArrayLike,
    f_geo: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the Ross-Thick and Li-Sparse-Reciprocal kernels, the model of the MODIS product."""
@overload
def ross_li(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ross_li(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ross_li_vectors(wi: ArrayLike, wr: ArrayLike, *, f_iso: ArrayLike, f_vol: ArrayLike, f_geo: ArrayLike) -> Floats:
    """Return `ross_li` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ross_li_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ross_li_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def rpv(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho_0: ArrayLike, k: ArrayLike,
    asymmetry: ArrayLike, rho_c: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the RPV model: a bowl or a bell, a phase function, and a hot spot."""
@overload
def rpv(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def rpv(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def rpv_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_0: ArrayLike, k: ArrayLike, asymmetry: ArrayLike, rho_c: ArrayLike,
) -> Floats:
    """Return `rpv` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def rpv_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def rpv_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def torrance_sparrow(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, sigma: ArrayLike, n: ArrayLike | None
    = None, k: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of mirror-like facets with Gaussian slopes, a lobe of height 1 that is not normalised."""
@overload
def torrance_sparrow(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def torrance_sparrow(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def torrance_sparrow_vectors(
    wi: ArrayLike, wr: ArrayLike, *, sigma: ArrayLike, n: ArrayLike | None = None, k: ArrayLike | None = None,
) -> Floats:
    """Return `torrance_sparrow` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def torrance_sparrow_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def torrance_sparrow_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def vmf_diffuse(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike, roughness: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of diffuse facets whose normals follow a von Mises-Fisher distribution."""
@overload
def vmf_diffuse(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def vmf_diffuse(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def vmf_diffuse_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, roughness: ArrayLike) -> Floats:
    """Return `vmf_diffuse` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def vmf_diffuse_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def vmf_diffuse_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike,
    alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the elliptical Gaussian model; isotropic (eq. 4) where alpha_x equals alpha_y."""
@overload
def ward(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward_bounded(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike,
    alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of Ward's model with a normalisation that bounds the albedo by rho_d + rho_s."""
@overload
def ward_bounded(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward_bounded(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward_bounded_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return `ward_bounded` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ward_bounded_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward_bounded_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward_duer(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike,
    alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of Ward's model with Duer's 1 / (cos theta_i cos theta_r) in place of its square root."""
@overload
def ward_duer(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward_duer(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward_duer_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return `ward_duer` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ward_duer_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward_duer_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward_half_vector(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike,
    alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the elliptical Gaussian model in its half-vector form; isotropic for equal alphas."""
@overload
def ward_half_vector(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward_half_vector(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward_half_vector_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return `ward_half_vector` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ward_half_vector_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward_half_vector_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

@overload
def ward_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike,
) -> Floats:
    """Return `ward` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
@overload
def ward_vectors(*directions: ArrayLike, out: Floats | None, threads: int = 1, **parameters: ArrayLike | None) -> Floats: ...
@overload
def ward_vectors(*directions: ArrayLike, threads: int, **parameters: ArrayLike | None) -> Floats: ...

__all__ = [
    "MODELS", "abg", "abg_vectors", "beckmann", "beckmann_schlick", "beckmann_schlick_vectors", "beckmann_separable",
    "beckmann_separable_vectors", "beckmann_vectors", "ggx", "ggx_compensated", "ggx_compensated_vectors", "ggx_scaled",
    "ggx_scaled_vectors", "ggx_schlick", "ggx_schlick_vectors", "ggx_separable", "ggx_separable_vectors", "ggx_vectors",
    "hapke", "hapke_vectors", "harvey_shack", "harvey_shack_vectors", "he_torrance", "he_torrance_aperture",
    "he_torrance_aperture_vectors", "he_torrance_facet_mueller", "he_torrance_jones", "he_torrance_jones_vectors",
    "he_torrance_mueller", "he_torrance_mueller_vectors", "he_torrance_parts", "he_torrance_parts_vectors",
    "he_torrance_smooth", "he_torrance_smooth_vectors", "he_torrance_specular", "he_torrance_specular_mueller",
    "he_torrance_specular_mueller_vectors", "he_torrance_specular_vectors", "he_torrance_vectors",
    "he_torrance_very_rough", "he_torrance_very_rough_vectors", "lambert", "lambert_sphere", "lambert_sphere_vectors",
    "lambert_vectors", "minnaert", "minnaert_vectors", "oren_nayar", "oren_nayar_body_surface",
    "oren_nayar_body_surface_vectors", "oren_nayar_energy_preserving", "oren_nayar_energy_preserving_vectors",
    "oren_nayar_fujii", "oren_nayar_fujii_vectors", "oren_nayar_gaussian", "oren_nayar_gaussian_parts",
    "oren_nayar_gaussian_parts_vectors", "oren_nayar_gaussian_vectors", "oren_nayar_parts", "oren_nayar_parts_vectors",
    "oren_nayar_qualitative", "oren_nayar_qualitative_vectors", "oren_nayar_single_slope",
    "oren_nayar_single_slope_parts", "oren_nayar_single_slope_parts_vectors", "oren_nayar_single_slope_vectors",
    "oren_nayar_unidirectional", "oren_nayar_unidirectional_parts", "oren_nayar_unidirectional_parts_vectors",
    "oren_nayar_unidirectional_vectors", "oren_nayar_vectors", "ross_li", "ross_li_vectors", "rpv", "rpv_vectors",
    "torrance_sparrow", "torrance_sparrow_vectors", "vmf_diffuse", "vmf_diffuse_vectors", "ward", "ward_bounded",
    "ward_bounded_vectors", "ward_duer", "ward_duer_vectors", "ward_half_vector", "ward_half_vector_vectors",
    "ward_vectors",
]
