"""Elementary functions of kernels: exp, log, sine, arcsin, arctan, erfc without branches, so that loops vectorise.

Those of libm do not vectorise without SVML, which pip wheels do not ship. Kernels of any file may call these functions:
this file is one of `_numba.SHARED`, so that their callers are compiled again after a change.
"""

from __future__ import annotations

import numpy as np

from brdfdb._numba import kernel

COS_HORIZON = 6.123233995736766e-17  # cosine of the float64 nearest pi/2: models with a pole there stay finite
BLOCK = 256  # directions in a block of a loop: their intermediate values fit into the first cache of a core

_LOG2_E = 1.4426950408889634
_LN2_HIGH = 0.6931471805598903  # has 20 bits to spare: n times it is exact
_LN2_LOW = 5.497923018708371e-14
_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it leaves the nearest integer in the low bits of the float
_EXP_UNDERFLOW = -708.0  # argument below which exp is 0, so that no number is subnormal
_TWO_OVER_PI = 0.6366197723675814
_HALF_PI_HIGH = 1.5707963267341256  # has 20 bits to spare
_HALF_PI_MIDDLE = 6.077100506303966e-11  # too
_HALF_PI_LOW = 2.0222662487959506e-21
_SQRT_HALF = np.int64(0x3FE6A09E667F3BCD)


@kernel
def exp(x: float) -> float:
    """Return e**x for x <= 700, within 2e-16 relative; 0 below -708; nan for nan."""
    shifted = x * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    # (e**r - 1 - r) / r**2, Chebyshev's series for |r| <= ln(2) / 2, to 2e-17 of e**r
    p = 2.510038549551032e-08
    p = p * r + 2.7620088445409746e-07
    p = p * r + 2.7557268459997064e-06
    p = p * r + 2.4801521295954376e-05
    p = p * r + 0.00019841269863053618
    p = p * r + 0.0013888888917213717
    p = p * r + 0.008333333333330062
    p = p * r + 0.04166666666662413
    p = p * r + 0.16666666666666669
    p = p * r + 0.5000000000000001
    p = p * r + 1.0
    p = p * r + 1.0
    bits = (np.float64(shifted).view(np.int64) + np.int64(1023)) << np.int64(52)
    return 0.0 if x < _EXP_UNDERFLOW else p * np.int64(bits).view(np.float64)


@kernel
def summand_exp(x: float) -> float:
    """Return e**x for x <= 700, 3e-13 of it where abs(x) < 100: for terms of a sum; at most 1e-300 below -700."""
    y = x * _LOG2_E
    y = -1021.0 if y < -1021.0 else y  # nan too
    shifted = y + _ROUND
    r = y - (shifted - _ROUND)
    # 2^r, coefficients ln(2)^k / k!, |r| <= 1/2: the first term left out is below 3e-13
    p = 7.054911620801121e-09
    p = p * r + 1.0178086009239696e-07
    p = p * r + 1.3215486790144305e-06
    p = p * r + 1.5252733804059838e-05
    p = p * r + 0.00015403530393381606
    p = p * r + 0.0013333558146428441
    p = p * r + 0.009618129107628477
    p = p * r + 0.055504108664821576
    p = p * r + 0.2402265069591007
    p = p * r + 0.6931471805599453
    p = p * r + 1.0
    bits = (np.float64(shifted).view(np.int64) + np.int64(1023)) << np.int64(52)
    return p * np.int64(bits).view(np.float64)


@kernel
def log(x: float) -> float:
    """Return ln(x) of a positive normal float64, within 4e-16 relative or, next to 1, absolute."""
    bits = np.float64(x).view(np.int64)
    # x = 2**n m with m in [sqrt(1/2), sqrt(2))
    n = (bits - _SQRT_HALF) >> np.int64(52)
    m = np.int64(bits - (n << np.int64(52))).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    u = s * s
    # atanh(s) / s, Chebyshev's series to 2e-18
    p = 0.0740685858736141
    p = p * u + 0.07656069851116819
    p = p * u + 0.09091823207002378
    p = p * u + 0.11111098390453225
    p = p * u + 0.14285714381638953
    p = p * u + 0.19999999999645207
    p = p * u + 0.3333333333333383
    e = float(n)
    return (2.0 * s + e * _LN2_HIGH) + (2.0 * s * u * p + e * _LN2_LOW)


@kernel
def arcsin(x: float) -> float:
    """Return the angle [rad] whose sine is x, for abs(x) <= sqrt(1/2), within 3e-16 relative."""
    u = x * x
    # arcsin(x) / x, Chebyshev's series to 5e-18
    p = 1.155747740211758
    p = p * u - 4.57753981739816
    p = p * u + 8.627094660168458
    p = p * u - 10.071307779732635
    p = p * u + 8.132568272401969
    p = p * u - 4.774714752785926
    p = p * u + 2.1185503218296082
    p = p * u - 0.7076550142614058
    p = p * u + 0.19339500225015105
    p = p * u - 0.029050122587066223
    p = p * u + 0.015552297027080917
    p = p * u + 0.01087048835022181
    p = p * u + 0.014024786117637567
    p = p * u + 0.017348920740304967
    p = p * u + 0.022372332125967096
    p = p * u + 0.030381939269829593
    p = p * u + 0.04464285723723301
    p = p * u + 0.0749999999990911
    p = p * u + 0.16666666666667013
    return x + x * u * p


