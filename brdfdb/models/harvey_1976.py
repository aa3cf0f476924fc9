"""Harvey 1976: scatter of polished surfaces, which depends on sines alone."""

from __future__ import annotations

from numpy.typing import ArrayLike

from brdfdb.lobes import Lobe
from brdfdb.models import _stray_light
from brdfdb.models._stray_light import HARVEY, by_angles, by_vectors
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, ModelSpec, Parameter

B_0 = Parameter("b_0", "b_0", "1/sr", 0.0, 1e9, "f_r in the mirror direction")
KNEE = Parameter("knee", "L", "1", 1e-5, 1.0, "distance from the mirror direction at which the profile bends")
SLOPE = Parameter("slope", "s", "1", -6.0, 0.0, "exponent of the profile far from the mirror direction")


@for_large_calls
def harvey_shack(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    b_0: ArrayLike,
    knee: ArrayLike,
    slope: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of Harvey and Shack's scatter, b_0 (1 + (x / L)^2)^(s / 2).

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    b_0 : array_like [1/sr]
        f_r in the mirror direction, in [0, 1e9].
    knee : array_like [1]
        Distance x at which the profile bends, L, in [1e-5, 1].
    slope : array_like [1]
        Exponent of x beyond the knee, s, in [-6, 0]. Polished surfaces have -2.5 to -0.5.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    x is the distance of beta, the horizontal part of the viewer's unit vector, from beta_0, that of the mirror
    direction: x = abs(beta - beta_0). So f_r is a function of sines, the same at any angle of incidence. The specular
    reflection itself is not a part of it. A slope of -2 is `abg` with g = 2, b = L^2 and a = b_0 L^2. The light
    scattered at normal incidence is 2 pi b_0 L^2 ((1 + 1 / L^2)^(1 + s / 2) - 1) / (s + 2).

    References
    ----------
    harvey1976, fest2013

    Examples
    --------
    >>> import numpy as np
    >>> round(float(harvey_shack(0.3, 0.0, 0.31, np.pi, b_0=0.1, knee=0.01, slope=-1.5)), 5)
    0.06155
    """
    return by_angles(HARVEY, (theta_i, phi_i, theta_r, phi_r), _checked(b_0, knee, slope))


@for_large_calls
def harvey_shack_vectors(wi: ArrayLike, wr: ArrayLike, *, b_0: ArrayLike, knee: ArrayLike, slope: ArrayLike) -> Floats:
    """Return `harvey_shack` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(HARVEY, wi, wr, _checked(b_0, knee, slope))


def _checked(b_0: ArrayLike, knee: ArrayLike, slope: ArrayLike) -> tuple[Floats, Floats, Floats]:
    return B_0.check(b_0), KNEE.check(knee), SLOPE.check(slope)


def lobe(cos_i: Floats, *, knee: ArrayLike, **_: ArrayLike) -> Lobe:
    """Return a lobe as wide as the knee."""
    return _stray_light.lobe(cos_i, knee)


SPEC = ModelSpec(
    name="harvey_shack",
    version=1,
    title="Harvey-Shack scatter",
    equation="b_0 (1 + (x / L)^2)^(s / 2)",
    reference="harvey1976",
    parameters=(B_0, KNEE, SLOPE),
    evaluate=harvey_shack,
    vectors=harvey_shack_vectors,
    grazing_power=0.0,
    lobe=lobe,
    excess="Harvey 1976: a fit to measured scatter, not normalised; b_0 may be so large that more light is scattered "
    "than arrives",
)
