"""Statements on samples: what known surfaces integrate to, and what is wrong with planted files."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.measurements import Samples
from brdfdb.measurements.statement import statement

LIGHTS_DEG, POLAR_DEG, TURNS_DEG = (10.0, 50.0), np.arange(0.0, 86.0, 5.0), np.arange(0.0, 360.0, 15.0)


def samples(
    values: Any = 0.5 / np.pi, polar: Any = POLAR_DEG, turns: Any = TURNS_DEG, lights: Any = LIGHTS_DEG, **changes: Any
) -> Samples:
    """Samples on a grid; `values` is a number, or a function of theta_i, theta_r and delta_phi [rad]."""
    axes = np.meshgrid(np.radians(lights), np.radians(polar), np.radians(turns), indexing="ij")
    theta_i, theta_r, delta = (axis.reshape(-1) for axis in axes)
    f_r = values(theta_i, theta_r, delta) if callable(values) else np.full(theta_i.shape, values)
    grey = Samples("sheet", theta_i, np.zeros_like(theta_i), theta_r, delta, ("grey",), None, f_r[:, np.newaxis])
    return replace(grey, **changes)


def test_a_lambertian_surface_integrates_to_its_reflectance() -> None:
    known = statement(samples())
    assert [some.albedo[0] for some in known.incidences] == pytest.approx([0.5, 0.5], rel=1e-12)
    covered = np.sin(np.radians(85.0)) ** 2
    for some in known.incidences:
        # a polygon of 24 corners within the circle of 85 degrees
        assert some.covered == pytest.approx(covered * np.sin(2.0 * np.pi / 24.0) * 24.0 / (2.0 * np.pi), rel=1e-9)
        assert some.measured[0] == pytest.approx(0.5 * some.covered, rel=1e-9)
        assert some.viewers == POLAR_DEG.size * TURNS_DEG.size
    assert known.hints == ()
    assert not known.one_side


@pytest.mark.parametrize("first", [0.0, 180.0])
def test_one_side_of_the_plane_of_incidence_is_mirrored(first: float) -> None:
    def ward(theta_i: Any, theta_r: Any, delta: Any) -> Any:
        return models.ward(theta_i, 0.0, theta_r, delta, rho_d=0.3, rho_s=0.2, alpha_x=0.4, alpha_y=0.4)

    half = statement(samples(ward, turns=first + np.arange(0.0, 181.0, 15.0)))
    full = statement(samples(ward))
    assert half.one_side
    for one, other in zip(half.incidences, full.incidences, strict=True):
        assert one.albedo == pytest.approx(other.albedo, rel=1e-4)
    assert any("mirror image" in sentence for sentence in half.sentences)


def test_samples_of_one_plane_have_no_albedo() -> None:
    known = statement(samples(turns=[0.0, 180.0]))
    assert known.incidences == ()
    assert any(sentence.startswith("No albedo") for sentence in known.sentences)


def test_reciprocity_is_that_of_samples_with_light_and_viewer_exchanged() -> None:
    def skewed(theta_i: Any, theta_r: Any, delta: Any) -> Any:
        return 0.1 + 0.1 * (theta_i > 0.5) * (theta_r < 0.5) + 0.0 * delta

    fair = statement(samples(lambda theta_i, theta_r, delta: np.cos(theta_i) * np.cos(theta_r) + 0.0 * delta))
    # 10 to 50 degrees at 24 azimuths, and 12 pairs each within 10 and within 50 degrees: those at delta and -delta
    assert fair.reciprocity.pairs == 24 + 11 + 11
    assert fair.reciprocity.largest < 1e-12
    unfair = statement(samples(skewed)).reciprocity
    assert unfair.largest == unfair.median == pytest.approx(0.1 / 0.3)  # 24 of 46 pairs are of both incidences


def test_a_claim_of_the_header_is_compared_with_its_values() -> None:
    known = statement(samples(record={"tis": [[[0.35], [0.51]]], "theta_i_deg": [10.0, 50.0]}))
    assert [claim.relative for claim in known.claims] == pytest.approx([-0.3, 0.02])
    (sentence,) = [text for text in known.sentences if "header claims" in text]
    assert "0.35 at theta_i 10" in sentence
    assert "0.5: the claim is 30 % low" in sentence
    assert "1 claim of the header agrees with its values." in known.sentences


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.9, "reflectance factors, which make 0.9 (--quantity reflectance_factor)"),
        (28.0, "f_r in percent, which make 0.88 (--quantity percent)"),
        (2e-5, "A thousand times is 0.063"),
        (0.3, ""),
        (1e-3, ""),
    ],
)
def test_units_that_cannot_be_are_hinted_at(value: float, words: str) -> None:
    hints = statement(samples(value)).hints
    assert bool(hints) == bool(words)
    assert words in "".join(hints)
    of_plane = statement(samples(value, turns=[180.0])).hints  # also where there is no albedo
    assert bool(of_plane) == bool(words)


def test_holes_and_negative_values_are_counted_and_zeros_beside_others_are_holes() -> None:
    sheet = samples()
    sheet.values[::7] = 0.0
    sheet.values[3], sheet.values[4] = np.nan, -0.01
    known = statement(sheet)
    assert (known.holes, known.negative, known.zeros) == (1, 1, int(np.sum(sheet.values == 0.0)))
    assert known.incidences[1].albedo[0] == pytest.approx(0.5, rel=1e-9)


def test_each_channel_has_its_own_holes() -> None:
    sheet = samples()
    values = sheet.values * np.array([[1.0, 2.0]])
    values[np.degrees(sheet.theta_r) > 62.0, 1] = np.nan
    known = statement(replace(sheet, channels=("450nm", "650nm"), values=values))
    assert known.incidences[0].albedo == pytest.approx((0.5, 1.0), rel=1e-9)
    assert known.incidences[0].measured[1] < 0.8


def test_a_lobe_narrower_than_the_steps_has_no_known_albedo() -> None:
    known = statement(samples(lambda i, r, delta: 0.1 + 500.0 * _in_mirror(i, r, delta)))
    assert all(some.peak > 0.8 for some in known.incidences)
    assert any("narrower than the steps" in sentence for sentence in known.sentences)
    assert known.hints == ()  # no unit is doubted for it


def test_scattered_directions_are_integrated_in_bands() -> None:
    rng = np.random.default_rng(1)
    theta_i, theta_r = np.arcsin(np.sqrt(rng.random((2, 30_000))))
    phi_i, phi_r = 2.0 * np.pi * rng.random((2, 30_000))
    values = np.cos(theta_i)[:, np.newaxis]
    known = statement(Samples("bins", theta_i, phi_i, theta_r, phi_r, ("grey",), None, values))
    assert known.in_bands
    expected = np.pi * np.cos(np.radians([10.0, 30.0, 50.0, 70.0]))
    assert [some.albedo[0] for some in known.incidences] == pytest.approx(expected, rel=0.02)


def test_the_document_is_json_with_the_sentences() -> None:
    known = statement(samples(record={"quantity": "reflectance_factor", "below_the_horizon": 2}))
    document = json.loads(json.dumps(known.document(), allow_nan=False))
    assert document["incidences"][0]["theta_i_deg"] == 10.0
    assert "The file holds reflectance factors: f_r was made of them." in document["sentences"]
    assert "2 rows below the horizon were left out." in document["sentences"]


@pytest.mark.parametrize(
    ("number", "count", "sentence"),
    [
        (-999.0, 3, "3 values are -999: do they mean missing?"),
        (-9999.0, 1, "1 value is -9999: does it mean missing?"),
        (-5.0, 2, "2 values are -5: do they mean missing?"),  # far below all others
        (-1e-3, 3, None),  # noise about a dark value
        (-5.0, 1, None),
        (9999.0, 3, "3 values are 9999: do they mean missing?"),
        (999.0, 1, "1 value is 999: does it mean missing?"),
        (120.0, 1, None),  # a lobe
    ],
)
def test_numbers_that_may_mean_missing_are_stated(number: float, count: int, sentence: str | None) -> None:
    sheet = samples()
    values = sheet.values * np.linspace(0.9, 1.1, len(sheet))[:, np.newaxis]
    values[10 : 10 + count] = number
    hints = statement(replace(sheet, values=values)).hints
    assert [hint for hint in hints if "missing" in hint] == ([sentence] if sentence else [])
    factors = replace(sheet, values=values / np.pi, record={"quantity": "reflectance_factor"})
    assert any(hint == sentence for hint in statement(factors).hints) == (sentence is not None)


def test_values_of_one_number_and_values_below_0_are_stated() -> None:
    sheet = samples()
    assert "f_r is the same at all directions: the samples do not show its shape." in statement(sheet).sentences
    varied = replace(sheet, values=sheet.values * np.linspace(0.9, 1.1, len(sheet))[:, np.newaxis])
    assert not any("do not show its shape" in sentence for sentence in statement(varied).sentences)
    assert any(hint.startswith("Sign?") for hint in statement(replace(varied, values=-varied.values)).hints)


def test_numbers_in_sentences_have_four_digits_at_most() -> None:
    for value in (1e30, 12345.678, 1e-30, 0.123456):
        for sentence in statement(samples(value)).sentences:
            for number in re.findall(r"\d+(?:\.\d+)?", sentence.replace("e+", "e").replace("e-", "e")):
                assert len(number.replace(".", "").lstrip("0")) <= 4, sentence


@pytest.mark.parametrize(("claimed", "words"), [(0.8, "1 claim of the header cannot be judged"), (0.1, "at least 0.")])
def test_a_claim_is_judged_only_where_viewers_surround_enough(claimed: float, words: str) -> None:
    polar = np.arange(0.0, 51.0, 5.0)  # they surround 58 % of the hemisphere
    known = statement(samples(polar=polar, lights=[10.0], record={"tis": [[[claimed]]], "theta_i_deg": [10.0]}))
    (claim,) = known.claims
    assert claim.at_least
    assert claim.integrated == known.incidences[0].measured[0] < 0.3
    assert claim.known == (claimed < 0.2)
    assert any(words in sentence for sentence in known.sentences)


def _lobe(at_deg: float, back: float = 0.0, grows: float = 1.0) -> Any:
    """Return f_r with a lobe at an azimuth, and one at the light with a part of its height.

    Mirror lobes grow as 1/cos^2 and narrow in azimuth to grazing lights; with `grows` of 0 lobes are round.
    """

    def f_r(theta_i: Any, theta_r: Any, delta: Any) -> Any:
        def peak(turn: float) -> Any:
            cos = np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(delta - turn)
            return np.exp(40.0 * (cos - 1.0)) * (np.cos(theta_i) * np.cos(theta_r)) ** -grows

        return 0.1 + peak(np.radians(at_deg)) + back * peak(0.0)

    return f_r


@pytest.mark.parametrize(
    ("values", "doubted"),
    [
        (_lobe(0.0), True),
        (_lobe(0.0, grows=0.0), False),
        (_lobe(180.0), False),
        (_lobe(180.0, 1.0), False),
        (0.1, False),
    ],
)
def test_a_lobe_at_the_light_is_doubted(values: Any, doubted: bool) -> None:
    sheet = samples(values, lights=(0.0, 30.0, 60.0))
    hints = [hint for hint in statement(sheet).hints if hint.startswith("Azimuths?")]
    assert bool(hints) == doubted
    assert all(hint.endswith("import it with --azimuth forward.") for hint in hints)
    plane = statement(samples(values, lights=(30.0, 60.0), turns=[0.0, 180.0])).hints
    assert any(hint.startswith("Azimuths?") for hint in plane) == doubted
    if doubted:
        (hint,) = statement(replace(sheet, record={"azimuth": "forward"})).hints
        assert hint.endswith("--azimuth light.")


def test_shares_are_plain_numbers() -> None:
    known = statement(samples(lambda i, r, delta: 1e4 * _in_mirror(i, r, delta) + 1e-9))
    assert any("unknown: one viewer contributes 100 % of it" in sentence for sentence in known.sentences)


def _in_mirror(theta_i: Any, theta_r: Any, delta: Any) -> Any:
    return (np.abs(theta_r - theta_i) < 0.01) * (np.abs(delta - np.pi) < 0.01)
