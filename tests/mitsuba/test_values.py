"""Values of the plugins against `brdfdb.models`: random directions, corners of the directions, and parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from brdfdb.geometry import unit_vector
from brdfdb.models import he_torrance_specular
from brdfdb.models import ward_vectors as ward
from tests.mitsuba.surfaces import (
    SUBJECTS,
    Array,
    Subject,
    directions,
    evaluated,
    interaction,
    specular_sample,
    variant,
)
from tests.models.hazard_directions import EXACT, NEAR
from tests.models.hazards import BY_NAME

PAIRS = 100_000
# Relative; the largest measured is 1.1e-5, where f_r is 1e-9 /sr
FLOAT32 = 2e-5


def misses(subject: Subject, value: Array, wi: Array, wr: Array) -> Array:
    """Relative differences of f_r from the model."""
    expected = subject.f_r(wi, wr)
    return np.asarray(np.abs(value / wr[:, 2] - expected) / np.maximum(expected, subject.floor))


@pytest.mark.parametrize("subject", SUBJECTS, ids=str)
def test_values_are_those_of_the_model(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    wi, wr = directions(PAIRS)
    value, density = evaluated(mitsuba, mitsuba.load_dict(subject.document), wi, wr)
    assert np.max(misses(subject, value, wi, wr)) <= FLOAT32
    assert np.all(np.isfinite(density))


def plugin_of(subject: Subject, parameters: dict[str, Any]) -> dict[str, Any]:
    known = {name: parameters[name] for name in parameters if name not in ("wavelength_nm", "interreflection")}
    index = {name: known.pop(name) for name in ("n", "k") if name in known and subject.index}
    document = replace(subject, parameters=known, index=index).document
    if "interreflection" in parameters:
        document["interreflection"] = bool(parameters["interreflection"])
    return document | {name: parameters[name] for name in ("wavelength_nm",) if name in parameters}


@pytest.mark.parametrize("judged", {subject.model: subject for subject in SUBJECTS}.values(), ids=str)
def test_no_value_is_nan_at_the_corners(judged: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    import drjit

    corners = np.array([*EXACT.values(), *NEAR])
    wi, wr = unit_vector(corners[:, 0], corners[:, 1]), unit_vector(corners[:, 2], corners[:, 3])
    wi, wr = (np.concatenate([w, w * (1.0, 1.0, -1.0)]) for w in (wi, wr))  # below the horizon, too
    subject = BY_NAME[judged.model]
    for parameters in (*subject.parameters, *subject.slow, *subject.very_slow):
        surface = mitsuba.load_dict(plugin_of(judged, parameters))
        value, density = evaluated(mitsuba, surface, wi, wr)
        assert np.all(np.isfinite(value))
        assert np.all(value >= 0.0)
        assert np.all(np.isfinite(density))
        assert np.all(value[(wi[:, 2] <= 0.0) | (wr[:, 2] <= 0.0)] == 0.0)
        drjit.flush_malloc_cache()


def test_the_specular_part_is_that_of_the_model() -> None:
    mitsuba = variant("llvm_ad_mono")
    subject = SUBJECTS[-2]
    theta = np.linspace(0.0, 1.57, 200)
    wi = unit_vector(theta, np.full(200, 0.3)).astype(np.float32)
    surface = mitsuba.load_dict(subject.document)
    sample, weight = specular_sample(mitsuba, surface, interaction(mitsuba, wi))
    np.testing.assert_array_equal(np.array(sample.wo).T, wi * np.float32([-1.0, -1.0, 1.0]))
    arguments = {name: value for name, value in subject.arguments.items() if name != "a"}
    sines = np.hypot(wi[:, 0].astype(np.float64), wi[:, 1])
    expected = he_torrance_specular(np.arctan2(sines, wi[:, 2]), **arguments)
    np.testing.assert_allclose(np.array(weight)[0], expected, rtol=FLOAT32)


def test_textures_are_parameters_and_stay_within_their_range() -> None:
    mitsuba = variant("scalar_rgb")
    picture = np.array([[[0.0], [0.25]], [[0.5], [3.0]]], np.float32)
    texture = {"type": "bitmap", "data": mitsuba.TensorXf(picture), "raw": True, "filter_type": "nearest"}
    surface = mitsuba.load_dict({"type": "brdfdb_ward", "rho_d": 0.1, "rho_s": 0.5, "alpha": texture})
    wi, wr = unit_vector(0.6, 0.4), unit_vector(0.7, 3.4)
    place, viewer = mitsuba.SurfaceInteraction3f(), mitsuba.Vector3f(wr.tolist())
    place.wi = mitsuba.Vector3f(wi.tolist())
    for (row, column), alpha in np.ndenumerate(np.clip(picture[..., 0].astype(np.float64), 1e-6, 2.0)):
        place.uv = mitsuba.Point2f(0.25 + 0.5 * column, 0.25 + 0.5 * row)
        value, density = surface.eval_pdf(mitsuba.BSDFContext(), place, viewer)
        expected = ward(wi, wr, rho_d=0.1, rho_s=0.5, alpha_x=alpha, alpha_y=alpha)
        np.testing.assert_allclose(np.ravel(value) / wr[2], np.full(3, expected), rtol=1e-4)
        assert np.isfinite(density)


def test_bad_parameters_are_named() -> None:
    mitsuba = variant("scalar_rgb")
    ward = {"type": "brdfdb_ward", "rho_d": 0.1, "alpha": 0.2}
    shiny = ward | {"rho_s": 0.5}
    for document, sentence in (
        (shiny | {"rho_d": 1.5}, r"rho_d: 1\.5 is outside \[0, 1\]"),
        (shiny | {"alpha": 0.0}, r"alpha_x: 0 is outside \[1e-06, 2\]"),
        (shiny | {"form": "phong"}, "form: 'phong' is not one of ward, ward_half_vector, ward_duer, ward_bounded"),
        (ward, r"rho_s: a number in \[0, 1\] or a texture is missing"),
        ({"type": "brdfdb_oren_nayar", "rho": 0.5, "sigma_deg": 100.0}, r"sigma_deg: 100 is outside \[0, 90\] degree"),
    ):
        with pytest.raises(RuntimeError, match=sentence):
            mitsuba.load_dict(document)
