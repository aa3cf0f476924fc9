"""Diffuse models in Dr.Jit: Minnaert's law, RPV, Ross-Li and Hapke for land and planets, and Oren and Nayar's forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr

from brdfdb.errors import ParameterError
from brdfdb.mitsuba._parameters import PluginParameters
from brdfdb.mitsuba._surface import DIFFUSE, Formula, Values
from brdfdb.models import MODELS

_LEAST = 1e-30
_LEAST_COS = 6.1e-17  # cosine of the horizon: models with a pole there stay finite
_LARGEST = 1e38  # f_r [1/sr] at a pole stops here
_HEIGHT = 2.0  # h / b of Li's crowns
_C1 = 0.5 - 2.0 / (3.0 * dr.pi)  # of the energy-preserving model: A = 1 / (1 + C1 r)
_C2 = 2.0 / 3.0 - 28.0 / (15.0 * dr.pi)  # mean of E_FON = A (1 + C2 r)


def minnaert(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr], as `brdfdb.models.minnaert`."""
    k = values["k"]
    cos_i, cos_r = dr.maximum(wi.z, _LEAST_COS), dr.maximum(wo.z, _LEAST_COS)
    power = dr.exp((k - 1.0) * (dr.log(cos_i) + dr.log(cos_r)))
    return values["rho"] * ((k + 1.0) * 0.5 * dr.inv_pi * power)


def rpv(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr], as `brdfdb.models.rpv`."""
    asymmetry = values["asymmetry"]
    size = dr.abs(asymmetry)
    cos_i, cos_r = dr.maximum(wi.z, _LEAST_COS), dr.maximum(wo.z, _LEAST_COS)
    d, s = wi - wo, wi + wo
    # F: 1 + Theta^2 + 2 Theta cos(g), where 2 cos(g) is s.s - 2 or 2 - d.d. Neither sum cancels
    q = dr.square(1.0 - size) + size * dr.select(asymmetry < 0.0, dr.squared_norm(d), dr.squared_norm(s))
    # G: the distance of tan(theta) (cos(phi), sin(phi)) of light and viewer is N / (cos_i cos_r)
    n_x, n_y = d.x * s.z - d.z * s.x, d.y * s.z - d.z * s.y
    N, product = 0.5 * dr.sqrt(dr.maximum(dr.square(n_x) + dr.square(n_y), _LEAST)), cos_i * cos_r
    # M: (cos_i cos_r (cos_i + cos_r))^(k - 1)
    M = dr.exp((values["k"] - 1.0) * (dr.log(cos_i) + dr.log(cos_r) + dr.log(cos_i + cos_r)))
    # R: 1 + (1 - rho_c) / (1 + G)
    level = values["rho_0"] * dr.inv_pi * (1.0 - size) * (1.0 + size)
    value = level * M / (q * dr.sqrt(q)) * ((product * (2.0 - values["rho_c"]) + N) / (product + N))
    return dr.minimum(value, _LARGEST)


def ross_li(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr], as `brdfdb.models.ross_li`."""
    cos_i, cos_r = dr.maximum(wi.z, _LEAST_COS), dr.maximum(wo.z, _LEAST_COS)
    # The sine and cosine of half the phase angle xi keep their digits at the hot spot and opposite to it
    c, s = 0.5 * _length(wi - wo), 0.5 * _length(wi + wo)
    above = cos_i + cos_r
    sin_xi, cos_xi = 2.0 * s * c, (s - c) * (s + c)
    phase = (0.5 * dr.pi - 2.0 * dr.asin(dr.minimum(dr.minimum(c, s), 1.0))) * dr.abs(cos_xi) + sin_xi
    k_vol = phase / above - 0.25 * dr.pi
    # Li: cos(t) = h/b sqrt(D^2 + (tan tan sin(delta_phi))^2) / (sec + sec), whose root is sin(xi) / (cos cos)
    cos_t = dr.minimum(_HEIGHT * sin_xi / above, 1.0)
    sin_t = dr.sqrt(dr.maximum((1.0 - cos_t) * (1.0 + cos_t), _LEAST))
    # O - sec - sec + (1 + cos(xi)) sec sec / 2
    lit = 1.0 - (dr.atan2(sin_t, cos_t) - sin_t * cos_t) * dr.inv_pi
    k_geo = (0.25 * dr.squared_norm(wi + wo) - above * lit) / (cos_i * cos_r)
    value = values["f_iso"] + values["f_vol"] * k_vol + values["f_geo"] * k_geo
    return dr.clip(value * dr.inv_pi, 0.0, _LARGEST)


