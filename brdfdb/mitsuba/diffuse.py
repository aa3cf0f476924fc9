"""Minnaert's law, and the models of land and planets RPV, Ross-Li and Hapke, in Dr.Jit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr

from brdfdb.mitsuba._parameters import Parameters
from brdfdb.mitsuba._surface import DIFFUSE, Formula, Values
from brdfdb.models import MODELS

_LEAST = 1e-30
_LEAST_COS = 6.1e-17  # cosine of the horizon: models with a pole there stay finite
_LARGEST = 1e38  # f_r [1/sr] at a pole stops here
_HEIGHT = 2.0  # h / b of Li's crowns


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


def _rough(wi: Any, wo: Any, tan_slope: Any) -> tuple[Any, Any, Any]:
    """Return the effective cosines of the direction nearer to the normal and of the other, over chi; S over both."""
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
    # Eqs. (47), (48), (50), (51); of E_1 and E_2 what is missing to 1, so that nothing cancels at the horizon
    below = m1_f + turned * m1_n + (2.0 * dr.inv_pi) * dr.atan2(s_h, c_h)
    of_psi = dr.square(s_h)
    mu_n = cos_n + sin_n * tan_slope * ((m2_f - m2_n) + of_psi * (1.0 - 2.0 * m2_f + m2_n)) / below
    mu_f = cos_f + sin_f * tan_slope * ((m2_n - m2_f) + of_psi * (1.0 - m2_n)) / below
    # The same for an azimuth of 0, of each direction alone
    eta_n = cos_n + sin_n * tan_slope * (1.0 - m2_n) / (1.0 + m1_n)
    eta_f = cos_f + sin_f * tan_slope * (1.0 - m2_f) / (1.0 + m1_f)
    hidden = one_less_exp(2.0 * c_h / s_h)
    return mu_n, mu_f, 1.0 / (eta_n * (hidden + (1.0 - hidden) * cos_n / eta_n)) / eta_f


def _leaning(cos: Any, sin: Any, tan_slope: Any) -> tuple[Any, Any]:
    """Return 1 - E_1 and 1 - E_2 [1] of a direction: what is missing from its share of slopes that lean away."""
    q = dr.minimum(cos / dr.maximum(sin * tan_slope, _LEAST), 1e4)
    return one_less_exp((2.0 * dr.inv_pi) * q), one_less_exp(dr.square(q) * dr.inv_pi)


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


FORMULAS: dict[str, Callable[[Any, Any, Values], Any]] = {
    "minnaert": minnaert,
    "rpv": rpv,
    "ross_li": ross_li,
    "hapke": hapke,
}


class Diffuse(Formula):
    """The plugin ``brdfdb_`` with the name of one of `FORMULAS`. Its parameters are those of that model."""

    components = (DIFFUSE,)

    def __init__(self, props: Any, model: str) -> None:
        self._formula = FORMULAS[model]
        self.parameters = Parameters(props, MODELS[model])

    def parts(self, values: Values, wi: Any, wo: Any) -> dict[str, Any]:
        """Return f_r [1/sr]."""
        return {DIFFUSE: self._formula(wi, wo, values)}
