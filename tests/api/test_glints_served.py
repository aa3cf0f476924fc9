"""A table with glints over HTTP: values with them, marks where they are, and the same table from Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb.store import http_client
from tests.api.a_store import client_of, serving
from tests.tables.glinting import GROUND, PEAK, stored

MATERIAL = "/v1/materials/glinting"
POWER_60 = PEAK * np.cos(np.deg2rad(60.5)) * 2.0 * np.pi * np.deg2rad(0.4) ** 2


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("glints") / "store"
    stored(directory)
    return directory


def test_answers_have_the_glint_and_mark_it(root: Path) -> None:
    client = client_of(root)
    body = {"theta_i": 60, "theta_r": [60.5, 20], "phi_r": 180}
    answer = client.post(f"{MATERIAL}/lookup?error=true", json=body).json()
    assert answer["brdf"] == pytest.approx([PEAK + GROUND, GROUND], rel=1e-3)
    assert answer["glint"] == [True, False]
    assert answer["error"][0] == pytest.approx(0.02 * PEAK, rel=1e-2)
    between = client.post(f"{MATERIAL}/lookup?error=true", json={"theta_i": 45, "theta_r": 45, "phi_r": 180}).json()
    assert between["extrapolated"] is True
    assert between["error"] is None
    lobe = client.get(f"{MATERIAL}/lobe?theta_i=60").json()
    assert max(lobe["brdf"]) == pytest.approx(PEAK + GROUND, rel=1e-3)  # between the steps of a cut without glints
    albedo = client.get(f"{MATERIAL}/albedo").json()
    at = albedo["theta_i"].index(60.0)
    assert albedo["glints"][at][0] == pytest.approx(POWER_60, rel=1e-3)
    assert albedo["albedo"][at][0] == pytest.approx(np.pi * GROUND + POWER_60, abs=2e-3)
    assert [glint["theta_i_deg"] for glint in client.get(MATERIAL).json()["measured"]["glints"]["glints"]] == [
        30.0,
        60.0,
    ]


def test_a_remote_table_is_the_same_with_its_glints(root: Path) -> None:
    with serving(root) as address:
        remote = http_client.RemoteStore(address)["glinting"]
        angles = np.deg2rad([60.0, 60.0]), 0.0, np.deg2rad([60.5, 20.0]), np.pi
        values = remote.lookup_with_error(*angles)
        assert values.brdf == pytest.approx([PEAK + GROUND, GROUND], rel=1e-3)
        assert values.error[0] == pytest.approx(0.02 * PEAK, rel=1e-2)
        assert remote.in_glint(*angles).tolist() == [True, False]
        assert np.isnan(remote.lookup_with_error(np.pi / 4, 0.0, np.pi / 4, np.pi).error)
