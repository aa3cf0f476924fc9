"""A store of two made-up materials with closed forms, and a client that talks to an application without a network."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from typing import Any

import httpx
import numpy as np
import pytest

from brdfdb.store import UnknownMaterialError
from brdfdb_api.app import create_app
from brdfdb_api.settings import Settings

PROBLEM = "application/problem+json"


class FakeTable:
    """A table whose values are `formula`, times wavelength/500 where it is spectral."""

    def __init__(self, name: str, wavelength_nm: np.ndarray | None) -> None:
        self.name = name
        self.revision = "r000001"
        self.wavelength_nm = wavelength_nm
        self.anisotropic = wavelength_nm is not None
        self.axes_deg = {"theta_i": np.linspace(0.0, 90.0, 4), "theta_r": np.linspace(0.0, 90.0, 8)[::2]}
        self.specular = None if wavelength_nm is None else np.full((4, 3), 0.25)
        self.attrs = {
            "title": f"Made-up {name}",
            "model": "formula",
            "model_version": 1,
            "anisotropic": self.anisotropic,
            "wavelength_range_nm": [] if wavelength_nm is None else [400.0, 600.0],
            "source": "no paper",
            "parameters": {"rho": 0.5, "n": [1.5, float("nan")]},
        }

    @staticmethod
    def formula(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any) -> Any:
        above = (np.asarray(theta_i) <= np.pi / 2) & (np.asarray(theta_r) <= np.pi / 2)
        value = 1.0 + np.cos(theta_i) * np.cos(theta_r) + 0.5 * np.cos(np.subtract(phi_r, phi_i))
        return np.where(above, value, 0.0)

    def lookup(self, theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, wavelength_nm: Any = None) -> Any:
        return self._spectral(self.formula(theta_i, phi_i, theta_r, phi_r), wavelength_nm)

    def specular_reflectance(self, theta_i: Any, wavelength_nm: Any = None) -> Any:
        return self._spectral(np.zeros(np.shape(theta_i)) + (0.0 if self.specular is None else 0.25), wavelength_nm)

    def _spectral(self, value: Any, wavelength_nm: Any) -> Any:
        if self.wavelength_nm is None and wavelength_nm is None:
            return value
        wavelengths = np.asarray(self.wavelength_nm if wavelength_nm is None else wavelength_nm)
        low, high = (0.0, np.inf) if self.wavelength_nm is None else self.wavelength_nm[[0, -1]]
        for wavelength in np.ravel(wavelengths):
            if not low <= wavelength <= high:
                raise ValueError(f"wavelength_nm: {wavelength:g} is outside [{low:g}, {high:g}] nm")
        factors = np.ones(wavelengths.shape) if self.wavelength_nm is None else wavelengths / 500.0
        return value * factors if factors.ndim == 0 else value[..., None] * factors


class FakeStore(Mapping[str, FakeTable]):
    """A store that is a dictionary."""

    def __init__(self) -> None:
        tables = FakeTable("grey-felt", None), FakeTable("blue-foil", np.array([400.0, 500.0, 600.0]))
        self.tables = {table.name: table for table in tables}

    def __getitem__(self, name: str) -> FakeTable:
        if name not in self.tables:
            raise UnknownMaterialError(name, list(self))
        return self.tables[name]

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self.tables))

    def __len__(self) -> int:
        return len(self.tables)

    def head(self, name: str) -> str:
        return self[name].revision

    def attributes(self, name: str) -> dict[str, Any]:
        return self[name].attrs


class Client:
    """Send requests to an application, each in an event loop of its own."""

    def __init__(self, app: Any) -> None:
        self.app = app

    def request(self, method: str, url: str, **request: Any) -> httpx.Response:
        async def send() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
                return await client.request(method, url, **request)

        return asyncio.run(send())

    def get(self, url: str, **request: Any) -> httpx.Response:
        return self.request("GET", url, **request)

    def post(self, url: str, **request: Any) -> httpx.Response:
        return self.request("POST", url, **request)

    def problem(self, method: str, url: str, status: int, **request: Any) -> dict[str, Any]:
        """Send a request that must end in a problem with `status`."""
        response = self.request(method, url, **request)
        assert (response.status_code, response.headers["content-type"]) == (status, PROBLEM), response.text
        problem: dict[str, Any] = response.json()
        assert problem["status"] == status
        assert problem["type"] == "about:blank"
        assert problem["title"]
        assert problem["detail"]
        assert "Traceback" not in response.text
        return problem


@pytest.fixture
def store() -> FakeStore:
    return FakeStore()


@pytest.fixture
def client(store: Any) -> Client:
    return Client(create_app(Settings(max_points=1000, max_body_bytes=100_000), store))
