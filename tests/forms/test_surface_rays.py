"""Rays as a row of the chart: the error is that of the map, the cost is the time of the rays and what it reaches."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from brdfdb.errors import MissingExtraError
from brdfdb.forms import surface_rays
from brdfdb.forms.surface_rays import ChartedSurface, charted_surface
from brdfdb.materials import Material
from brdfdb.microgeometry import goniometer
from brdfdb.microgeometry.facets import Bounces
from brdfdb.microgeometry.model_errors import surface_error


def material(model: str, **parameters: float) -> Material:
    return Material(name="made-up", title="t", source="s", model=model, parameters=parameters)


FELT = material("oren_nayar_gaussian", rho=0.5, sigma=0.3)


def test_the_cost_is_the_time_of_a_value_with_the_standard_error_of_the_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Any] = []

    def measured(surface: Any, facets: Any, lights: Any, viewers: Any, *, seed: int, **_: Any) -> Bounces:
        given.append((facets.rho.tolist(), surface.periodic))
        f_r = np.full((len(lights), len(viewers), 1), (0.9, 1.1, 0.9, 1.1)[seed])
        f_r[0] = 1e-3 * seed  # dark values do not count
        return Bounces(0.75 * f_r, 0.25 * f_r, 0.0 * f_r, np.zeros((len(lights), 3, 1)))

    monkeypatch.setattr(goniometer, "bounces", measured)
    seconds = itertools.count(step=2.1025)
    found = charted_surface(FELT, clock=lambda: next(seconds))
    assert found is not None
    assert found.cost is not None
    assert given == [([0.5], True)] * 4
    # 2.1025 s for 145 x 145 values; the variance of 0.9, 1.1, 0.9, 1.1 is 0.04 / 3, and that of their mean a quarter
    assert found.cost.ns == pytest.approx(1e5)
    assert found.cost.standard_error == pytest.approx(np.sqrt(0.01 / 3.0), rel=0.02)
    assert found.cost.directions == 145
    assert found.error == surface_error(FELT)
    assert found.error.slope is not None
    assert found.title == f"rays on a Gaussian surface, slope {found.error.slope:.2g}"
    assert ChartedSurface.model_validate_json(found.model_dump_json()) == found


def test_rays_reach_the_standard_error_that_they_state(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surface_rays, "RAYS", 128)
    found = charted_surface(FELT)
    assert found is not None
    assert found.cost is not None
    assert 0.005 < found.cost.standard_error < 0.2
    assert 1e3 < found.cost.ns < 1e7


def test_without_a_tracer_the_cost_is_unknown_and_the_error_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: Any, **__: Any) -> Bounces:
        raise MissingExtraError("embreex is not installed")

    monkeypatch.setattr(goniometer, "bounces", missing)
    assert charted_surface(FELT) == ChartedSurface(error=surface_error(FELT), cost=None)  # type: ignore[arg-type]


@pytest.mark.parametrize("sigma", [0.0, 1e-5, 1.4])
def test_a_flat_surface_and_one_outside_of_the_map_need_no_rays(sigma: float) -> None:
    found = charted_surface(material("oren_nayar_gaussian", rho=0.5, sigma=sigma))
    assert found is not None
    assert found.cost is None
    assert found.error.inside == (sigma < 1.0)


def test_a_model_without_a_map_has_no_surface() -> None:
    assert charted_surface(material("lambert", rho=0.5)) is None
