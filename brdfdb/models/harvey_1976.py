"""Harvey 1976: scatter of polished surfaces, which depends on sines alone."""

from __future__ import annotations

from numpy.typing import ArrayLike

from brdfdb.geometry import Directions
from brdfdb.lobes import Lobe
from brdfdb.models import _stray_light
from brdfdb.models._rows import Out
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter

B_0 = Parameter("b_0", "b_0", "1/sr", 0.0, 1e9, "f_r in the mirror direction")
KNEE = Parameter("knee", "L", "1", 1e-5, 1.0, "distance from the mirror direction at which the profile bends")
SLOPE = Parameter("slope", "s", "1", -6.0, 0.0, "exponent of the profile far from the mirror direction")


def lobe(cos_i: Floats, *, knee: ArrayLike, **_: ArrayLike) -> Lobe:
    """Return a lobe as wide as the knee."""
    return _stray_light.lobe(cos_i, knee)


@DeclaredModel(
    title="Harvey-Shack scatter",
    equation="b_0 (1 + (x / L)^2)^(s / 2)",
    references="harvey1976, fest2013",
    parameters=(B_0, KNEE, SLOPE),
    grazing_power=0.0,
    lobe=lobe,
    excess="Harvey 1976: a fit to measured scatter, not normalised; b_0 may be so large that more light is scattered "
    "than arrives",
)
def harvey_shack(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of Harvey and Shack's scatter, b_0 (1 + (x / L)^2)^(s / 2).

    x is the distance of beta, the horizontal part of the viewer's unit vector, from beta_0, that of the mirror
    direction: x = abs(beta - beta_0). So f_r is a function of sines, the same at any angle of incidence. The specular
    reflection itself is not a part of it. A slope of -2 is `abg` with g = 2, b = L^2 and a = b_0 L^2. The light
    scattered at normal incidence is 2 pi b_0 L^2 ((1 + 1 / L^2)^(1 + s / 2) - 1) / (s + 2).
    Polished surfaces have a slope of -2.5 to -0.5.

    >>> round(float(harvey_shack(0.3, 0.0, 0.31, np.pi, b_0=0.1, knee=0.01, slope=-1.5)), 5)
    0.06155
    """
    return _stray_light.HARVEY_LOOPS.evaluated(directions, out, parameters)
