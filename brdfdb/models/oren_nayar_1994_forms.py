"""Forms of the models of Oren and Nayar 1994 that charts compare: integrated facets and approximations of them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import counted
from brdfdb.models._oren_nayar_facets import NODES
from brdfdb.models.fujii_2013 import oren_nayar_fujii_vectors
from brdfdb.models.lambert import lambert_vectors
from brdfdb.models.oren_nayar_1994 import oren_nayar_qualitative_vectors, oren_nayar_vectors
from brdfdb.models.oren_nayar_1994_surfaces import PartName, gaussian_part, gaussian_rung, single_slope_mean
from brdfdb.models.portsmouth_2025 import oren_nayar_energy_preserving_vectors
from brdfdb.models.torrance_sparrow_1967 import torrance_sparrow_vectors
from brdfdb.parameters import Arguments, Floats, FormKind, ModelForm

_NODES = (8, 6, 4, 3, 2, 1)  # nodes of the coarser quadratures of the facets; the exact form has 16
# Slopes of eq. 25 over the closed forms. 2000 slopes change the mean of f_r by 3e-5 and no value by more than 1e-3
_SLOPES = 24
_WIDEST = 6.0  # range of the integral over slopes, in standard deviations


def forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms at the albedo and sigma of a model. The surface of the body and surface model is added to each.

    The integrated facets come first. Forms with a bounce approximate facets with a bounce. Forms without it approximate
    facets in direct light.
    """
    sigma = float(arguments["sigma"])
    bounces = bool(arguments.get("interreflection", True))

    def form(
        key: str,
        title: str,
        kind: FormKind,
        python: str,
        body: Callable[..., Floats],
        constants: int = 0,
        single: bool = False,
        degree: Literal[1, 2] | None = 2,
        **more: Any,
    ) -> ModelForm:
        def vectors(wi: Floats, wr: Floats, **given: Any) -> Floats:
            f_r = body(wi, wr, rho=given["rho"], sigma=sigma, **more)
            if "k_s" in given:
                surface = torrance_sparrow_vectors(wi, wr, sigma=sigma)
                # Eq. (32)
                f_r = given["k_b"] * f_r + given["k_s"] / given["e_0"] * surface
            return f_r

        return ModelForm(key, title, kind, f"models.{python}", vectors, 8 * (2 + len(more) + constants), single, degree)

    facets = functools.partial(gaussian_rung, nodes=NODES, bounce=bounces)
    title = "facets integrated, eqs 8-20 and 47"
    yield form("facets", title, "exact", "oren_nayar_gaussian", facets, 2 * NODES, single=True)
    for nodes in _NODES:
        rung = functools.partial(gaussian_rung, nodes=nodes, bounce=bounces)
        title = f"facets, {counted(nodes, 'node')} of {NODES}"
        python = "oren_nayar_1994_surfaces.gaussian_rung"
        yield form(f"facets-{nodes}", title, "quadrature", python, rung, 2 * (NODES + nodes))
    averaged = "oren_nayar_1994_surfaces.single_slope_mean"
    closed = functools.partial(_over_slopes, bounce=bounces)
    equations = "eqs 45 and 49" if bounces else "eq. 45"
    yield form("closed-forms", f"closed forms of B.2, {equations}", "closed form", averaged, closed, 3 * _SLOPES)
    if bounces:
        both = 3 * _SLOPES + 2 * NODES
        own_bounce = _mixed("direct", functools.partial(_over_slopes, lit=False))
        yield form("bounce-49", "facets, but eq. 49 for the bounce", "printed", averaged, own_bounce, both)
        own_direct = _mixed("interreflected", functools.partial(_over_slopes, bounce=False))
        yield form("direct-45", "facets, but eq. 45 for direct light", "closed form", averaged, own_direct, both)
    fit, title = oren_nayar_vectors, "functional fit, eqs 27-29"
    yield form("fit", title, "approximation", "oren_nayar", fit, single=True, interreflection=bounces)
    if bounces:
        title = "fit without bounce, eq. 27"
        yield form("fit-direct", title, "approximation", "oren_nayar", fit, interreflection=False)
    for key, title, offset in (
        ("qualitative", "qualitative, eq. 30", 0.33),
        ("qualitative-057", "qualitative, 0.57 (note 7)", 0.57),
    ):
        rough = oren_nayar_qualitative_vectors
        yield form(key, title, "approximation", "oren_nayar_qualitative", rough, offset=offset)
    if sigma <= 1.0:
        yield form("fujii", "Fujii's form", "approximation", "oren_nayar_fujii", oren_nayar_fujii_vectors)
        yield form("eon", "energy preserving (EON)", "other model", "oren_nayar_energy_preserving", _eon, degree=None)
    yield form("lambert", "Lambert, no roughness", "approximation", "lambert", _smooth)


def _eon(wi: Floats, wr: Floats, *, rho: float, sigma: float) -> Floats:
    return oren_nayar_energy_preserving_vectors(wi, wr, rho=rho, roughness=sigma)


def _smooth(wi: Floats, wr: Floats, *, rho: float, **_: float) -> Floats:
    return lambert_vectors(wi, wr, rho=rho)


def _mixed(facets: PartName, other: Callable[..., Floats]) -> Callable[..., Floats]:
    """Return a function of vectors that takes one part from the facets and the other part from another form."""

    def evaluate(wi: Floats, wr: Floats, **own: float) -> Floats:
        return gaussian_part(wi, wr, **own, part=facets) + other(wi, wr, **own)

    return evaluate


def _over_slopes(wi: Floats, wr: Floats, *, rho: float, sigma: float, lit: bool = True, bounce: bool = True) -> Floats:
    """Return f_r [1/sr] of the closed forms, eqs 45 and 49, averaged over slopes by the weights of eqs 25 and 26."""
    theta_a, weight = _slopes(sigma)
    return single_slope_mean(wi, wr, rho=rho, theta_a=theta_a, weight=weight, lit=lit, bounce=bounce)


@functools.cache
def _slopes(sigma: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return slopes [rad] and their weights [1], which add up to 1, each of shape (_SLOPES,)."""
    x, w = np.polynomial.legendre.leggauss(_SLOPES)
    deviation = max(sigma, 1e-9)  # above 0, because all slopes of a flat surface are 0
    theta_a = (x + 1.0) * min(np.pi / 2, _WIDEST * deviation) / 2.0
    weight = w * np.exp(-(theta_a**2) / (2.0 * deviation**2)) * np.sin(theta_a)
    return theta_a, weight / weight.sum()
