"""Wrong forms of Ward 1992."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb.geometry import unit_vector
from brdfdb.models import (
    ward,
    ward_bounded,
    ward_bounded_vectors,
    ward_duer,
    ward_duer_vectors,
    ward_half_vector,
    ward_half_vector_vectors,
    ward_vectors,
)
from tests.gallery.mutants import added_figures
from tests.gallery.mutants.mutation import Mutant

PREFIX = "ward-1992-"
FORMS = {
    ward: ward_vectors,
    ward_half_vector: ward_half_vector_vectors,
    ward_duer: ward_duer_vectors,
    ward_bounded: ward_bounded_vectors,
}

Function = Callable[..., Any]
HORIZON = 6.123233995736766e-17  # cosine of the float64 nearest pi/2


def by_vectors(f_r: Function) -> Function:
    """Return the function of angles with the values of a function of unit vectors."""
    return lambda theta_i, phi_i, theta_r, phi_r, **surface: f_r(
        unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r), **surface
    )


def each_form(change: Callable[[Function], Function]) -> dict[Function, Function]:
    """Return all four forms, of angles and of vectors, by a function that makes the wrong form from the right one."""
    wrong = {angles: change(vectors) for angles, vectors in FORMS.items()}
    return {angles: by_vectors(vectors) for angles, vectors in wrong.items()} | {
        FORMS[angles]: vectors for angles, vectors in wrong.items()
    }


def with_surface(change: Callable[[dict[str, Any]], dict[str, Any]]) -> dict[Function, Function]:
    """Return all four forms with changed parameters."""
    return each_form(lambda right: lambda *directions, **surface: right(*directions, **change(surface)))


def parts(lobe: float = 1.0, diffuse: float = 1.0) -> dict[Function, Function]:
    """Return all four forms with factors of the lobe and of the diffuse part."""

    def wrong(right: Function) -> Function:
        def f_r(*directions: Any, rho_d: Any, **surface: Any) -> Any:
            total, base = right(*directions, rho_d=rho_d, **surface), rho_d / np.pi
            return np.where(total > 0.0, lobe * (total - base) + diffuse * base, 0.0)

        return f_r

    return each_form(wrong)


def wider(factor: float) -> dict[Function, Function]:
    """Return all four forms with a multiple of both alphas."""
    return with_surface(
        lambda surface: {**surface, "alpha_x": factor * surface["alpha_x"], "alpha_y": factor * surface["alpha_y"]}
    )


def elliptical(lobe: Function) -> dict[Function, Function]:
    """Return eq. 5a with another lobe: a function of tan(delta), azimuth phi, both cosines, and both alphas."""

    def vectors(wi: Any, wr: Any, *, rho_d: Any, rho_s: Any, alpha_x: Any, alpha_y: Any) -> Any:
        wi, wr = np.asarray(wi, dtype=np.float64), np.asarray(wr, dtype=np.float64)
        h, cosines = wi + wr, (np.maximum(wi[..., 2], HORIZON), np.maximum(wr[..., 2], HORIZON))
        tan, phi = np.hypot(h[..., 0], h[..., 1]) / (cosines[0] + cosines[1]), np.arctan2(h[..., 1], h[..., 0])
        total = rho_d / np.pi + rho_s * lobe(tan, phi, *cosines, alpha_x, alpha_y)
        return np.where((wi[..., 2] >= 0.0) & (wr[..., 2] >= 0.0), total, 0.0)

    return {ward: by_vectors(vectors), ward_vectors: vectors}


def printed(tan: Any, phi: Any, cos_i: Any, cos_r: Any, alpha_x: Any, alpha_y: Any) -> Any:
    """Return the lobe [1/sr] of eq. 5a."""
    exponent = tan**2 * (np.cos(phi) ** 2 / alpha_x**2 + np.sin(phi) ** 2 / alpha_y**2)
    return np.exp(-exponent) / (4.0 * np.pi * alpha_x * alpha_y * np.sqrt(cos_i * cos_r))


def one_power(tan: Any, phi: Any, cos_i: Any, cos_r: Any, alpha_x: Any, alpha_y: Any) -> Any:
    """Return the lobe [1/sr] of eq. 5a whose exponent has the alphas without their squares."""
    exponent = tan**2 * (np.cos(phi) ** 2 / alpha_x + np.sin(phi) ** 2 / alpha_y)
    return np.exp(-exponent) / (4.0 * np.pi * alpha_x * alpha_y * np.sqrt(cos_i * cos_r))


def half_vector(factor: float) -> dict[Function, Function]:
    """Return eq. 5b with another factor in its exponent."""

    def vectors(wi: Any, wr: Any, *, rho_d: Any, rho_s: Any, alpha_x: Any, alpha_y: Any) -> Any:
        wi, wr = np.asarray(wi, dtype=np.float64), np.asarray(wr, dtype=np.float64)
        h = (wi + wr) / np.linalg.norm(wi + wr, axis=-1, keepdims=True)
        exponent = factor * ((h[..., 0] / alpha_x) ** 2 + (h[..., 1] / alpha_y) ** 2) / (1.0 + h[..., 2])
        cosines = np.maximum(wi[..., 2], HORIZON) * np.maximum(wr[..., 2], HORIZON)
        lobe = rho_s * np.exp(-exponent) / (4.0 * np.pi * alpha_x * alpha_y * np.sqrt(cosines))
        return np.where((wi[..., 2] >= 0.0) & (wr[..., 2] >= 0.0), rho_d / np.pi + lobe, 0.0)

    return {ward_half_vector: by_vectors(vectors), ward_half_vector_vectors: vectors}


def turned() -> dict[Function, Function]:
    """Return all four forms with light from the other side, as if d_i pointed along the light."""
    return each_form(lambda right: lambda wi, wr, **surface: right(np.asarray(wi) * [-1, -1, 1], wr, **surface))


def folded() -> dict[Function, Function]:
    """Return all four forms times the cosine of the viewer."""
    return each_form(lambda right: lambda wi, wr, **surface: right(wi, wr, **surface) * np.asarray(wr)[..., 2])


def taken(wrong: Function, right: Function) -> dict[Function, Function]:
    """Return a wrong form in place of the right one, of angles and of vectors."""
    return {right: wrong, FORMS[right]: FORMS[wrong]}


def mean(surface: dict[str, Any]) -> dict[str, Any]:
    """Return the parameters with the geometric mean of both alphas."""
    alpha = np.sqrt(surface["alpha_x"] * surface["alpha_y"])
    return {**surface, "alpha_x": alpha, "alpha_y": alpha}


def swapped(surface: dict[str, Any]) -> dict[str, Any]:
    """Return the parameters with both alphas exchanged."""
    return {**surface, "alpha_x": surface["alpha_y"], "alpha_y": surface["alpha_x"]}


UNCHANGED = (
    Mutant("eqs 5a and 5b anew", "nothing", "the twins that the other mutants change",
           {**elliptical(printed), **half_vector(factor=2.0)}),
)  # fmt: skip

MUTANTS = (
    Mutant("eq. 5b for 5a", "the half-vector form is taken for the model itself",
           "the paper calls it an approximation that is convenient to compute",
           taken(ward_half_vector, ward)),
    Mutant("eq. 5a for 5b", "the half-vector form is taken for the same as the model", "the two agree at the peak",
           taken(ward, ward_half_vector)),
    Mutant("eq. 5b without its 2", "the exponent is -(..) / (1 + h.n)",
           "(1 + h.n) / 2 is 1 at the peak, where the two are compared", half_vector(factor=1.0)),
    Mutant("half of rho_s", "the specular reflectance is half as large",
           "light and viewer share a lobe, or two polarisations share the light", parts(lobe=0.5)),
    Mutant("rho_d without 1 / pi", "the diffuse part is rho_d", "He et al. print theirs like that, eq. 8",
           parts(diffuse=np.pi)),
    Mutant("alpha_x and alpha_y exchanged", "the lobe is turned by 90 degrees",
           "the x axis is taken along the brushing in one place and across it in another", with_surface(swapped)),
    Mutant("alpha times sqrt 2", "both alphas are larger by sqrt 2",
           "the paper calls alpha the standard deviation of slopes, which is alpha / sqrt 2", wider(np.sqrt(2.0))),
    Mutant("one alpha", "eq. 4 with sqrt(alpha_x alpha_y)", "an engine without tangents has no x axis",
           with_surface(mean)),
    Mutant("without 4", "the normalisation is 1 / (pi alpha_x alpha_y)",
           "it is the normalisation of the slopes; the 4 comes from the half vector", parts(lobe=4.0)),
    Mutant("Duer's normalisation", "1 / (cos theta_i cos theta_r) stands in place of its square root",
           "Duer 2006 proposes it, and renderers call the result Ward's model",
           taken(ward_duer, ward)),
    Mutant("Ward's normalisation in Duer's form", "the square root is left in 1 / (cos theta_i cos theta_r)",
           "the two differ by a root", taken(ward, ward_duer)),
    Mutant("Duer's normalisation in the bounded form", "the factor (h.h) / h_z^4 is left out",
           "papers call both Ward-Duer", taken(ward_duer, ward_bounded)),
    Mutant("without the root of the cosines", "1 / sqrt(cos theta_i cos theta_r) is left out",
           "it is 1 at the usual angles of a highlight",
           elliptical(lambda tan, phi, i, r, a, b: printed(tan, phi, i, r, a, b) * np.sqrt(i * r))),
    Mutant("delta for tan(delta)", "the exponent has delta^2", "eq. 7a, as printed, draws delta like that",
           elliptical(lambda tan, *rest: printed(np.arctan(tan), *rest))),
    Mutant("the angle from the mirror direction", "delta is doubled, as between the viewer and the mirror direction",
           "Phong's model has that angle",
           elliptical(lambda tan, *rest: printed(np.tan(np.minimum(2.0 * np.arctan(tan), 1.57)), *rest))),
    Mutant("alpha_x squared in the normalisation", "the lobe is divided by alpha_x^2 in place of alpha_x alpha_y",
           "eq. 4, with its one alpha, was there first",
           elliptical(lambda tan, phi, i, r, a, b: printed(tan, phi, i, r, a, b) * (b / a))),
    Mutant("exponent without the square of alpha", "the exponent is divided by alpha",
           "a width is squared in one place and not in the other",
           elliptical(one_power)),
    Mutant("light from the other side", "the lobe lies on the side of the light",
           "the paper's d_i may be read as the direction in which light travels", turned()),
    Mutant("the cosine of the viewer in f_r", "f_r is multiplied by cos(theta_r)",
           "intensity, which a photometer on an arm measures, has this cosine", folded()),
    *added_figures.WARD,
)  # fmt: skip