@kernel
def twice_arctan(x: float) -> float:
    """Return twice the angle [rad] whose tangent is x, for abs(x) <= tan(pi/8), within 2e-16 relative.

    The tangent of half an angle with sine s and cosine c is s / (1 + c).
    """
    u = x * x
    # 2 arctan(x) / x, Chebyshev's series to 8e-18
    p = -0.03835254303505268
    p = p * u + 0.0784623112397446
    p = p * u - 0.10170864675398153
    p = p * u + 0.11716291175256403
    p = p * u - 0.13329022129198742
    p = p * u + 0.15384366327301788
    p = p * u - 0.18181809153908235
    p = p * u + 0.22222222030455144
    p = p * u - 0.2857142856933237
    p = p * u + 0.39999999999991037
    p = p * u - 0.6666666666666666
    return 2.0 * x + x * u * p


@kernel
def _quarter_turns(x: float) -> tuple[float, float, float]:
    """Return the quarter turns in x [rad], rounded, modulo 4; and the sine and cosine of the rest."""
    shifted = x * _TWO_OVER_PI + _ROUND
    n = shifted - _ROUND
    r = ((x - n * _HALF_PI_HIGH) - n * _HALF_PI_MIDDLE) - n * _HALF_PI_LOW
    u = r * r
    # Taylor series, |r| <= pi / 4: the first terms left out are below 5e-17
    s = -7.647163731819816e-13
    s = s * u + 1.6059043836821613e-10
    s = s * u - 2.505210838544172e-08
    s = s * u + 2.7557319223985893e-06
    s = s * u - 0.0001984126984126984
    s = s * u + 0.008333333333333333
    s = s * u - 0.16666666666666666
    c = 4.779477332387385e-14
    c = c * u - 1.1470745597729725e-11
    c = c * u + 2.08767569878681e-09
    c = c * u - 2.755731922398589e-07
    c = c * u + 2.48015873015873e-05
    c = c * u - 0.001388888888888889
    c = c * u + 0.041666666666666664
    c = c * u - 0.5
    return n - 4.0 * np.floor(0.25 * n), r + r * u * s, 1.0 + u * c


@kernel
def sine(x: float) -> float:
    """Return the sine of x [rad], within 2e-16 for abs(x) < 1e5 and within 2e-16 abs(x) beyond; nan for nan."""
    quarter, s, c = _quarter_turns(x)
    value = s if (quarter == 0.0) | (quarter == 2.0) else c
    return -value if quarter >= 2.0 else value


@kernel
def cos(x: float) -> float:
    """Return the cosine of x [rad], within 2e-16 for abs(x) < 1e5 and within 2e-16 abs(x) beyond; nan for nan."""
    quarter, s, c = _quarter_turns(x)
    value = c if (quarter == 0.0) | (quarter == 2.0) else s
    return -value if (quarter == 1.0) | (quarter == 2.0) else value


@kernel
def erfcx(x: float) -> float:
    """Return exp(x**2) erfc(x) for x >= 0, within 5e-15 relative; nan for nan and infinity."""
    s = (x - 3.0) / (x + 3.0)
    # (x + 3) erfcx(x), Chebyshev's series
    p = 1.9972062594364032e-09
    p = p * s - 3.0163647088882066e-09
    p = p * s - 1.4096446646126654e-08
    p = p * s + 3.4324754993970624e-08
    p = p * s + 7.387183216474504e-08
    p = p * s - 2.0587708842528483e-07
    p = p * s - 4.421895030416538e-07
    p = p * s + 9.701379284147497e-07
    p = p * s + 2.791745828000272e-06
    p = p * s - 4.730130267322778e-06
    p = p * s - 1.7483610246587185e-05
    p = p * s + 3.0389990888726035e-05
    p = p * s + 0.00010756561876940398
    p = p * s - 0.000276775630909065
    p = p * s - 0.00054831050312772
    p = p * s + 0.0030340616385449966
    p = p * s - 0.0012124165349494077
    p = p * s - 0.026827234591830017
    p = p * s + 0.11952776128195618
    p = p * s - 0.310467261901912
    p = p * s + 0.590228357104221
    p = p * s - 0.8833944531698674
    p = p * s + 1.0740069070883393
    return p / (x + 3.0)


@kernel
def cosine(z: float) -> float:
    """Return the cosine of a direction, from its z, at the horizon or above; nan for nan."""
    return COS_HORIZON if z < COS_HORIZON else z