def hapke(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr], as `brdfdb.models.hapke`."""
    w, b, c = values["w"], values["b"], values["c"]
    d2, s2 = dr.squared_norm(wi - wo), dr.squared_norm(wi + wo)
    # Two functions of Henyey and Greenstein; 2 cos(g) is s.s - 2 and 2 - d.d
    forth, back = dr.square(1.0 - b) + b * s2, dr.square(1.0 - b) + b * d2
    grain = (1.0 - b) * (1.0 + b) * ((1.0 - c) / (forth * dr.sqrt(forth)) + c / (back * dr.sqrt(back)))
    # B_0 / (1 + tan(g / 2) / h)
    d, s = dr.sqrt(dr.maximum(d2, _LEAST)), dr.sqrt(dr.maximum(s2, _LEAST))
    hot = values["b_0"] * values["h"] * s / (values["h"] * s + d)
    tan_slope = dr.tan(values["theta_bar"])
    mu_n, mu_f, shadow = _rough(wi, wo, tan_slope)
    chi = dr.rsqrt(1.0 + dr.pi * dr.square(tan_slope))
    gamma = dr.sqrt(dr.maximum(1.0 - w, _LEAST))
    r_0 = (1.0 - gamma) / (1.0 + gamma)
    y_n, y_f = _unscattered(w, r_0, chi * mu_n), _unscattered(w, r_0, chi * mu_f)
    # H(mu_0) H(mu) - 1, which is small at grazing
    multiple = (y_n + y_f - y_n * y_f) / ((1.0 - y_n) * (1.0 - y_f))
    return w * (0.25 * dr.inv_pi) * (mu_n * (mu_f / (mu_n + mu_f)) * shadow) * (grain * (1.0 + hot) + multiple)


class _Roughness(NamedTuple):
    """Effective cosines of the direction nearer to the normal and of the farther one, over chi; S over both."""

    mu_n: Any
    mu_f: Any
    shadow: Any


def _rough(wi: Any, wo: Any, tan_slope: Any) -> _Roughness:
    """Return the effect of Hapke's macroscopic roughness."""
    sin_i, sin_r = _horizontal(wi), _horizontal(wo)
    cos_i, cos_r = dr.maximum(wi.z, _LEAST_COS), dr.maximum(wo.z, _LEAST_COS)
    nearer = cos_i >= cos_r
    cos_n, sin_n = dr.select(nearer, cos_i, cos_r), dr.select(nearer, sin_i, sin_r)
    cos_f, sin_f = dr.select(nearer, cos_r, cos_i), dr.select(nearer, sin_r, sin_i)
    # Sine and cosine of half the azimuth between both
    x_i, y_i, x_r, y_r = wi.x / sin_i, wi.y / sin_i, wo.x / sin_r, wo.y / sin_r
    c_h = 0.5 * dr.sqrt(dr.maximum(dr.square(x_i - x_r) + dr.square(y_i - y_r), _LEAST))
    s_h = 0.5 * dr.sqrt(dr.maximum(dr.square(x_i + x_r) + dr.square(y_i + y_r), _LEAST))
    turned = (2.0 * dr.inv_pi) * dr.atan2(c_h, s_h)  # psi / pi
    (m1_n, m2_n), (m1_f, m2_f) = _leaning(cos_n, sin_n, tan_slope), _leaning(cos_f, sin_f, tan_slope)
    # Eqs. (47), (48), (50), (51), with 1 - E_1 and 1 - E_2, so that nothing cancels at the horizon
    below = m1_f + turned * m1_n + (2.0 * dr.inv_pi) * dr.atan2(s_h, c_h)
    of_psi = dr.square(s_h)
    mu_n = cos_n + sin_n * tan_slope * ((m2_f - m2_n) + of_psi * (1.0 - 2.0 * m2_f + m2_n)) / below
    mu_f = cos_f + sin_f * tan_slope * ((m2_n - m2_f) + of_psi * (1.0 - m2_n)) / below
    # The same for an azimuth of 0, of each direction alone
    eta_n = cos_n + sin_n * tan_slope * (1.0 - m2_n) / (1.0 + m1_n)
    eta_f = cos_f + sin_f * tan_slope * (1.0 - m2_f) / (1.0 + m1_f)
    hidden = one_less_exp(2.0 * c_h / s_h)
    return _Roughness(mu_n, mu_f, 1.0 / (eta_n * (hidden + (1.0 - hidden) * cos_n / eta_n)) / eta_f)


