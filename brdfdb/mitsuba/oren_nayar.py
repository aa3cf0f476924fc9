"""Oren and Nayar 1994 in Dr.Jit, as a fit and qualitative; the energy-preserving model of Portsmouth et al. 2025."""

from __future__ import annotations

from typing import Any

import drjit as dr

from brdfdb.errors import ParameterError
from brdfdb.mitsuba._parameters import Parameters
from brdfdb.mitsuba._surface import DIFFUSE, Formula, Values
from brdfdb.models import MODELS

_LEAST = 1e-30  # product of two sines below which an azimuth is undefined

_C1 = 0.5 - 2.0 / (3.0 * dr.pi)  # of EON: A = 1 / (1 + C1 r)
_C2 = 2.0 / 3.0 - 28.0 / (15.0 * dr.pi)  # mean of E_FON = A (1 + C2 r)


def functional(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr] of eq. (29), the functional fit, as `brdfdb.models.oren_nayar`."""
    rho, sigma2 = values["rho"], dr.square(values["sigma"])
    sin_i, sin_r = _sine(wi), _sine(wo)
    lower = wi.z < wo.z
    sin_alpha, cos_alpha = dr.select(lower, sin_i, sin_r), dr.select(lower, wi.z, wo.z)
    sin_beta, cos_beta = dr.select(lower, sin_r, sin_i), dr.select(lower, wo.z, wi.z)
    alpha, beta, beta_rest = dr.atan2(sin_alpha, cos_alpha), dr.atan2(sin_beta, cos_beta), dr.atan2(cos_beta, sin_beta)
    tan_beta, tan_mean = sin_beta / cos_beta, (sin_i + sin_r) / (wi.z + wo.z)
    versine_rest = dr.square(cos_alpha) / (1.0 + sin_alpha)
    inverse = 1.0 / dr.maximum(sin_i * sin_r, _LEAST)
    cos_dphi, sin_dphi = (wi.x * wo.x + wi.y * wo.y) * inverse, (wi.x * wo.y - wi.y * wo.x) * inverse
    # Eq. (27), coefficients. The forward one is sin(alpha) - (2 beta / pi)^3 without a difference of numbers near 1
    C1 = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    ratio = sigma2 / (sigma2 + 0.09)
    x = beta_rest * (2.0 / dr.pi)
    C2 = 0.45 * ratio * dr.select(cos_dphi >= 0.0, sin_alpha, x * (3.0 - x * (3.0 - x)) - versine_rest)
    C3 = 0.125 * ratio * dr.square(alpha * beta * (4.0 / dr.pi**2))
    # Eq. (28)
    bounced = 0.17 * float(values["interreflection"]) * sigma2 / (sigma2 + 0.13)
    single = C1 + C2 * tan_beta * cos_dphi + C3 * tan_mean * dr.square(sin_dphi) / (1.0 + dr.abs(cos_dphi))
    # Eqs (27) and (29)
    double = bounced * (1.0 - cos_dphi * dr.square(beta * (2.0 / dr.pi)))
    return dr.maximum(rho * dr.inv_pi * (single + rho * double), 0.0)


def qualitative(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr] of eq. (30), as `brdfdb.models.oren_nayar_qualitative`."""
    sigma2 = dr.square(values["sigma"])
    A = 1.0 - 0.5 * sigma2 / dr.maximum(sigma2 + values["offset"], _LEAST)
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    along = dr.maximum(wi.x * wo.x + wi.y * wo.y, 0.0)
    return values["rho"] * dr.inv_pi * (A + B * along / dr.maximum(wi.z, wo.z))


def energy_preserving(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr] of EON, as `brdfdb.models.oren_nayar_energy_preserving`."""
    rho, r = values["rho"], values["roughness"]
    A = 1.0 / (1.0 + _C1 * r)
    # f_ss: Fujii's lobe
    s = wi.x * wo.x + wi.y * wo.y
    single = rho * dr.inv_pi * A * dr.maximum(1.0 + r * s / dr.select(s > 0.0, dr.maximum(wi.z, wo.z), 1.0), 0.0)
    # f_ms, with the 0 / 0 at r = 0 cancelled
    mean_lost = A * r * (_C1 - _C2)
    rho_ms = dr.square(rho) * (1.0 - mean_lost) / (1.0 - rho * mean_lost)
    return single + rho_ms * (dr.inv_pi * A * r / (_C1 - _C2) * _lost(wi) * _lost(wo))


def fujii(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr] of Fujii's form of the qualitative model, as `brdfdb.models.oren_nayar_fujii`."""
    sigma = values["sigma"]
    s = wi.x * wo.x + wi.y * wo.y
    A = 1.0 / (dr.pi + (dr.pi / 2 - 2.0 / 3.0) * sigma)
    along = s / dr.select(s > 0.0, dr.maximum(wi.z, wo.z), 1.0)
    return values["rho"] * dr.maximum(A + sigma * A * along, 0.0)


def _lost(w: Any) -> Any:
    """Return (1 - E_FON) / (A r) [1], the loss of a single scattering, without a difference that cancels at grazing."""
    sin, cos = _sine(w), w.z
    versine = dr.square(cos) / (1.0 + sin)  # 1 - sin(theta)
    chord = 2.0 / 3.0 * sin * cos * (1.0 + sin + dr.square(sin)) / (1.0 + sin)
    return dr.inv_pi * ((dr.pi / 2 - 2.0 / 3.0) * versine + sin * (dr.atan2(cos, sin) + sin * cos) - chord)


def _sine(w: Any) -> Any:
    return dr.sqrt(dr.maximum(dr.square(w.x) + dr.square(w.y), _LEAST))  # its derivative at the normal is finite


_FORMULAS = {
    "oren_nayar": functional,
    "oren_nayar_qualitative": qualitative,
    "oren_nayar_fujii": fujii,
    "oren_nayar_energy_preserving": energy_preserving,
}
FORMS = tuple(_FORMULAS)


class OrenNayar(Formula):
    """The plugin ``brdfdb_oren_nayar``. Its `form` is one of `FORMS`; it has the parameters of that model."""

    components = (DIFFUSE,)

    def __init__(self, props: Any) -> None:
        form = props.get("form", "oren_nayar")
        if form not in FORMS:
            raise ParameterError("form", f"{form!r} is none of {', '.join(FORMS)}", form, FORMS)
        self._formula = _FORMULAS[form]
        self.parameters = Parameters(props, MODELS[form])

    def parts(self, values: Values, wi: Any, wo: Any) -> dict[str, Any]:
        """Return f_r [1/sr]."""
        return {DIFFUSE: self._formula(wi, wo, values)}
