"""Samples of the plugins: Mitsuba's chi-square test of their density, and the albedo that their weights add up to."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.integrals.quadrature import directional_albedo
from tests.mitsuba.surfaces import (
    FURNACE,
    LIGHTS_DEG,
    SUBJECTS,
    Subject,
    check_samples_have_their_density,
    mean_weight,
    variant,
)

TURNED = 0.5  # away from the axes of the surface
EACH = pytest.mark.parametrize("subject", SUBJECTS, ids=str)


@EACH
def test_densities_of_samples_pass_mitsubas_chi2(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    check_samples_have_their_density(mitsuba, mitsuba.load_dict(subject.document), LIGHTS_DEG, TURNED)


@EACH
def test_weights_of_samples_add_up_to_our_albedo(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    surface = mitsuba.load_dict(subject.document)
    for theta_deg in LIGHTS_DEG:
        expected = directional_albedo(
            subject.model, np.deg2rad(theta_deg), TURNED, tolerance=1e-4, specular=True, **subject.arguments
        ).albedo
        assert mean_weight(mitsuba, surface, theta_deg, TURNED) == pytest.approx(float(expected), rel=FURNACE)
