"""The reflectance models: public functions, one module a paper, and the MODELS registry.

Every function has the call shape ``f(theta_i, phi_i, theta_r, phi_r, *, parameters)``: radians in, f_r in 1/sr out,
broadcasting over angles and parameters, the cosine never folded in.
"""

from brdfdb.models import he_torrance_1991, oren_nayar_1994, ward_1992
from brdfdb.models import lambert as _lambert
from brdfdb.models import minnaert as _minnaert
from brdfdb.models.he_torrance_1991 import he_torrance, he_torrance_specular, he_torrance_vectors
from brdfdb.models.lambert import lambert, lambert_vectors
from brdfdb.models.minnaert import minnaert, minnaert_vectors
from brdfdb.models.oren_nayar_1994 import (
    oren_nayar,
    oren_nayar_qualitative,
    oren_nayar_qualitative_vectors,
    oren_nayar_vectors,
)
from brdfdb.models.ward_1992 import ward, ward_vectors
from brdfdb.parameters import ModelSpec

MODELS: dict[str, ModelSpec] = {
    spec.name: spec
    for spec in (
        _lambert.SPEC,
        _minnaert.SPEC,
        oren_nayar_1994.SPEC,
        oren_nayar_1994.QUALITATIVE_SPEC,
        ward_1992.SPEC,
        he_torrance_1991.SPEC,
    )
}

__all__ = [
    "MODELS",
    "he_torrance",
    "he_torrance_specular",
    "he_torrance_vectors",
    "lambert",
    "lambert_vectors",
    "minnaert",
    "minnaert_vectors",
    "oren_nayar",
    "oren_nayar_qualitative",
    "oren_nayar_qualitative_vectors",
    "oren_nayar_vectors",
    "ward",
    "ward_vectors",
]