class _Leaning(NamedTuple):
    """1 - E_1 and 1 - E_2 [1] of a direction, from its share of slopes that lean away."""

    m1: Any
    m2: Any


def _leaning(cos: Any, sin: Any, tan_slope: Any) -> _Leaning:
    q = dr.minimum(cos / dr.maximum(sin * tan_slope, _LEAST), 1e4)
    return _Leaning(one_less_exp((2.0 * dr.inv_pi) * q), one_less_exp(dr.square(q) * dr.inv_pi))


def one_less_exp(x: Any) -> Any:
    """Return 1 - e^-x [1] for x >= 0, with all digits of small x."""
    series = x * (1.0 - x * (1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720))))))
    return dr.select(x < 0.3, series, 1.0 - dr.exp(-x))


def _unscattered(w: Any, r_0: Any, x: Any) -> Any:
    """Return 1 - 1 / H(x) [1], Hapke 2002."""
    return w * x * (r_0 + 0.5 * (1.0 - 2.0 * r_0 * x) * (dr.log(1.0 + x) - dr.log(x)))


def _horizontal(w: Any) -> Any:
    return dr.sqrt(dr.maximum(dr.square(w.x) + dr.square(w.y), _LEAST))


def _length(v: Any) -> Any:
    return dr.sqrt(dr.maximum(dr.squared_norm(v), _LEAST))


# Oren and Nayar 1994, as a fit and qualitative, and energy-preserving


def functional(wi: Any, wo: Any, values: Values) -> Any:
    """Return f_r [1/sr] of eq. (29), the functional fit, as `brdfdb.models.oren_nayar`."""
    rho, sigma2 = values["rho"], dr.square(values["sigma"])
    sin_i, sin_r = _horizontal(wi), _horizontal(wo)
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
    sin, cos = _horizontal(w), w.z
    versine = dr.square(cos) / (1.0 + sin)  # 1 - sin(theta)
    chord = 2.0 / 3.0 * sin * cos * (1.0 + sin + dr.square(sin)) / (1.0 + sin)
    return dr.inv_pi * ((dr.pi / 2 - 2.0 / 3.0) * versine + sin * (dr.atan2(cos, sin) + sin * cos) - chord)


FORMULAS: dict[str, Callable[[Any, Any, Values], Any]] = {
    "minnaert": minnaert,
    "rpv": rpv,
    "ross_li": ross_li,
    "hapke": hapke,
}
OREN_NAYAR = {
    "oren_nayar": functional,
    "oren_nayar_qualitative": qualitative,
    "oren_nayar_fujii": fujii,
    "oren_nayar_energy_preserving": energy_preserving,
}


class Diffuse(Formula):
    """The plugin ``brdfdb_`` with the name of one of `FORMULAS`. Its parameters are those of that model."""

    components = (DIFFUSE,)

    def __init__(self, props: Any, model: str) -> None:
        self._formula = (FORMULAS | OREN_NAYAR)[model]
        self.parameters = PluginParameters(props, MODELS[model])

    def parts(self, values: Values, wi: Any, wo: Any) -> dict[str, Any]:
        """Return f_r [1/sr]."""
        return {DIFFUSE: self._formula(wi, wo, values)}


class OrenNayar(Diffuse):
    """The plugin ``brdfdb_oren_nayar``. Its `form` is one of `OREN_NAYAR`; it has the parameters of that model."""

    def __init__(self, props: Any) -> None:
        form = props.get("form", "oren_nayar")
        if form not in OREN_NAYAR:
            raise ParameterError("form", f"{form!r} is not one of {', '.join(OREN_NAYAR)}", form, tuple(OREN_NAYAR))
        super().__init__(props, form)
