"""Derivatives of the plugins by their parameters, forwards and backwards, against differences of `brdfdb.models`."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.models import MODELS
from tests.mitsuba.surfaces import SUBJECTS, Array, Subject, directions, interaction, variant, vectors

PAIRS = 2000
STEP = 1e-4  # relative to the parameter. The error of the central difference is 1e-7
GRADIENT = 1e-3  # relative; the largest measured is 7e-4, of He-Torrance, whose series is a table
# Derivatives smaller than this share of f_r over the parameter change sign nearby, and are compared with that share
CANCELLED = 0.1
FLOOR = 1e-6  # [1/sr] smaller values are the far tail of a Gaussian

BY_PARAMETER = [(subject, name) for subject in SUBJECTS for name in (*subject.parameters, *subject.index)]


def difference(subject: Subject, name: str, wi: Array, wr: Array) -> Array:
    """Return the derivative of f_r [1/sr] by a parameter, from a central difference of float64."""
    model, at = MODELS[subject.model].vectors, subject.arguments[name]
    step, wi, wr = STEP * at, wi.astype(np.float64), wr.astype(np.float64)
    more, less = (model(wi, wr, **subject.arguments | {name: at + by}) for by in (step, -step))
    return np.asarray((more - less) / (2.0 * step))


@pytest.mark.parametrize(("subject", "name"), BY_PARAMETER, ids=str)
def test_derivatives_are_those_of_the_model(subject: Subject, name: str) -> None:
    mitsuba = variant("llvm_ad_mono")
    import drjit

    wi, wr = directions(PAIRS)
    surface = mitsuba.load_dict(subject.document)
    parameters = mitsuba.traverse(surface)
    key = f"{subject.written(name)}.value"
    drjit.enable_grad(parameters[key])
    parameters.update()
    value = surface.eval(mitsuba.BSDFContext(), interaction(mitsuba, wi), vectors(mitsuba, wr))
    drjit.forward(parameters[key])
    gradient = np.array(drjit.grad(value))[0] / wr[:, 2]
    if subject.written(name) != name:
        gradient = np.rad2deg(gradient)  # 1 / radian
    f_r = subject.f_r(wi, wr)
    expected = difference(subject, name, wi, wr)
    scale = np.maximum(np.abs(expected), CANCELLED * f_r / abs(subject.arguments[name]))
    seen = f_r > FLOOR
    assert np.all(np.isfinite(gradient))
    assert np.max(np.abs(gradient - expected)[seen] / scale[seen]) <= GRADIENT


@pytest.mark.parametrize("subject", [SUBJECTS[1], SUBJECTS[9], SUBJECTS[-1]], ids=str)
def test_derivatives_are_the_same_backwards(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_rgb")
    import drjit

    wi, wr = directions(PAIRS)
    viewers = vectors(mitsuba, wr)
    for name in subject.parameters:
        sums = []
        for derive in (drjit.forward, drjit.backward):
            surface = mitsuba.load_dict(subject.document)
            parameters = mitsuba.traverse(surface)
            parameter = parameters[f"{subject.written(name)}.value"]
            drjit.enable_grad(parameter)
            parameters.update()
            total = drjit.mean(surface.eval(mitsuba.BSDFContext(), interaction(mitsuba, wi), viewers), axis=None)
            derive(parameter if derive is drjit.forward else total)
            sums.append(drjit.grad(total if derive is drjit.forward else parameter)[0])
        assert sums[0] == pytest.approx(sums[1], rel=1e-4)
        assert sums[0] != 0.0
