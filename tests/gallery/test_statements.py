"""All figures of the gallery: complete panels, and statements that hold or fail for a known reason."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from brdfdb.figure import Figure, Panel, Picture
from brdfdb.gallery import GALLERY
from tests.gallery.figures import figure
from tests.gallery.mutants import document
from tests.gallery.mutants.mutation import BASES

PAPERS = {"oren-nayar-1994": "orennayar1994", "he-torrance-1991": "he1991", "ward-1992": "ward1992"}
STATEMENTS = 141  # statements of all figures
WITH_GAPS = ("he-torrance-1991-fig-06",)  # figures with curves that end where f_r is too small to be drawn

# The figure and a phrase of each statement that does not hold, with the reason
BROKEN = {
    ("he-torrance-1991-fig-09", "is specular"): "He et al. 1991, Fig. 9: with the printed sigma_0 of 2.9 wavelengths "
    "e^-g leaves nothing specular; the directional diffuse lobe emerges instead, largest beyond the mirror direction",
    ("he-torrance-1991-fig-09", "upper bound"): "He et al. 1991, section 3.2.3 against Fig. 9: a = 0.9 and the first "
    "surface add up to more than 1 beyond 54 degrees",
    ("he-torrance-1991-fig-12", "(a) to (f)"): "He et al. 1991, Fig. 12: cylinder (f) has the largest sigma_0, but its "
    "slope, 2.5 / 16, is less than that of (e), 0.58 / 3",
    ("he-torrance-1991-effective-roughness", "visible parts only"): "He et al. 1991, eqs 53 to 55: heights of points "
    "that light and viewer reach spread by 0.95 sigma_0 at 70 degrees and 0.58 at 89, where eq. 53 has 0.99 and 0.42",
    ("he-torrance-1991-effective-roughness", "both illuminated and viewed"): "He et al. 1991, eq. 23: S is a product, "
    "as if light and viewer hid points independently of each other; a viewer next to the light sees all lit points",
    ("he-torrance-1991-mueller", "like depolarization"): "He et al. 1991, section 3.1: with F at the one normal n_b "
    "(eq. 50) the first surface leaves fully polarised light fully polarised",
    ("oren-nayar-1994-fig-11", "near-Lambertian"): "eq. 43 lets radiance grow by 60 % towards the horizon where "
    "shadowing and masking overlap, as they do for θ_i = 75°, σ = 40°; for θ_i of 60° and less the sentence holds",
    ("oren-nayar-1994-fig-13", "slight sacrifice"): "eq. 30 is constant in the mirror half plane, where eq. 41 falls "
    "to less than half, and without C_3 and interreflection it is a third too dark near the horizon across the plane",
    ("oren-nayar-1994-fig-19", "close to the specular direction"): "eq. 31 has 1 / cos θ_r: for σ of 20° and more its "
    "peak is 30 to 60° beyond the specular direction, where masking begins or at the horizon",
    ("oren-nayar-1994-fig-23", "drops quickly to zero"): "eq. 27 over a cylinder ends at the limb with ρ E_0 C_2 / π, "
    "about half of the radiance in the middle: the drop is the real vase's, not the model's",
    ("oren-nayar-1994-eq-44", "is slight"): "Oren and Nayar 1994, appendix B.1: for slopes of 30 degrees eq. 44 is "
    "27 % above the integral of eq. 23 at theta_i = theta_r = 87.5 degrees, 60 degrees off the plane of incidence",
    ("ward-1992-fig-07-noise", "uniformly weighted"): "Ward 1992, section 5.1: with weights of one, rays by eq. 7 "
    "bring 2.1 times what eq. 5a reflects at 60 degrees",
}

compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")


@compiled
@pytest.mark.parametrize("key", GALLERY)
def test_statements_hold_or_fail_for_a_known_reason(key: str) -> None:
    broken = [phrase for name, phrase in BROKEN if name == key]
    for statement in figure(key).statements:
        basis, _, reason = (statement.threshold_from or "").partition(": ")
        assert basis in BASES, statement
        assert reason, statement
        fails = any(phrase in statement.says for phrase in broken)
        assert statement.holds is not fails, statement.seen


@compiled
def test_every_known_failure_is_that_of_one_statement() -> None:
    assert sum(len(figure(key).statements) for key in GALLERY) == STATEMENTS
    for key, phrase in BROKEN:
        assert sum(phrase in statement.says for statement in figure(key).statements) == 1


@compiled
@pytest.mark.parametrize("key", GALLERY)
def test_a_figure_is_complete(key: str) -> None:
    drawn = figure(key)
    assert drawn.key == key
    assert drawn.paper == next(paper for prefix, paper in PAPERS.items() if key.startswith(prefix))
    assert drawn.panels
    assert Figure.model_validate_json(drawn.model_dump_json()) == drawn
    assert len({statement.says for statement in drawn.statements}) == len(drawn.statements) > 0
    for panel in drawn.panels:
        if isinstance(panel, Panel):
            assert len({curve.label for curve in panel.curves}) == len(panel.curves) > 0
            for curve in panel.curves:
                assert len(curve.x) == len(curve.y) > 5
                assert np.all(np.diff(curve.x) > 0.0)
                assert None not in curve.y or key in WITH_GAPS
                if panel.kind == "polar":
                    assert -90.0 <= curve.x[0] < 0.0 < curve.x[-1] <= 90.0
        elif isinstance(panel, Picture):
            assert len({len(row) for row in panel.radiance}) == 1
            pixels = [pixel for row in panel.radiance for pixel in row if pixel is not None]
            assert len(pixels) > len(panel.radiance) ** 2 / 2
            assert 0.0 <= min(pixels) < max(pixels) <= 1.0


def test_wrong_models_cover_every_figure_and_have_unique_names() -> None:
    prefixes = tuple(module.PREFIX for module in document.PAPERS.values())
    assert [key for key in GALLERY if not key.startswith(prefixes)] == []
    for module in document.PAPERS.values():
        names = [mutant.name for mutant in module.MUTANTS]
        assert len(set(names)) == len(names)
    assert sum(len(module.MUTANTS) for module in document.PAPERS.values()) >= 20


def test_the_list_of_wrong_models_is_that_of_the_code() -> None:
    assert document.PATH.read_text(encoding="utf-8") == document.text()
