"""Samples of the plugins: Mitsuba's chi-square test of their density, and the albedo that their weights add up to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from tests.mitsuba.surfaces import SUBJECTS, Subject, interaction, variant

# Lights from the normal to 85 degrees, turned away from the axes of the surface
LIGHTS_DEG, TURNED = (0.0, 20.0, 45.0, 60.0, 75.0, 85.0), 0.5
SIGNIFICANCE = 0.01  # level at which all tests of one surface together reject it by chance
# Mean weight of samples over our albedo, less 1; the largest measured is 1.1e-3
FURNACE = 3e-3
DRAWN = 1 << 18


def light_at(theta_deg: float) -> list[float]:
    light: list[float] = unit_vector(np.deg2rad(theta_deg), TURNED).tolist()
    return light


@pytest.mark.parametrize("subject", SUBJECTS, ids=str)
def test_densities_of_samples_pass_mitsubas_chi2(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    context = mitsuba.BSDFContext()
    context.type_mask = mitsuba.BSDFFlags.Glossy | mitsuba.BSDFFlags.Diffuse  # a Dirac delta has no density
    for theta_deg in LIGHTS_DEG:
        wi = mitsuba.Vector3f(*light_at(theta_deg))
        sample, density = BSDFAdapter(subject.plugin, subject.document, wi=wi, ctx=context)
        test = ChiSquareTest(SphericalDomain(), sample, density, 3, sample_count=200_000, res=101, ires=20)
        assert test.run(SIGNIFICANCE, len(LIGHTS_DEG), quiet=True), f"{theta_deg} degrees: {test.messages}"


def weights(mitsuba: Any, subject: Subject, theta_deg: float) -> Any:
    """Return weights of samples of the first channel."""
    import drjit

    # An even sequence in the unit cube: steps are powers of the root of x^4 = x + 1
    choice, u, v = (np.arange(DRAWN) * 1.2207440846057596 ** -np.array([[1.0], [2.0], [3.0]]) % 1.0).astype(np.float32)
    wi = np.tile(light_at(theta_deg), (DRAWN, 1))
    surface = mitsuba.load_dict(subject.document)
    point = mitsuba.Point2f(u, v)
    _, weight = surface.sample(mitsuba.BSDFContext(), interaction(mitsuba, wi), mitsuba.Float(choice), point)
    drjit.eval(weight)
    return np.array(weight)[0]


@pytest.mark.parametrize("subject", SUBJECTS, ids=str)
def test_weights_of_samples_add_up_to_our_albedo(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    for theta_deg in LIGHTS_DEG:
        theta = np.deg2rad(theta_deg)
        expected = directional_albedo(
            subject.model, theta, TURNED, tolerance=1e-4, specular=True, **subject.arguments
        ).albedo
        assert np.mean(weights(mitsuba, subject, theta_deg)) == pytest.approx(float(expected), rel=FURNACE)
