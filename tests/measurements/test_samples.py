"""Samples: what they refuse, what they know of themselves, and the way through xarray."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from brdfdb.errors import ParameterError
from brdfdb.measurements import Instrument, Samples, joined
from brdfdb.measurements.statement import statement


def samples(**changes: Any) -> Samples:
    """Four samples of two incidences, with a hole."""
    given: dict[str, Any] = {
        "name": "sheet",
        "theta_i": np.radians([10.0, 10.0, 40.0, 40.0]),
        "phi_i": np.zeros(4),
        "theta_r": np.radians([0.0, 20.0, 0.0, 20.0]),
        "phi_r": np.radians([0.0, 180.0, 0.0, 180.0]),
        "channels": ("450nm", "650nm"),
        "wavelength_nm": np.array([450.0, 650.0]),
        "values": np.array([[0.1, 0.2], [0.3, np.nan], [0.5, 0.6], [0.7, 0.8]]),
        "uncertainty": np.full((4, 2), 0.01),
        "bandwidth_nm": np.array([10.0, 12.0]),
        "instrument": Instrument("bench", 1e-4, 2e-4, 5.0, "unpolarised"),
        "provenance": "our bench",
        "record": {"operator": "A", "lamps": [1, 2]},
    }
    return Samples(**given | changes)


def test_a_hole_is_known_and_incidences_are_numbered() -> None:
    assert samples().known.tolist() == [[True, True], [True, False], [True, True], [True, True]]
    turned, normal = np.array([0.0, 0.0, 1.0, 1.0]), np.zeros(4)  # all azimuths at the normal are one incidence
    for some, incidence, turns in (
        (samples(), [0, 0, 1, 1], False),
        (samples(phi_i=turned), [0, 0, 1, 1], True),
        (samples(phi_i=turned, theta_i=normal), [0, 0, 0, 0], False),
    ):
        assert (some.incidence.tolist(), some.turned) == (incidence, turns)


@pytest.mark.parametrize("noise_deg", [0.0, 0.02, 0.05])
def test_lights_as_encoders_read_them_are_one_incidence(noise_deg: float) -> None:
    lights = np.radians([[0.0, 0.0], [10.0, 0.0], [11.0, 0.0], [40.0, 0.0], [40.0, 20.0], [70.0, 359.9]])
    number = np.repeat(np.arange(6), 50)
    read = lights[number] + np.radians(noise_deg) * np.random.default_rng(2).standard_normal((300, 2))
    theta_i, phi_i = np.abs(read[:, 0]), read[:, 1]
    some = Samples("read", theta_i, phi_i, np.zeros(300), phi_i, ("grey",), None, np.ones((300, 1)))
    of_first = [set(some.incidence[number == light]) for light in range(6)]
    assert [len(numbers) for numbers in of_first] == [1] * 6
    assert len(set.union(*of_first)) == 6
    assert some.turned
    assert not some.selected(number < 4).turned


def test_scattered_lights_are_incidences_of_their_own() -> None:
    theta_i, zeros = np.radians(np.random.default_rng(3).uniform(0.0, 80.0, 600)), np.zeros(600)
    some = Samples("scattered", theta_i, zeros, zeros, zeros, ("grey",), None, np.ones((600, 1)))
    assert np.unique(some.incidence).size > 400  # a few pairs and triples are apart from the others, by chance
    assert not some.scanned


def test_repeats_are_one_viewer_of_a_scan() -> None:
    one = samples()
    repeated = one.selected(np.repeat(np.arange(4), 20))
    assert np.unique(repeated.pair).size == 4
    assert not repeated.scanned


def test_a_selection_keeps_rows_together() -> None:
    some = samples().selected(np.array([False, True, False, True]))
    assert len(some) == 2
    assert some.values[1].tolist() == [0.7, 0.8]
    assert some.uncertainty.shape == (2, 2)


def test_nothing_is_lost_through_xarray_and_netcdf(tmp_path: Path) -> None:
    some = samples()
    some.to_xarray().to_netcdf(tmp_path / "samples.nc")
    with xr.open_dataset(tmp_path / "samples.nc") as dataset:
        again = Samples.from_xarray(dataset)
    for name in ("theta_i", "phi_i", "theta_r", "phi_r"):
        np.testing.assert_allclose(getattr(again, name), getattr(some, name), rtol=1e-14)
    for name in ("values", "uncertainty", "wavelength_nm", "bandwidth_nm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(some, name))
    for name in ("name", "channels", "instrument", "provenance", "record"):
        assert getattr(again, name) == getattr(some, name)


def test_a_plain_dataset_of_radians_is_enough() -> None:
    at = {"units": "rad"}
    angles = {name: ("sample", [0.1, 0.2], at) for name in ("theta_i", "theta_r", "phi_r")}
    some = Samples.from_xarray(xr.Dataset({"brdf": ("sample", [1.0, 2.0]), **angles}))
    assert some.channels == ("grey",)
    assert some.theta_i.tolist() == [0.1, 0.2]
    assert some.phi_i.tolist() == [0.0, 0.0]


def test_samples_that_cannot_be_are_refused_by_parameter() -> None:
    below = np.radians([0.0, 20.0, 0.0, 95.0])
    refused: dict[str, tuple[Any, ...]] = {
        "theta_i": (np.full(4, -0.1), np.full(4, 4.0), 0.1),
        "theta_r": (below,),
        "phi_i": (None,),
        "phi_r": (np.array([0.0, np.nan, 0.0, 0.0]),),
        "values": (np.ones((4, 3)), np.full((4, 2), np.inf), None, "high"),
        "uncertainty": (-np.ones((4, 2)), np.full((4, 2), np.inf)),
    }
    for name, values in refused.items():
        for value in values:
            with pytest.raises(ParameterError, match=f"^{name}: "):
                samples(**{name: value})
    with pytest.raises(ParameterError, match=r"^theta_r: 95 degrees is below the horizon"):
        samples(theta_r=below)
    with pytest.raises(ParameterError, match=r"^phi_i: shape"):
        samples(theta_i=np.zeros(5))
    with pytest.raises(ParameterError, match=r"^source_solid_angle_sr: -1 is not a positive number$"):
        Instrument(source_solid_angle_sr=-1.0)
    bare = {name: ("sample", [0.1]) for name in ("theta_i", "theta_r", "phi_r")}
    with pytest.raises(ParameterError, match=r"^theta_i: its units are 'missing'"):
        Samples.from_xarray(xr.Dataset({"brdf": ("sample", [1.0]), **bare}))
    with pytest.raises(ParameterError, match=r"^dataset: it has no brdf"):
        Samples.from_xarray(xr.Dataset(bare))


@pytest.mark.parametrize(("units", "scale"), [("um", 1e3), ("\u00b5m", 1e3), ("m", 1e9), ("nm", 1.0)])
def test_wavelengths_and_bandwidths_of_a_dataset_have_the_units_that_it_states(units: str, scale: float) -> None:
    dataset = samples(bandwidth_nm=np.array([5.0, 10.0])).to_xarray()
    for name in ("wavelength", "bandwidth"):
        dataset[name] = ("channel", dataset[name].values / scale, {"units": units})
    read = Samples.from_xarray(dataset)
    assert read.wavelength_nm == pytest.approx([450.0, 650.0])
    assert read.bandwidth_nm == pytest.approx([5.0, 10.0])


@pytest.mark.parametrize(
    ("name", "units", "allowed"),
    [
        ("brdf", "percent", "allowed is sr-1"),
        ("uncertainty", "%", "allowed is sr-1"),
        ("wavelength", "cm-1", "allowed are nm, um and m"),
        ("bandwidth", "eV", "allowed are nm, um and m"),
    ],
)
def test_other_units_of_a_dataset_are_refused(name: str, units: str, allowed: str) -> None:
    whole = samples(bandwidth_nm=np.array([5.0, 10.0]))
    dataset = replace(whole, uncertainty=0.1 * np.abs(whole.values)).to_xarray()
    dataset[name].attrs["units"] = units
    with pytest.raises(ParameterError, match=f"{name}: its units are '{units}'; {allowed}"):
        Samples.from_xarray(dataset)


def test_joined_files_that_contradict_say_so() -> None:
    first = samples(uncertainty=None)
    twice = joined([first, replace(first, values=1.4 * first.values, phi_r=first.phi_r + 2.0 * np.pi)])
    sentence = "At 4 directions that both files have, f_r differs by 40 % in the median."
    assert sentence in statement(twice).sentences
    dark = replace(first, values=0.5 * first.values, name="dark")
    said = joined([first, first, dark]).record["contradiction"]
    assert said.startswith("At 4 directions that dark and files before")
    elsewhere = replace(first, values=9.0 * first.values, phi_i=np.ones(4), theta_i=first.theta_i + 0.1)
    for other in (replace(first, values=1.1 * first.values), elsewhere):
        assert "contradiction" not in joined([first, other]).record


def test_joined_files_that_differ_in_their_lobe_alone_say_so() -> None:
    """Two paints of other gloss agree but for a sixth of the directions; 5 % of noise do not differ."""
    rng = np.random.default_rng(1)
    angles = {name: rng.uniform(0.0, 1.5, 200) for name in ("theta_i", "phi_i", "theta_r", "phi_r")}
    flat = Samples("flat", **angles, channels=("grey",), wavelength_nm=None, values=np.full((200, 1), 0.1))
    lobe = np.where(np.arange(200) < 30, 2.0, 1.01)[:, np.newaxis]
    said = joined([flat, replace(flat, values=flat.values * lobe)]).record["contradiction"]
    assert said.endswith("f_r differs by 1 % in the median, and by more than 100 % at a tenth.")
    noisy = replace(flat, values=flat.values * np.exp(rng.normal(0.0, 0.05, (200, 1))))
    assert "contradiction" not in joined([flat, noisy]).record


def test_joined_files_that_differ_beyond_their_uncertainties_say_so() -> None:
    first = samples(uncertainty=np.full((4, 2), 0.001))
    sentence = joined([first, replace(first, values=1.1 * first.values)]).record["contradiction"]
    assert sentence.endswith("f_r differs by 10 % in the median, which is beyond the stated uncertainties.")


def test_uncertainty_of_nan_alone_is_not_known() -> None:
    assert samples(uncertainty=np.full((4, 2), np.nan)).uncertainty is None
    assert samples(uncertainty=np.where(np.eye(4, 2) > 0.0, 0.1, np.nan)).uncertainty is not None


def test_joined_files_have_the_name_notes_and_counts_of_all() -> None:
    parts = [
        samples(name="tile_10deg", record={"notes": ["a", "b"], "repeated": 1, "columns_left_out": ["t"]}),
        samples(name="tile_30deg", record={"notes": ["b", "c"], "repeated": 2}, uncertainty=None),
    ]
    both = joined(parts)
    assert both.name == "tile"
    assert both.uncertainty is None
    left_out = "Standard uncertainties were left out: tile_30deg states none."
    assert both.record["notes"] == ["a", "b", "c", left_out]
    assert (both.record["repeated"], both.record["columns_left_out"]) == (3, ["t"])
    assert left_out in statement(both).sentences
    assert joined([samples(name="oak"), samples(name="elm")]).name == "oak and elm"
    assert joined([samples(name="sheet1"), samples(name="sheet2")]).name == "sheet"


def test_files_of_other_wavelengths_are_joined_as_channels_and_the_same_ones_as_repeats() -> None:
    first = samples(bandwidth_nm=None)
    at_550 = replace(
        first, channels=("550nm",), wavelength_nm=np.array([550.0]), values=first.values[:, :1] + 1.0, uncertainty=None
    )
    again = replace(at_550.selected(np.array([0, 2])), values=np.array([[1.11], [1.52]]), name="again")
    both = joined([first, at_550, again])
    assert both.channels == ("450nm", "550nm", "650nm")
    order = np.lexsort((both.values[:, 1], both.theta_r, both.theta_i))
    expected = [[0.1, 1.1, 0.2], [np.nan, 1.11, np.nan], [0.3, 1.3, np.nan]]
    expected += [[0.5, 1.5, 0.6], [np.nan, 1.52, np.nan], [0.7, 1.7, 0.8]]
    np.testing.assert_allclose(both.values[order], expected)
    assert np.degrees(both.theta_r[order]) == pytest.approx([0.0, 0.0, 20.0, 0.0, 0.0, 20.0])
    assert "joined to channels of 450, 550, 650 nm; where several" in " ".join(both.record["notes"])
    assert both.uncertainty is None
    same = joined([first, replace(first, uncertainty=0.5 * np.ones((4, 2)))])
    assert len(same) == 8
    with pytest.raises(ParameterError, match="has the channels grey"):
        joined([first, replace(at_550, channels=("grey",), wavelength_nm=None)])
