"""Fresnel reflection at a plane interface: reflectance of unpolarised light, and complex amplitudes of s and p."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._numba import elementwise, kernel, loop
from brdfdb.arrays import array_function

Array = NDArray[np.float64]

_SQRT_HALF = 0.7071067811865476


@kernel
def _interface(cos_theta: float, n: float, k: float) -> tuple[float, float, float, float, float]:
    """Return real and imaginary part [1] of w = (n + ik)^2 - 1, real part of 1 + w, and both of q = sqrt(cos^2 + w).

    q is the root with parts that are not negative. With the time factor exp(-i omega t) its wave travels and decays
    away from the surface. The difference that cancels as n -> 1 is taken once, in w.
    """
    cos2 = cos_theta * cos_theta
    sin2 = (1.0 - cos_theta) * (1.0 + cos_theta)
    e_re = (n - k) * (n + k)  # 1 + w, which keeps its digits as n -> 0
    # n - 1 is rounded to 15 decimals. An index is typed as a decimal, and the float64 nearest to 1.000001 has an error
    # of 8e-11 of n - 1
    n_less_1: float = np.floor((n - 1.0) * 1e15 + 0.5) * 1e-15
    w_re = n_less_1 * (n_less_1 + 2.0) - k * k
    w_im = 2.0 * n * k
    # q = a + ib is the root with a, b >= 0. The one of the two that does not cancel gives the other
    q2_re = cos2 + w_re if cos2 < 0.5 else e_re - sin2
    modulus = math.sqrt(q2_re * q2_re + w_im * w_im)
    large = math.sqrt(0.5 * (modulus + abs(q2_re)))
    small = w_im / (2.0 * (large if large > 0.0 else 1.0))
    a = large if q2_re >= 0.0 else small
    b = small if q2_re >= 0.0 else large
    return w_re, w_im, e_re, a, b


@kernel
def reflectance_quotient(cos_theta: float, n: float, k: float) -> tuple[float, float]:
    """Return numerator and denominator of |F|^2 = (|F_s|^2 + |F_p|^2) / 2 at an interface from vacuum to n + ik.

    With w and q of `_interface`, F_s = -w / (cos + q)^2 and F_p = w (cos^2 (1 + w) - sin^2) / ((1 + w) cos + q)^2.
    These equal the textbook quotients but do not cancel as n -> 1.
    """
    w_re, w_im, e_re, a, b = _interface(cos_theta, n, k)
    cos2 = cos_theta * cos_theta
    sin2 = (1.0 - cos_theta) * (1.0 + cos_theta)
    w_abs2 = w_re * w_re + w_im * w_im
    # F_s^2 = w_abs2 / d_s2
    d_s = (cos_theta + a) * (cos_theta + a) + b * b
    d_s2 = d_s * d_s
    # F_p^2 = w_abs2 num2 / d_p2
    num_re = cos2 * e_re - sin2
    num_im = cos2 * w_im
    num2 = num_re * num_re + num_im * num_im
    den_re = e_re * cos_theta + a
    den_im = w_im * cos_theta + b
    d_p = den_re * den_re + den_im * den_im
    d_p2 = d_p * d_p
    # n = 1, k = 0 is no interface, and 0 / 0 at grazing
    return 0.5 * w_abs2 * (d_p2 + num2 * d_s2), 1.0 if w_abs2 == 0.0 else d_s2 * d_p2


@kernel
def reflectance(cos_theta: float, n: float, k: float) -> float:
    """Return |F|^2 [1] of unpolarised light at an interface from vacuum to the complex index n + ik."""
    above, below = reflectance_quotient(cos_theta, n, k)
    both = above / below
    return 1.0 if both > 1.0 else both  # rounding exceeds 1 by 4e-16 in total reflection


@kernel
def _half_sum_and_difference(cos_theta: float, n: float, k: float) -> tuple[complex, complex]:
    """Return (F_s + F_p) / 2 = T sin^2 and (F_s - F_p) / 2 = T q cos [1], T = -w / ((cos + q) ((1 + w) cos + q)).

    The first is 0 at normal incidence and the second at grazing. In this form neither is a difference that cancels.
    """
    w_re, w_im, e_re, a, b = _interface(cos_theta, n, k)
    if w_re == 0.0 and w_im == 0.0:  # no interface, and 0 / 0 at grazing
        return complex(0.0, 0.0), complex(0.0, 0.0)
    sin2 = (1.0 - cos_theta) * (1.0 + cos_theta)
    T = -complex(w_re, w_im) / (complex(cos_theta + a, b) * complex(e_re * cos_theta + a, w_im * cos_theta + b))
    return T * sin2, T * complex(a * cos_theta, b * cos_theta)


@kernel
def _amplitudes(cos_theta: float, n: float, k: float) -> tuple[complex, complex]:
    """Return F_s and F_p [1] as in `reflectance_quotient`."""
    w_re, w_im, e_re, a, b = _interface(cos_theta, n, k)
    if w_re == 0.0 and w_im == 0.0:  # no interface, and 0 / 0 at grazing
        return complex(0.0, 0.0), complex(0.0, 0.0)
    w = complex(w_re, w_im)
    cos2 = cos_theta * cos_theta
    sin2 = (1.0 - cos_theta) * (1.0 + cos_theta)
    d_s = complex(cos_theta + a, b)
    d_p = complex(e_re * cos_theta + a, w_im * cos_theta + b)
    return -w / (d_s * d_s), w * complex(cos2 * e_re - sin2, cos2 * w_im) / (d_p * d_p)


@kernel
def reflectance_slopes(cos_theta: float, n: float, k: float) -> tuple[float, float]:
    """Return the derivatives [1] of |F|^2 of unpolarised light by n and by k.

    F_s and F_p are analytic in n + ik, so that the derivative of |F|^2 by n is 2 Re(conj(F) F') and by k
    -2 Im(conj(F) F'). At the onset of total reflection (q = 0) both are infinite, and 0 here.
    """
    F_s, F_p = _amplitudes(cos_theta, n, k)
    w_re, w_im, e_re, a, b = _interface(cos_theta, n, k)
    q = complex(a, b)
    if a == 0.0 and b == 0.0:
        return 0.0, 0.0
    index = complex(n, k)
    d_s = complex(cos_theta + a, b)
    d_p = complex(e_re * cos_theta + a, w_im * cos_theta + b)
    common = 2.0 * cos_theta * index / q
    slope_s = -common / (d_s * d_s)
    # 2 q^2 - (1 + w), in a form that keeps its digits
    cos_2theta = (cos_theta - _SQRT_HALF) * (cos_theta + _SQRT_HALF) * 2.0
    slope_p = common * complex(cos_2theta + w_re, w_im) / (d_p * d_p)
    both = F_s.conjugate() * slope_s + F_p.conjugate() * slope_p
    return both.real, -both.imag


@loop
def _fill(
    halves: bool, cos_theta: Array, n: Array, k: Array, first: NDArray[np.complex128], second: NDArray[np.complex128]
) -> None:
    for j in range(cos_theta.shape[0]):
        if halves:
            first[j], second[j] = _half_sum_and_difference(cos_theta[j], n[j], k[j])
        else:
            first[j], second[j] = _amplitudes(cos_theta[j], n[j], k[j])


unpolarised = elementwise(reflectance)

Complexes = NDArray[np.complexfloating]


@array_function
def amplitudes(cos_theta: ArrayLike, n: ArrayLike, k: ArrayLike) -> tuple[Complexes, Complexes]:
    """Return complex F_s and F_p [1], the ratios of reflected to incident field, for the index n + ik.

    The time factor is exp(-i omega t). At normal incidence F_p = -F_s = (n + ik - 1) / (n + ik + 1), because reflection
    reverses p = s x (direction of propagation). At grazing both are -1.
    """
    return _pair(False, cos_theta, n, k)


@array_function
def half_sum_and_difference(cos_theta: ArrayLike, n: ArrayLike, k: ArrayLike) -> tuple[Complexes, Complexes]:
    """Return (F_s + F_p) / 2 and (F_s - F_p) / 2 [1] of `amplitudes`, with all digits where one of them is nearly 0."""
    return _pair(True, cos_theta, n, k)


def _pair(halves: bool, cos_theta: ArrayLike, n: ArrayLike, k: ArrayLike) -> tuple[Complexes, Complexes]:
    arrays = np.broadcast_arrays(*(np.asarray(array, dtype=np.float64) for array in (cos_theta, n, k)))
    first, second = np.empty((2, arrays[0].size), dtype=np.complex128)
    _fill(halves, np.ravel(arrays[0]), np.ravel(arrays[1]), np.ravel(arrays[2]), first, second)
    shape = arrays[0].shape
    return first.reshape(shape)[()], second.reshape(shape)[()]
