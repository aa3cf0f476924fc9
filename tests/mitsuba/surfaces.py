"""Plugins of Mitsuba with the model that judges each, and what Mitsuba makes of them in its LLVM variants."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.geometry import unit_vector
from brdfdb.models import MODELS

Array = NDArray[Any]

WAVELENGTH_NM = 500.0
WITH_FORMS = ("brdfdb_ward", "brdfdb_oren_nayar")
COPPER = {"n": 1.13, "k": 2.56}
# Lights from the normal to 85 degrees; the mean weight of samples over the albedo, less 1: worst measured 1.1e-3
LIGHTS_DEG, FURNACE = (0.0, 20.0, 45.0, 60.0, 75.0, 85.0), 3e-3
_DRAWN = 1 << 18


def variant(name: str) -> Any:
    """Set a variant of Mitsuba with our plugins, or skip the test."""
    mitsuba = pytest.importorskip("mitsuba")
    if name not in mitsuba.variants():
        pytest.skip(f"mitsuba without {name}")
    if name.startswith("llvm") and "DRJIT_LIBLLVM_PATH" not in os.environ:  # Dr.Jit aborts with the LLVM 14 to 16
        pytest.skip("DRJIT_LIBLLVM_PATH names no LLVM 19 for mitsuba's llvm variants")
    import drjit

    import brdfdb.mitsuba

    if name.startswith("cuda") and not drjit.has_backend(drjit.JitBackend.CUDA):
        pytest.skip("no GPU for mitsuba's cuda variants")
    assert brdfdb.mitsuba.PLUGINS
    mitsuba.set_variant(name)
    return mitsuba


@dataclass(frozen=True)
class Subject:
    """A plugin with its parameters, and the model of `brdfdb.models` that it is."""

    plugin: str
    model: str
    parameters: dict[str, float]
    index: dict[str, float] = field(default_factory=dict)

    @property
    def document(self) -> dict[str, Any]:
        """The plugin as Mitsuba loads it."""
        form = {"form": self.model} if self.plugin in WITH_FORMS else {}
        wavelength = {"wavelength_nm": WAVELENGTH_NM} if self.index else {}
        numbers = {self.written(name): self.as_written(name) for name in (*self.parameters, *self.index)}
        return {"type": self.plugin, **form, **numbers, **wavelength}

    def written(self, name: str) -> str:
        """Return the name of a parameter in Mitsuba."""
        return f"{name}_deg" if self._is_angle(name) else name

    def as_written(self, name: str) -> float:
        """Return a parameter as Mitsuba takes it: angles in degrees."""
        value = {**self.parameters, **self.index}[name]
        return float(np.rad2deg(value)) if self._is_angle(name) else value

    def _is_angle(self, name: str) -> bool:
        return name in self.parameters and MODELS[self.model].parameter(name).unit == "rad"

    @property
    def arguments(self) -> dict[str, float]:
        """The arguments of the model, rounded to float32 as Mitsuba reads them."""
        wavelength = {"wavelength_nm": WAVELENGTH_NM} if self.index else {}
        given = {name: float(np.float32(self.as_written(name))) for name in (*self.parameters, *self.index)}
        radians = {name: float(np.deg2rad(value)) for name, value in given.items() if self._is_angle(name)}
        return given | radians | wavelength

    def f_r(self, wi: Array, wr: Array) -> Array:
        """Return f_r [1/sr] of the model for vectors of float32."""
        vectors = MODELS[self.model].vectors
        return np.asarray(vectors(wi.astype(np.float64), wr.astype(np.float64), **self.arguments))

    @property
    def floor(self) -> float:
        """The value [1/sr] below which a difference is relative to the floor.

        Far tails of a Gaussian are left out, of whose exponent float32 keeps too few digits. Oren-Nayar's fit and
        Ross-Li are differences that fall to 0 next to the horizon.
        """
        return 5e-3 if self.model in ("oren_nayar", "ross_li") else 1e-9

    def __str__(self) -> str:
        return "-".join((self.model, *(f"{value:g}" for value in self.parameters.values())))


def ward(form: str, alpha_x: float, alpha_y: float) -> Subject:
    return Subject("brdfdb_ward", form, {"rho_d": 0.1, "rho_s": 0.5, "alpha_x": alpha_x, "alpha_y": alpha_y})


def he_torrance(sigma_0_um: float, tau_um: float, a: float = 0.05) -> Subject:
    surface = {"sigma_0_um": sigma_0_um, "tau_um": tau_um, "a": a}
    return Subject("brdfdb_he_torrance", "he_torrance", surface, COPPER)


# A smooth and a rough surface of each model
SUBJECTS = (
    *(ward(form, *alphas) for form in ("ward", "ward_half_vector") for alphas in ((0.05, 0.08), (0.5, 0.3))),
    *(ward(form, *alphas) for form in ("ward_duer", "ward_bounded") for alphas in ((0.05, 0.08), (0.5, 0.3))),
    *(Subject("brdfdb_oren_nayar", "oren_nayar", {"rho": 0.7, "sigma": sigma}) for sigma in (0.1, 0.6)),
    *(
        Subject("brdfdb_oren_nayar", "oren_nayar_qualitative", {"rho": 0.7, "sigma": s, "offset": 0.33})
        for s in (0.1, 0.6)
    ),
    *(Subject("brdfdb_oren_nayar", "oren_nayar_energy_preserving", {"rho": 0.7, "roughness": r}) for r in (0.1, 0.9)),
    Subject("brdfdb_oren_nayar", "oren_nayar_fujii", {"rho": 0.7, "sigma": 0.6}),
    Subject("brdfdb_minnaert", "minnaert", {"k": 0.8, "rho": 0.5}),
    Subject("brdfdb_rpv", "rpv", {"rho_0": 0.06, "k": 0.7, "asymmetry": -0.2, "rho_c": 0.3}),
    Subject("brdfdb_ross_li", "ross_li", {"f_iso": 0.2097, "f_vol": 0.0814, "f_geo": 0.0041}),
    Subject("brdfdb_hapke", "hapke", {"w": 0.5, "b": 0.2, "c": 0.6, "b_0": 0.8, "h": 0.08, "theta_bar": 0.25}),
    *(Subject("brdfdb_abg", "abg", {"a": 0.002, "b": b, "g": 1.8}) for b in (0.02, 0.3)),
    *(Subject("brdfdb_harvey_shack", "harvey_shack", {"b_0": 1.0, "knee": k, "slope": -1.5}) for k in (0.1, 0.3)),
    *(he_torrance(*surface) for surface in ((0.1, 2.0), (0.6, 2.5))),
)


def directions(count: int, seed: int = 5) -> tuple[Array, Array]:
    """Random lights and viewers of float32, half of the viewers near the mirror direction."""
    rng = np.random.default_rng(seed)
    wi, wr = (unit_vector(np.arccos(rng.uniform(0.0, 1.0, count)), rng.uniform(-np.pi, np.pi, count)) for _ in range(2))
    h = np.concatenate([rng.normal(0.0, 0.1, (count, 2)), np.ones((count, 1))], axis=1)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    mirrored = 2.0 * np.sum(h * wi, axis=1, keepdims=True) * h - wi
    near = (np.arange(count) % 2 == 0) & (mirrored[:, 2] > 0.0)
    return wi.astype(np.float32), np.where(near[:, np.newaxis], mirrored, wr).astype(np.float32)


def interaction(mitsuba: Any, wi: Array) -> Any:
    """Return the place where lights of shape (N, 3) meet the surface."""
    import drjit

    record = drjit.zeros(mitsuba.SurfaceInteraction3f, len(wi))
    record.wi = vectors(mitsuba, wi)
    return record


def vectors(mitsuba: Any, w: Array) -> Any:
    """Return vectors of shape (N, 3) as Mitsuba takes them, in float32."""
    return mitsuba.Vector3f(np.ascontiguousarray(w.T, dtype=np.float32))


def smooth(mitsuba: Any) -> Any:
    """Return a context without the specular part, a Dirac delta that has no density."""
    context = mitsuba.BSDFContext()
    context.type_mask = mitsuba.BSDFFlags.Glossy | mitsuba.BSDFFlags.Diffuse
    return context


def specular_sample(mitsuba: Any, surface: Any, place: Any) -> Any:
    """Return a sample of the specular part with its weight."""
    context = mitsuba.BSDFContext()
    context.type_mask = mitsuba.BSDFFlags.DeltaReflection
    return surface.sample(context, place, 0.5, mitsuba.Point2f(0.5, 0.5))


def check_samples_have_their_density(mitsuba: Any, surface: Any, lights_deg: tuple[float, ...], phi: float) -> None:
    """Check that samples pass Mitsuba's chi-square test, at 1 % for all lights together.

    Mitsuba's adapter of surfaces leaves out directions in which f_r is 0, as it is in parts of a table.
    """
    import drjit
    from mitsuba.chi2 import ChiSquareTest, SphericalDomain

    context = smooth(mitsuba)
    for theta_deg in lights_deg:
        wi = unit_vector(np.deg2rad(theta_deg), phi)[np.newaxis]

        def sample(u: Any, wi: Array = wi) -> Any:
            drawn, _ = surface.sample(context, interaction(mitsuba, wi), u[0], mitsuba.Point2f(u[1], u[2]))
            return drawn.wo, drjit.select(drawn.pdf > 0.0, 1.0, 0.0)

        def density(wo: Any, wi: Array = wi) -> Any:
            return surface.pdf(context, interaction(mitsuba, wi), wo)

        test = ChiSquareTest(SphericalDomain(), sample, density, 3, sample_count=200_000, res=101, ires=20)
        assert test.run(0.01, len(lights_deg), quiet=True), f"{theta_deg} degrees: {test.messages}"


def mean_weight(mitsuba: Any, surface: Any, theta_deg: float, phi: float) -> float:
    """Return the mean weight of samples of the first channel, for an even sequence in the unit cube."""
    steps = 1.2207440846057596 ** -np.array([[1.0], [2.0], [3.0]])  # powers of the root of x^4 = x + 1
    choice, u, v = (np.arange(_DRAWN) * steps % 1.0).astype(np.float32)
    place = interaction(mitsuba, np.tile(unit_vector(np.deg2rad(theta_deg), phi), (_DRAWN, 1)))
    _, weight = surface.sample(mitsuba.BSDFContext(), place, mitsuba.Float(choice), mitsuba.Point2f(u, v))
    return float(np.mean(np.array(weight)[0], dtype=np.float64))


def evaluated(mitsuba: Any, surface: Any, wi: Array, wr: Array) -> tuple[Array, Array]:
    """Return f_r cos theta_r of the first channel and the density of samples [1/sr], by an LLVM variant of Mitsuba."""
    value, density = surface.eval_pdf(mitsuba.BSDFContext(), interaction(mitsuba, wi), vectors(mitsuba, wr))
    return np.array(value)[0], np.array(density)
