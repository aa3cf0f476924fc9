"""Specification of the model of He et al. 1991, with its Mueller matrices."""

from __future__ import annotations

from brdfdb.models._he_torrance_validity import G_ALONG_NORMAL, limits, lowest_cosine
from brdfdb.models.he_torrance_1991 import (
    SIGMA_0_UM,
    TAU_UM,
    A,
    forms,
    he_torrance,
    he_torrance_gradient,
    he_torrance_specular,
    he_torrance_vectors,
    lobe,
    lossless,
)
from brdfdb.models.he_torrance_1991_polarised import he_torrance_facet_mueller, he_torrance_mueller_vectors
from brdfdb.parameters import Draw, ModelSpec, Polarised

SPEC = ModelSpec(
    name="he_torrance",
    version=2,
    title="He-Torrance, unpolarised",
    equation="eqs 71-84",
    reference="he1991",
    parameters=(SIGMA_0_UM, TAU_UM, A),
    evaluate=he_torrance,
    vectors=he_torrance_vectors,
    grazing_power=0.0,
    specular=he_torrance_specular,
    specular_parameters=("wavelength_nm", "sigma_0_um", "tau_um", "n", "k"),
    spectral=True,
    uniform="a",
    lobe=lobe,
    lossless=lossless,
    forms=forms,
    highest_rung="the whole sum of eq. 78",
    diagnostic=G_ALONG_NORMAL,
    limits=limits,
    uniform_bound_cosine=lowest_cosine,
    polarised=Polarised(mueller=he_torrance_mueller_vectors, facet=he_torrance_facet_mueller),
    gradient=he_torrance_gradient,
    draw=Draw(
        (("sigma_0_um", 0.01, 5.0), ("tau_um", 0.1, 50.0), ("a", 0.0, 0.3)),
        lambda given: given["sigma_0_um"] <= given["tau_um"],
        "sigma_0_um <= tau_um: the paper holds for slopes below 1",
    ),
)
