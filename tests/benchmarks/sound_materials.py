"""Random materials of every model, and their tables as a store holds them: what audits must not raise an alarm for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from brdfdb.geometry import degrees
from brdfdb.integrals.quadrature import spectral_albedo
from brdfdb.materials import Material, written_name
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.statements import stated_metadata
from brdfdb.tables.table import Table, table_from
from brdfdb.tables.tabulation import tabulate

_SLOW = ("oren_nayar_gaussian",)
METALS = ("main/Cu/Johnson", "main/Al/Rakic", "main/Au/Johnson", "main/Ag/Johnson", "main/MgO/Stephens-vis")
TOLERANCES = (0.02, 0.03, 0.05, 0.1, 0.2)
GRAZING_DEG = (0.0, 30.0, 60.0, 75.0, 80.0, 83.0, 85.0, 87.0, 89.0, 89.9)
# Share of the tables that have a plain, coarse grid in place of a planned one. Lobes have none: a grid too coarse for a
# lobe makes a table that reflects more than it receives, which is no false alarm
_COARSE = 0.4
_TRIES = 200  # materials of a model that are drawn until one of them conserves energy


class Sound(NamedTuple):
    """A table as it is built, with the words that describe it."""

    words: str
    table: Table


def built(layout: Layout) -> Table:
    """Return the table of a layout with all that it states of itself, as a store gives it."""
    dataset = tabulate(layout)
    values = dataset[layout.variable].values
    stated = stated_metadata(layout, lambda rows: values[rows]).attributes()
    arrays = {str(name): np.asarray(variable.values) for name, variable in dataset.variables.items()}
    return table_from(layout.source.name, "r000001", arrays, {**dataset.attrs, **stated})


def materials(count: int, seed: int) -> Iterator[Sound]:
    """Yield tables of random materials, all models in turn, planned or on coarse grids.

    A material whose model reflects more than it receives, at one of `GRAZING_DEG`, is drawn anew: to name it is no
    false alarm. A planned table that would be too large gets the next tolerance, and is left out
    where all of them are refused.
    """
    rng = np.random.default_rng(seed)
    fast = [name for name in MODELS if name not in (*_SLOW, "oren_nayar_unidirectional")]
    names = [*fast, *_SLOW, "oren_nayar_unidirectional", *fast * 3]  # those that take 10 s are one in 58
    for number in range(count):
        model = names[number % len(names)]
        spectrum = np.linspace(420.0, 680.0, int(rng.integers(1, 7)))
        for _ in range(_TRIES):
            material = _material(f"sound-{number}", model, rng)
            wavelength_nm = spectrum if material.spectral else None
            if _conserves(material, wavelength_nm):
                break
        else:
            print(f"{model}: none of {_TRIES} conserves", file=sys.stderr)
            continue
        if material.spec.lobe is None and rng.random() < _COARSE:
            layout = Layout(material, _coarse(material, rng), wavelength_nm)
            words = f"grid {'x'.join(map(str, layout.grid.shape))}"
        else:
            least = int(rng.integers(2 if model in _SLOW else 0, len(TOLERANCES)))
            plans = _planned(material, wavelength_nm, TOLERANCES[least:])
            if plans is None:  # a lobe too narrow for any of them
                continue
            layout, tolerance = plans
            words = f"tolerance {tolerance:g}"
        parameters = ", ".join(f"{name} {value:.3g}" for name, value in material.file_parameters().items())
        yield Sound(f"{model}: {parameters}; {words}", built(layout))


def _conserves(material: Material, wavelength_nm: Any) -> bool:
    arguments = material.arguments(wavelength_nm)
    return all(
        float(np.max(spectral_albedo(material.spec, theta, phi, arguments, tolerance=1e-5).albedo))
        + float(np.max(material.specular_reflectance(theta, wavelength_nm)))
        < 1.0
        for theta in np.deg2rad(GRAZING_DEG)
        for phi in (0.0, np.pi / 2.0)
    )


def _planned(material: Material, wavelength_nm: Any, tolerances: tuple[float, ...]) -> tuple[Layout, float] | None:
    for tolerance in tolerances:
        try:
            return plan(material, wavelength_nm, tolerance), tolerance
        except ValueError as error:
            if "takes more than" not in str(error):
                raise
    return None


def _material(name: str, model: str, rng: np.random.Generator) -> Material:
    rho = float(rng.uniform(0.05, 0.85))
    rough = float(rng.uniform(3.0, 50.0))
    ward = {
        "rho_d": rho * 0.8,
        "rho_s": float(rng.uniform(0.02, 0.9 - rho * 0.8)),
        "alpha_x": float(rng.uniform(0.05, 0.3)),
    }
    ward["alpha_y"] = ward["alpha_x"] if rng.random() < 0.4 else float(rng.uniform(0.05, 0.3))
    ward["rho_s"] *= 0.2 if model in ("ward_half_vector", "ward_duer") else 1.0
    parameters: dict[str, Any] = {
        "lambert": {"rho": rho},
        "minnaert": {"k": float(rng.uniform(0.96, 1.0)), "rho": 0.8 * rho},
        "oren_nayar": {"rho": rho, "sigma_deg": rough},
        "oren_nayar_qualitative": {"rho": rho, "sigma_deg": rough},
        "oren_nayar_unidirectional": {"rho": rho, "theta_a_deg": rough, "phi_a_deg": float(rng.uniform(0.0, 90.0))},
        "oren_nayar_single_slope": {"rho": rho, "theta_a_deg": rough},
        "oren_nayar_gaussian": {"rho": rho, "sigma_deg": rough},
        "oren_nayar_body_surface": {"rho": 0.8 * rho, "sigma_deg": 20.0 + 0.5 * rough, "k_s": 0.005},
        "oren_nayar_fujii": {"rho": rho, "sigma": float(rng.uniform(0.0, 1.0))},
        "oren_nayar_energy_preserving": {"rho": rho, "roughness": float(rng.uniform(0.0, 1.0))},
        "rpv": {"rho_0": 0.2 * rho, "k": float(rng.uniform(0.95, 1.0)), "asymmetry": -0.1 * rho, "rho_c": 0.5},
        "ross_li": {"f_iso": 0.4 * rho, "f_vol": 0.02 * rho, "f_geo": 0.002 * rho},
        "torrance_sparrow": {"sigma_deg": float(rng.uniform(4.0, 9.0))},
        "he_torrance": {
            "sigma_0_um": float(rng.uniform(0.0, 0.5)),
            "tau_um": float(rng.uniform(1.5, 6.0)),
            "a": float(rng.choice([0.0, 0.02])),
        },
    }.get(model, ward if model.startswith("ward") else _ordinary(MODELS[model], rng))
    fields: dict[str, Any] = {"title": "Random", "model": model, "source": "drawn at random", "parameters": parameters}
    if MODELS[model].spectral:
        fields["refractive_index"] = str(rng.choice(METALS))
    return Material.from_table(name, fields)


def _ordinary(spec: ModelSpec, rng: np.random.Generator) -> dict[str, float]:
    """Return parameters, as files write them, from the middle of the part of each range below 1."""
    drawn = {p: p.low + rng.uniform(0.2, 0.7) * (min(p.high, 1.0) - p.low) for p in spec.parameters}
    return {written_name(p): float(degrees(x)) if p.unit == "rad" else float(x) for p, x in drawn.items()}


def _coarse(material: Material, rng: np.random.Generator) -> Grid:
    """A plain grid of few nodes, which states a large error."""
    step = float(rng.choice([5.0, 10.0, 15.0]))
    theta = np.append(np.arange(0.0, 86.0, step), 89.5)
    if not material.anisotropic:
        return Grid({"theta_i": theta, "theta_r": theta, "delta_phi": np.arange(0.0, 181.0, 2.0 * step)})
    theta, turn = theta[:: max(int(15.0 / step), 1)], 90.0 if material.spec.lobe_axes is not None else 360.0
    theta = theta if theta[-1] == 89.5 else np.append(theta, 89.5)
    phi_i, phi_r = np.arange(0.0, turn + 1.0, 30.0), np.arange(0.0, 361.0, 30.0)
    return Grid({"theta_i": theta, "phi_i": phi_i, "theta_r": theta, "phi_r": phi_r})
