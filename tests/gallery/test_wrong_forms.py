"""Statements of the added figures fail for wrong forms, and each wrong form is noticed by two statements."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
import pytest

from brdfdb.figure import Figure
from brdfdb.gallery import GALLERY
from brdfdb.geometry import checked_angles
from brdfdb.models import oren_nayar_1994_surfaces as surfaces
from tests.gallery import wrong_forms
from tests.gallery.wrong_forms import WrongForm, planted

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

FIGURES = {
    "oren-nayar": [
        "oren-nayar-1994-fig-15",
        "oren-nayar-1994-fig-16",
        "oren-nayar-1994-fig-17",
        "oren-nayar-1994-fig-18",
        "oren-nayar-1994-evaluation",
        "oren-nayar-1994-bounces",
        "oren-nayar-1994-eq-44",
    ],
    "he-torrance": [
        "he-torrance-1991-fig-06",
        "he-torrance-1991-effective-roughness",
        "he-torrance-1991-polarisation",
        "he-torrance-1991-mueller",
    ],
    "ward": [
        "ward-1992-fig-03",
        "ward-1992-fig-07-techniques",
        "ward-1992-fig-07-noise",
        "ward-1992-fig-09",
        "ward-1992-fig-09-profile",
    ],
}
FORMS = {
    "oren-nayar": wrong_forms.OREN_NAYAR,
    "he-torrance": wrong_forms.HE_TORRANCE,
    "ward": wrong_forms.WARD,
}


def verdicts(keys: Sequence[str]) -> dict[tuple[str, str], bool]:
    with np.errstate(all="ignore"):
        figures: list[Figure] = [GALLERY[key]() for key in keys]
    return {(figure.key, each.says): each.holds for figure in figures for each in figure.statements}


def noticed(paper: str, form: WrongForm) -> set[tuple[str, str]]:
    with planted(form):
        return {said for said, holds in verdicts(FIGURES[paper]).items() if not holds}


@pytest.mark.parametrize("paper", FIGURES)
def test_wrong_forms_are_noticed_twice_and_statements_fail_for_one(paper: str) -> None:
    holding = {said for said, holds in verdicts(FIGURES[paper]).items() if holds}
    by_form = {form.name: noticed(paper, form) & holding for form in FORMS[paper]}
    assert [name for name, failing in by_form.items() if len(failing) < 2] == []
    blind = holding - set().union(*by_form.values())
    assert sorted(blind) == []


def test_the_twin_of_closed_forms_is_the_model() -> None:
    rng = np.random.default_rng(45)
    theta_i, theta_r, delta_phi, theta_a = rng.uniform(0.0, [[1.5], [1.5], [2.0 * np.pi], [1.3]], (4, 500))
    directions = checked_angles(theta_i, 0.0, theta_r, delta_phi)
    (twin,) = wrong_forms.closed().values()
    for ours, theirs in zip(twin(directions, 0.8, theta_a)[:2], surfaces._single_slope(directions, 0.8, theta_a)[:2],
                            strict=True):  # fmt: skip
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)
