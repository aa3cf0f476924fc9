"""The atlas: every misprint has its figure, our form stays within its tolerance, and the wrong form fails."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.atlas import _errors, he_torrance_1991, hot_spots, oren_nayar_1994, ward_1992
from brdfdb.atlas._errors import ComparedForm
from brdfdb.figure import Curve, Figure, Map, Panel, Role
from brdfdb.misprints import MISPRINTS

MODULES = (oren_nayar_1994, he_torrance_1991, ward_1992, hot_spots)
FIGURES: dict[str, Callable[[], Figure]] = {key: made for module in MODULES for key, made in module.FIGURES.items()}
every_figure = pytest.mark.parametrize("key", FIGURES)

ROUNDED = 6e-4  # relative error. Worst measured: 5.7e-4, the second term of Beckmann's limit; five digits leave 5e-5
OURS_ALONE = {"ward-narrow-at-grazing"}  # figures of our form alone


@functools.cache
def figure(key: str) -> Figure:
    return FIGURES[key]()


def curve(key: str, role: Role) -> Curve:
    """Return the only curve of a role in the first panel."""
    panel = figure(key).panels[0]
    assert isinstance(panel, Panel)
    (curve,) = [curve for curve in panel.curves if curve.role == role]
    return curve


def wrong(key: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return x and the errors [1] of the wrong form of a misprint."""
    line = curve(key, _errors.ROLES[_errors.BY_KEY[key].kind])
    return np.array(line.x), np.array(line.y, dtype=np.float64)


def test_every_misprint_has_a_figure_and_each_figure_its_own_key() -> None:
    assert {misprint.key for misprint in MISPRINTS} <= set(FIGURES)
    assert len(FIGURES) == sum(len(module.FIGURES) for module in MODULES)


@every_figure
def test_a_figure_has_the_key_that_it_is_listed_under_and_a_paper_of_the_bibliography(key: str) -> None:
    assert figure(key).key == key
    bibliography = (Path(__file__).parents[2] / "references.bib").read_text(encoding="utf-8")
    assert f"{{{figure(key).paper}," in bibliography


@every_figure
def test_our_form_stays_and_the_forms_beside_it_fail(key: str) -> None:
    sentences = [statement.says for statement in figure(key).statements]
    assert any(re.match("(.*, )?ours(, .*)?: within ", sentence) for sentence in sentences)
    assert any(": off by more than " in sentence for sentence in sentences) != (key in OURS_ALONE)
    for statement in figure(key).statements:
        assert statement.holds, statement


@every_figure
def test_every_point_of_ours_is_drawn(key: str) -> None:
    drawn = 0
    for panel in figure(key).panels:
        if isinstance(panel, Panel):
            for line in panel.curves:
                assert len(line.x) == len(line.y)
                if line.role == "ours":
                    assert None not in line.y
                    drawn += len(line.y)
        elif isinstance(panel, Map) and panel.title == "ours":
            values = [value for row in panel.values for value in row]
            assert None not in values
            drawn += len(values)
    assert drawn >= 6


# Errors of the wrong forms that have a closed form


def test_a_radiance_for_a_brdf_is_off_by_the_cosine_of_the_light() -> None:
    theta, off = wrong("surface-radiance-as-brdf")
    np.testing.assert_allclose(off[1:], 1.0 - np.cos(np.deg2rad(theta[1:])), rtol=ROUNDED)


def test_an_albedo_for_a_brdf_is_off_by_pi() -> None:
    np.testing.assert_allclose(wrong("uniform-diffuse-without-pi")[1], np.pi - 1.0, rtol=ROUNDED)


def test_slopes_over_the_hemisphere_leave_a_part_in_2_pi() -> None:
    np.testing.assert_allclose(wrong("normalised-over-the-hemisphere")[1], 1.0 - 0.5 / np.pi, rtol=ROUNDED)


def test_the_slope_for_its_arctan_is_off_by_their_ratio() -> None:
    alpha, off = wrong("delta-without-arctan")
    slope = alpha * np.sqrt(np.log(100.0))
    np.testing.assert_allclose(off, slope / np.arctan(slope) - 1.0, rtol=ROUNDED)


def test_beckmanns_limit_is_off_by_a_part_in_g_at_the_peak() -> None:
    drawn = curve("beckmanns-limit", "ours")
    panel = figure("beckmanns-limit").panels[0]
    assert isinstance(panel, Panel)
    limit, first_order, ours = panel.curves
    assert (limit.label, ours) == ("Beckmann's limit", drawn)
    assert first_order.role == limit.role == "textbook"
    g, off = np.array(limit.x), np.array(limit.y, dtype=np.float64)
    np.testing.assert_allclose(off[g > 1e3], 1.0 / g[g > 1e3], rtol=ROUNDED)


# The building blocks


def test_a_form_that_is_off_does_not_stay_and_one_that_is_not_does_not_fail() -> None:
    for error, off in ((1e-12, False), (1e-3, True), (np.nan, True)):
        errors = np.array([0.0, error])
        assert _errors.stays("ours", errors, 1e-10, "").holds != off
        assert _errors.fails("printed", errors, 1e-10, "").holds == off


def test_an_error_of_zero_is_drawn_and_one_of_nan_is_a_gap_that_the_label_counts() -> None:
    forms = [
        ComparedForm("exact", "ours", lambda x: x),
        ComparedForm("inverse", "printed", lambda x: x * np.divide(1.0, x) * x),
    ]
    measured = _errors.FormSweep([0.0, 2.0], "x", lambda x: {"x": x}, lambda x: x, scale=1.0).panel(forms)
    assert isinstance(measured.panel, Panel)
    exact, inverse = measured.panel.curves
    assert exact.y == [_errors.NONE, _errors.NONE]
    assert inverse.y == [None, _errors.NONE]
    assert inverse.label == "inverse (nan or inf at 1 of 2)"


def test_matrices_are_compared_by_their_largest_elements() -> None:
    truth = np.array([[3.0, 0.0], [0.0, 5.0j]])
    assert _errors.relative(truth + np.array([[0.0, 0.5], [0.25, 0.0]]), truth) == 0.1
    assert _errors.relative(3.0 * 2.0**-1000, 2.0**-999) == 0.5  # Tiny values do not underflow
    assert np.isnan(_errors.relative(truth + np.diag([np.inf, 0.0]), truth))
