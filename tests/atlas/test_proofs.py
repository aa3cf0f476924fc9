"""The physical proofs: every entry has a proof that its right form passes and its printed form fails."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from brdfdb.atlas import _proofs
from brdfdb.atlas._proofs import PROOFS, proved
from brdfdb.misprints import MISPRINTS, Misprint

every_misprint = pytest.mark.parametrize("entry", MISPRINTS, ids=lambda entry: entry.key)


def test_every_misprint_has_a_proof() -> None:
    assert {entry.key for entry in MISPRINTS} == set(PROOFS)


@every_misprint
def test_the_right_form_obeys_the_law_and_the_printed_one_breaks_it(entry: Misprint) -> None:
    statement = proved(entry, PROOFS[entry.key], "")
    assert statement.holds, statement.seen


@every_misprint
def test_a_proof_that_either_form_fails_or_passes_does_not_hold(entry: Misprint) -> None:
    proof = PROOFS[entry.key]
    assert not proved(replace(entry, as_printed=entry.corrected), proof, "").holds
    assert not proved(replace(entry, corrected=entry.as_printed), proof, "").holds


# The laws themselves


@pytest.mark.parametrize("slope_deg", [10.0, 45.0, 60.0])
def test_rays_in_a_groove_lit_and_seen_along_the_normal(slope_deg: float) -> None:
    slope = math.radians(slope_deg)
    cos = math.cos(slope)
    direct, bounce = (_proofs.traced(0.0, 0.0, 0.0, slope, 0.7, points) for points in (0, 400))
    assert direct == pytest.approx(cos / math.pi, rel=1e-12)
    # A facet sends the share 1 - cos(theta_a) to the other one, by crossed strings
    assert bounce == pytest.approx(cos * (1.0 - cos) / math.pi, rel=2e-3)


def test_grazing_light_leaves_the_facet_that_faces_it_lit_at_the_top() -> None:
    # Light at 80 degrees lights 2 cos(80) cos(45) / cos(35) of a facet with a slope of 45 degrees, eq. 35
    x = (np.arange(100_000) + 0.5) / 100_000
    towards = np.array([math.sin(math.radians(80.0)), 0.0, math.cos(math.radians(80.0))])
    lit = _proofs._facet(x, towards, math.radians(45.0), 0.0)
    expected = 2.0 * math.cos(math.radians(80.0)) * math.cos(math.radians(45.0)) / math.cos(math.radians(35.0))
    assert lit.mean() == pytest.approx(expected, abs=1e-5)
    assert lit[-1]
    assert not lit[0]


def test_the_area_that_is_seen_has_closed_forms_at_both_ends() -> None:
    share, area = _proofs._seen(0.0, 0.3)
    assert (share, area) == pytest.approx((1.0, 1.0), abs=1e-9)
    share, area = _proofs._seen(math.pi / 2, 0.3)
    assert (share, area) == pytest.approx((0.5, 0.3 / math.sqrt(math.pi)), rel=1e-6)


@pytest.mark.parametrize(("g", "V"), [(0.5, 0.0), (0.5, 3.0), (4.0, 1.0)])
def test_the_integral_of_eq_56_is_the_sum_of_its_waves(g: float, V: float) -> None:
    terms = (g**m * math.exp(-g - V / m) / (math.factorial(m) * m) for m in range(1, 60))
    assert _proofs._scattered(g, V) == pytest.approx(sum(terms), rel=1e-10)


def test_an_image_turns_s_and_leaves_p_in_the_plane_of_incidence() -> None:
    image = _proofs._image(0.7, 0.0, 0.7, math.pi)
    np.testing.assert_allclose(image, np.diag([1.0, -1.0]), atol=1e-15)
