"""Energy of models in tests of tables: computed once for each material, or less exactly than an audit computes it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from brdfdb.audit import energy, model_energy
from brdfdb.audit.model_energy import ModelEnergy, model_energy_of
from brdfdb.materials import Material
from brdfdb.models import MODELS

COARSE = 1e-3  # absolute tolerance of each albedo [1]; audits take 1e-6

_JUDGED: dict[Any, tuple[object, ModelEnergy]] = {}


def judged_once(source: Any, wavelength_nm: Any, *given: Any, **options: Any) -> ModelEnergy:
    """Return the energy of a model, from memory if it was judged before: a change of a table does not change it."""
    if not isinstance(source, Material):
        return model_energy_of(source, wavelength_nm, *given, **options)
    spec = MODELS[source.model]
    light = None if wavelength_nm is None else tuple(np.asarray(wavelength_nm))
    key = (source.model_dump_json(), light, repr(given), repr(options), id(spec), model_energy.TOLERANCE)
    if key not in _JUDGED:
        # The specification stays in memory, so that no other one gets its id
        _JUDGED[key] = (spec, model_energy_of(source, wavelength_nm, *given, **options))
    return _JUDGED[key][1]


@pytest.fixture
def each_model_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge the energy of each model once, however many of its tables are audited."""
    monkeypatch.setattr(energy, "model_energy_of", judged_once)


@pytest.fixture
def coarse_model_energy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Integrate over models coarsely: their energy is judged in test_model_energy.py."""
    monkeypatch.setattr(model_energy, "TOLERANCE", COARSE)
