"""Array arguments: masked, labelled, of other libraries, lazy; for all functions and lookups through one gate."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

import dask.array
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from brdfdb import derivatives, fresnel, integrals, models, roughness
from brdfdb.errors import DegreesWarning, ParameterError
from brdfdb.formats._readings import FileTable
from brdfdb.geometry import radians, spherical_angles, unit_vector
from brdfdb.integrals.sampling import pdf, sample
from brdfdb.materials import FunctionSource, Material, presets
from brdfdb.materials.source import Lookups
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import ModelSpec, Parameter
from brdfdb.store.family import Family
from brdfdb.store.http_client import RemoteTable
from brdfdb.tables.table import Table
from brdfdb.tables.table_base import BaseTable
from tests.models.draws import drawn
from tests.tables.made_up import made_up

SINGLE = np.float32
THETA = SINGLE([0.1, 0.5, 0.9])
LIGHTS = xr.DataArray(THETA, dims="light", coords={"light": [10, 20, 30], "run": ("light", ["a", "b", "c"])})
VIEWERS = xr.DataArray(SINGLE([0.2, 0.4, 0.6]), dims="viewer", attrs={"units": "rad"}, name="theta_r")
FOIL = {"sigma_0_um": 0.18, "tau_um": 3.0, "n": 0.77, "k": 6.08}


class OfAnotherLibrary:
    """The least that an array of another library has: it becomes NumPy, has a dtype, a device and maybe a gradient."""

    def __init__(self, values: Any, *, device: Any = "cpu", requires_grad: bool = False) -> None:
        self.values, self.device, self.requires_grad = np.asarray(values), device, requires_grad

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.array(self.values, dtype=dtype, copy=copy)


class Device:
    """A device as torch names it: `type` is "cpu" or "cuda"."""

    def __init__(self, kind: str) -> None:
        self.type = kind


WARD = {"rho_d": 0.1, "rho_s": 0.3, "alpha_x": 0.1, "alpha_y": 0.2}


@functools.cache
def looked_up(kind: str) -> dict[str, Callable[..., Any]]:
    """Each way to f_r, as a function of theta_i and theta_r: models, materials, functions, tables, files."""
    table = made_up("isotropic", np.array([400.0, 550.0, 700.0]))
    material = presets()["foam"]
    function = FunctionSource(
        brdf=lambda wi, wr, _: 0.1 + wi[:, 2] * wr[:, 2], name="made-up", title="Made up", provenance="made up"
    )
    file = FileTable("file", ("grey",), None, lambda wi, wr: 0.1 + wi[:, 2:] * wr[:, 2:])
    if kind == "angles":
        return {
            "model": lambda i, r: models.ward(i, 0.0, r, 1.0, **WARD),
            "material": lambda i, r: material.lookup(i, 0.0, r, 1.0),
            "function": lambda i, r: function.lookup(i, 0.0, r, 1.0),
            "table": lambda i, r: table.lookup(i, 0.0, r, 1.0, 500.0),
            "table of all wavelengths": lambda i, r: table.lookup(i, 0.0, r, 1.0)[..., 1],
            "file": lambda i, r: file.lookup(i, 0.0, r, 1.0),
        }
    by_vectors: dict[str, Callable[..., Any]] = {
        "model": functools.partial(models.ward_vectors, **WARD),
        "material": material.lookup_vectors,
        "function": function.lookup_vectors,
        "table": lambda wi, wr: table.lookup_vectors(wi, wr, 500.0),
        "file": file.lookup_vectors,
    }
    return {
        name: lambda i, r, look=look: look(unit_vector(i, 0.0), unit_vector(r, 1.0))
        for name, look in by_vectors.items()
    }


WAYS = [pytest.param(kind, name, id=f"{name}, {kind}") for kind in ("angles", "vectors") for name in looked_up(kind)]


@pytest.mark.parametrize(("kind", "name"), WAYS)
def test_masked_entries_are_nan_and_the_others_stay(kind: str, name: str) -> None:
    look = looked_up(kind)[name]
    masked = np.ma.array([0.1, 0.5, 0.9], mask=[False, True, False])
    found, plain = look(masked, 0.3), look(masked.data, 0.3)
    assert type(found) is np.ndarray
    assert found.tolist()[::2] == plain.tolist()[::2]
    assert np.isnan(found[1])
    assert np.isnan(look(0.3, np.ma.masked))


@pytest.mark.parametrize(("kind", "name"), WAYS)
def test_labelled_arrays_broadcast_by_name_and_the_result_is_labelled(kind: str, name: str) -> None:
    look = looked_up(kind)[name]
    found = look(LIGHTS, VIEWERS)
    expected = look(LIGHTS.values[:, np.newaxis], VIEWERS.values)
    assert (found.dims, found.shape) == (("light", "viewer"), (3, 3))
    np.testing.assert_array_equal(found.values, expected)
    assert found.coords["light"].values.tolist() == [10, 20, 30]
    assert found.coords["run"].values.tolist() == ["a", "b", "c"]
    assert (found.name, found.attrs) == (None, {})  # those of an angle would be wrong of f_r
    turned = look(LIGHTS.rename(light="viewer").drop_vars(["viewer", "run"]), VIEWERS)
    np.testing.assert_array_equal(turned.values, np.diagonal(expected))


@pytest.mark.parametrize("given", [OfAnotherLibrary(THETA), pd.Series(THETA), LIGHTS, np.ma.array(THETA)])
def test_arrays_of_all_kinds_keep_float32(given: Any) -> None:
    for name, look in looked_up("angles").items():
        expected = look(THETA, SINGLE(0.3))
        found = look(given, SINGLE(0.3))
        np.testing.assert_array_equal(np.asarray(found), expected, err_msg=name)
        assert found.dtype == expected.dtype == SINGLE, name
    for device in (Device("cpu"), "cpu", ""):
        double = models.lambert(OfAnotherLibrary(THETA.astype(np.float64), device=device), 0.0, 0.3, 0.0, rho=0.5)
        assert double.dtype == np.float64


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (OfAnotherLibrary(THETA, requires_grad=True), r"it requires a gradient, which would be lost; give \.detach"),
        (OfAnotherLibrary(THETA, device="cuda:0"), "it lies on the device cuda:0; copy it to the CPU first"),
        (OfAnotherLibrary(THETA, device=Device("cuda")), "it lies on the device cuda"),
        (dask.array.from_array(THETA), r"it is lazy \(dask\); give it computed: \.compute\(\)"),
        (LIGHTS.chunk(), r"it is lazy \(dask\)"),
        ([[0.1, 0.2], [0.3]], "its lists have unequal lengths"),
        (LIGHTS.variable, "Variable has no coordinates; give a DataArray"),
    ],
)
def test_what_cannot_be_read_as_numbers_is_refused_in_one_sentence(given: Any, sentence: str) -> None:
    for name, look in looked_up("angles").items():
        with pytest.raises(ParameterError, match=rf"^theta_i: {sentence}[^\n]*$"):
            look(given, 0.3)
        assert name
    with pytest.raises(ParameterError, match=rf"^rho: {sentence}"):
        models.lambert(0.1, 0.0, 0.3, 0.0, rho=given)


def test_an_array_with_a_unit_or_of_no_conversion_is_refused() -> None:
    class Quantity(np.ndarray):
        unit = "deg"

    class Broken:
        def __array__(self, *_: Any, **__: Any) -> Any:
            raise RuntimeError("sparse layout")

    with pytest.raises(ParameterError, match="theta_i: it bears the unit deg"):
        models.lambert(np.array([30.0]).view(Quantity), 0.0, 0.0, 0.0, rho=0.5)
    with pytest.raises(ParameterError, match="theta_i: Broken cannot become a NumPy array: sparse layout"):
        models.lambert(Broken(), 0.0, 0.0, 0.0, rho=0.5)


def test_labels_that_do_not_fit_are_refused() -> None:
    look = looked_up("angles")["table"]
    with pytest.raises(ParameterError, match=r"^theta_i, theta_r: their labels along 'light' differ; align"):
        look(LIGHTS, LIGHTS.assign_coords(light=[10, 20, 31]))
    with pytest.raises(ParameterError, match="their labels along 'light' differ"):
        look(LIGHTS, LIGHTS.drop_vars("light")[:2])
    with pytest.raises(ParameterError, match="phi_r: it has no names of dimensions"):
        models.lambert(LIGHTS, 0.0, VIEWERS, np.zeros(3), rho=0.5)
    assert models.lambert(LIGHTS, 0.0, 0.1, np.zeros(3), rho=0.5).dims == ("light",)  # one axis: nothing to mistake
    with pytest.raises(ParameterError, match="theta_i, theta_r: their rows have different labels"):
        look(pd.Series(THETA), pd.Series(THETA, index=[2, 1, 0]))
    assert np.isnan(look(pd.Series([0.1, None], dtype="Float64"), 0.3)).tolist() == [False, True]


def test_a_label_of_degrees_gives_a_warning_and_a_dimension_that_is_added_is_refused() -> None:
    table = made_up("isotropic", np.array([400.0, 700.0]))
    labelled = LIGHTS.assign_attrs(units="degree")
    with pytest.warns(DegreesWarning, match=r"^theta_i: its units are 'degree', but angles are radians"):
        np.testing.assert_array_equal(table.lookup(labelled, 0.0, 0.3, 1.0), table.lookup(LIGHTS, 0.0, 0.3, 1.0))
    with pytest.raises(ParameterError, match=r"^wavelength: the result adds this dimension"):
        table.lookup(LIGHTS.rename(light="wavelength"), 0.0, 0.3, 1.0)


def test_wavelengths_are_the_last_dimension_of_a_lookup() -> None:
    table = made_up("isotropic", np.array([400.0, 550.0, 700.0]))
    every = table.lookup(LIGHTS, 0.0, VIEWERS, 1.0)
    assert every.dims == ("light", "viewer", "wavelength")
    assert every.coords["wavelength"].values.tolist() == [400.0, 550.0, 700.0]
    bands = xr.DataArray([450.0, 500.0], dims="band")
    some = table.lookup(LIGHTS, 0.0, VIEWERS, 1.0, bands)
    assert (some.dims, some.shape) == (("light", "viewer", "band"), (3, 3, 2))
    assert table.lookup(0.1, 0.0, 0.2, 1.0, bands).tolist() == table.lookup(0.1, 0.0, 0.2, 1.0, [450.0, 500.0]).tolist()
    assert table.specular_reflectance(LIGHTS, 500.0).dims == ("light",)
    colours = FileTable("file", ("R", "G", "B"), None, lambda wi, _: np.repeat(wi[:, 2:], 3, axis=1))
    assert colours.lookup(LIGHTS, 0.0, 0.1, 0.0).coords["channel"].values.tolist() == ["R", "G", "B"]
    with pytest.raises(ParameterError, match="wavelength_nm: nan is not a positive number of nanometres"):
        table.lookup(0.1, 0.0, 0.2, 1.0, np.ma.array([450.0, 500.0], mask=[False, True]))


def test_results_of_several_arrays_and_of_matrices_are_labelled() -> None:
    vectors = unit_vector(LIGHTS, 0.0)
    assert vectors.dims == ("light", "component")
    assert [angle.dims for angle in spherical_angles(vectors)] == [("light",)] * 2
    gradient = derivatives.gradient("ward", LIGHTS, 0.0, VIEWERS, 1.0, **WARD)
    assert {values.dims for values in (gradient.f_r, *gradient.derivatives.values())} == {("light", "viewer")}
    rho = xr.DataArray([0.1, 0.2], dims="paint")
    of_vectors = derivatives.gradient_vectors("ward", vectors, [0.0, 0.0, 1.0], **WARD | {"rho_d": rho})
    assert of_vectors.f_r.dims == ("light", "paint")
    parts = models.oren_nayar_parts(LIGHTS, 0.0, VIEWERS, 1.0, rho=0.5, sigma=0.3)
    assert {part.dims for part in parts} == {("light", "viewer")}
    mueller = models.he_torrance_mueller(LIGHTS, 0.0, 0.3, 1.0, wavelength_nm=550.0, **FOIL)
    assert (mueller.dims, mueller.shape) == (("light", "stokes_reflected", "stokes_incident"), (3, 4, 4))
    drawn_viewers = sample("lambert", 0.3, 0.7, vectors, rho=rho)
    assert (drawn_viewers.wr.dims, drawn_viewers.pdf.dims) == (("light", "paint", "component"), ("light", "paint"))
    assert pdf("lambert", vectors, vectors, rho=0.5).dims == ("light",)
    assert integrals.quadrature.directional_albedo("lambert", LIGHTS, rho=0.5).albedo.dims == ("light",)
    assert roughness.alpha_from_slope(rho).dims == ("paint",)
    assert fresnel.amplitudes(rho, 1.5, 0.0)[0].dims == ("paint",)
    assert radians(LIGHTS).dims == ("light",)
    assert np.isnan(radians(np.ma.array([1.0, 2.0], mask=[False, True]))).tolist() == [False, True]


def test_an_array_for_the_result_is_plain() -> None:
    out = np.empty((3, 3), SINGLE)
    labelled = models.lambert(LIGHTS, SINGLE(0.0), VIEWERS, SINGLE(0.0), rho=0.5, out=out)
    assert labelled.dims == ("light", "viewer")
    np.testing.assert_array_equal(out, labelled.values)
    for wrong in (np.ma.empty(3), OfAnotherLibrary(np.empty(3)), LIGHTS.astype(np.float64)):
        with pytest.raises(ParameterError, match=f"^out: it is of type {type(wrong).__name__}"):
            models.lambert(np.zeros(3), 0.0, 0.0, 0.0, rho=0.5, out=wrong)


def gated(function: Callable[..., Any]) -> bool:
    """True if the code of a function, or of one that it wraps, goes through the gate."""
    while function is not None:
        if "entered" in function.__code__.co_names or "_of_arrays" in function.__code__.co_names:
            return True
        function = getattr(function, "__wrapped__", None)  # type: ignore[assignment]
    return False


def test_every_function_of_directions_and_every_lookup_has_the_gate() -> None:
    assert [name for name in models.__all__ if name != "MODELS" and not gated(getattr(models, name))] == []
    classes = (Lookups, BaseTable, Table, RemoteTable, Family, Material, FunctionSource, FileTable)
    methods = [method for each in classes for name, method in vars(each).items() if not name.startswith("_")]
    for method in filter(inspect.isfunction, methods):
        first = [*inspect.signature(method).parameters][1:2]
        if {*first} & {"theta_i", "theta_d", "wi", "w_i", "u1"} and not hasattr(method, "__isabstractmethod__"):
            assert gated(method), method


@pytest.mark.parametrize("spec", models.MODELS.values(), ids=lambda spec: spec.name)
def test_every_model_reads_masks_and_labels_of_angles_and_parameters(spec: ModelSpec) -> None:
    parameters = drawn(spec, np.random.default_rng(5))
    masked = np.ma.array([0.2, 0.7], mask=[False, True])
    found, plain = (spec.evaluate(theta, 0.1, 0.4, 2.0, **parameters) for theta in (masked, masked.data))
    assert found[0] == plain[0]
    assert np.isnan(found[1])
    wi, wr = unit_vector(masked, 0.1), unit_vector(0.4, 2.0)
    assert np.isnan(spec.vectors(wi, wr, **parameters)).tolist() == [False, True]
    name = next(parameter.name for parameter in spec.parameters)
    paint = xr.DataArray(np.full(2, parameters[name]), dims="paint")
    labelled = spec.evaluate(LIGHTS, 0.1, VIEWERS, 2.0, **parameters | {name: paint})
    assert labelled.dims == ("light", "viewer", "paint")
    expected = spec.evaluate(LIGHTS.values[:, None], 0.1, VIEWERS.values, 2.0, **parameters)
    np.testing.assert_allclose(labelled.isel(paint=1), expected, rtol=1e-6)
    with pytest.raises(ParameterError, match=f"^{name}: nan is outside"):
        spec.evaluate(0.2, 0.1, 0.4, 2.0, **parameters | {name: np.ma.array([parameters[name]], mask=[True])})


def test_a_model_of_others_without_the_gate_takes_masks_and_refuses_labels() -> None:
    rho = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo")
    with pytest.raises(ParameterError, match=r"^rho: its dimensions light would lose their names here; .*\.values"):
        rho.check(LIGHTS)
    assert rho.check(LIGHTS[0]) == SINGLE(0.1)


def test_samples_read_masks_and_pair_rows_of_one_dimension_alone() -> None:
    def samples(**changes: Any) -> Samples:
        angles = {name: np.full(3, 0.1) for name in ("theta_i", "phi_i", "theta_r", "phi_r")}
        given = {"name": "some", "channels": ("grey",), "wavelength_nm": None, "values": np.ones((3, 1)), **angles}
        return Samples(**given | changes)

    masked = np.ma.array(np.ones((3, 1)), mask=[[0], [1], [0]])
    assert samples(values=masked).known[:, 0].tolist() == [True, False, True]
    assert samples(theta_i=LIGHTS, theta_r=LIGHTS).theta_i.tolist() == THETA.tolist()
    with pytest.raises(ParameterError, match="theta_i, theta_r: their rows are the dimensions 'light' and 'viewer'"):
        samples(theta_i=LIGHTS, theta_r=VIEWERS)
    with pytest.raises(ParameterError, match="theta_i: nan is not an angle"):
        samples(theta_i=np.ma.array(THETA, mask=[0, 1, 0]))
    with pytest.raises(ParameterError, match="values: it is lazy"):
        samples(values=dask.array.ones((3, 1)))
