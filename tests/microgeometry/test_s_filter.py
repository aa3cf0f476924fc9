"""The S-filter: its transmission, the noise that it leaves, and the maps that need it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.microgeometry.height_map_files import MeasuredHeights
from brdfdb.microgeometry.levelling import Levelled, LevellingOptions, levelled
from brdfdb.microgeometry.s_filter import noise_gains, s_filtered, slopes_of
from tests.microgeometry.made_maps import MadeMap

STEPS = (0.5, 0.25)  # um


def ready(heights_um: NDArray[np.float64], steps_um: tuple[float, float] = STEPS) -> Levelled:
    return levelled(MeasuredHeights(heights_um, *steps_um), LevellingOptions(level="none"))


@pytest.mark.parametrize("wavelength_um", [4.0, 8.0, 16.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_wave_keeps_the_share_of_its_amplitude_that_the_standard_states(wavelength_um: float, axis: int) -> None:
    # ISO 16610-61: half at the cutoff of 8 um, and 2^-(cutoff / wavelength)^2 elsewhere
    x, y = (np.arange(count) * step for count, step in zip((256, 512), STEPS, strict=True))
    along = x[:, np.newaxis] if axis == 0 else y
    wave = np.sin(2.0 * np.pi * along / wavelength_um) + np.zeros((256, 512))
    filtered = s_filtered(ready(wave), 8.0).levelled.measured.heights_um
    assert filtered.shape == (256 - 2 * 8, 512 - 2 * 16)  # half a cutoff is cut off at each edge
    amplitude = 0.5 * np.ptp(filtered[32:-32, 64:-64])
    assert amplitude == pytest.approx(2.0 ** -((8.0 / wavelength_um) ** 2), rel=0.01)


def test_the_shortest_cutoff_leaves_half_of_its_wave() -> None:
    wave = np.sin(2.0 * np.pi * 0.5 * np.arange(256)[:, np.newaxis] / 2.0 + 0.25 * np.pi) + np.zeros((256, 512))
    filtered = s_filtered(ready(wave), 2.0).levelled.measured.heights_um  # four steps along x
    assert np.abs(filtered[32:-32]).max() == pytest.approx(0.5 * np.sqrt(0.5), rel=0.01)


def test_the_noise_that_a_filter_leaves_is_that_of_white_noise() -> None:
    assert noise_gains(0.0, STEPS) == pytest.approx(np.sqrt(2.0) / np.array(STEPS))  # differences of two heights
    # A Gaussian of standard deviation s leaves slopes of step_x step_y / (8 pi s^4) in the limit of small steps
    s = np.sqrt(np.log(2.0) / np.pi) * 8.0 / np.sqrt(2.0 * np.pi)
    assert noise_gains(8.0, STEPS) == pytest.approx(2 * [np.sqrt(0.5 * 0.25 / (8.0 * np.pi)) / s**2], rel=0.03)
    noise = np.random.default_rng(5).standard_normal((512, 512))
    measured = slopes_of(s_filtered(ready(noise), 2.0, 0.0).levelled.measured.heights_um, STEPS)
    # about 260 000 heights over 60 in a correlated area: a standard error of 1 % at most
    assert measured == pytest.approx(noise_gains(2.0, STEPS), rel=0.04)


def noisy(noise: float, correlation: str = "gaussian") -> Levelled:
    return levelled(MadeMap(correlation, noise=noise).measured(2))


def test_a_filter_takes_the_noise_and_the_share_of_slopes_that_its_transmission_states() -> None:
    clean, rough = noisy(0.0), noisy(0.05)
    steps = (0.5, 0.5)
    true = slopes_of(clean.measured.heights_um, steps)  # sqrt(2) 0.5 / 5
    assert slopes_of(rough.measured.heights_um, steps)[0] > 1.3 * true[0]
    found = s_filtered(rough, 2.5)
    after = np.array(slopes_of(found.levelled.measured.heights_um, steps))
    left = 0.05 * np.array(noise_gains(2.5, steps))
    # slopes of a Gaussian correlation have the spectrum k^2 exp(-k^2 tau^2 / 4), and the filter exp(-k^2 s^2) of it:
    # their variance falls by 1 / (1 + 4 s^2 / tau^2)^2
    s = np.sqrt(np.log(2.0) / np.pi) * 2.5 / np.sqrt(2.0 * np.pi)
    assert np.sqrt(after**2 - left**2) == pytest.approx(np.array(true) / (1.0 + 4.0 * s**2 / 5.0**2), rel=0.01)
    assert "0.05 um, from the flat end of the spectrum; slopes along x and y: " in found.sentence


@pytest.mark.parametrize(
    ("map_of", "cutoff_um", "noise_um", "sentence"),
    [
        (0.05, None, None, "is missing for a map with noise of the instrument: 0.0"),
        (0.05, None, 0.05, "is missing for a map with noise of the instrument: 0.05 um, as given"),
        (0.0, 1.9, None, r"1.9 um is outside \[2, 9.6\] um"),
        (0.0, 9.7, None, r"9.7 um is outside \[2, 9.6\] um"),
    ],
)
def test_noise_without_a_filter_and_cutoffs_outside_the_map_are_refused(
    map_of: float, cutoff_um: float | None, noise_um: float | None, sentence: str
) -> None:
    with pytest.raises(ParameterError, match=sentence) as raised:
        s_filtered(noisy(map_of), cutoff_um, noise_um)
    assert raised.value.parameter == "s_filter_um"


def test_noise_that_changes_little_or_cannot_be_told_from_roughness_is_stated() -> None:
    assert s_filtered(noisy(0.0), None).sentence.endswith(" um, negligible")
    given = s_filtered(noisy(0.0), None, 0.01)  # of slopes of 0.14, 0.028 are noise: 2 %
    assert (
        "0.01 um, as given; it is left in; slopes along x and y: 0.139 and 0.143 as measured, 0.136 and 0.141 without"
        in given.sentence
    )
    rough = s_filtered(noisy(0.0, "exponential"), None)
    assert "not separable from roughness; it is left in; slopes" in rough.sentence
    assert "at least" in rough.sentence
    assert "it is left in" in s_filtered(noisy(0.05), 0.0).sentence
    few = ready(np.random.default_rng(1).standard_normal((9, 9)))
    assert "not separable from roughness; it is left in" in s_filtered(few, None).sentence
    assert "0.01 um, as given; it is left in" in s_filtered(few, None, 0.01).sentence


def test_the_cutoff_that_is_proposed_is_the_shortest_that_leaves_one_percent_of_the_mean_squares_to_noise() -> None:
    with pytest.raises(ParameterError) as raised:
        s_filtered(noisy(0.05), None, 0.05)
    words = raised.value.sentence
    cutoff = float(words.partition("such as ")[2].partition(",")[0])
    without = [float(slope) for slope in words.partition("measured, ")[2].partition(" without")[0].split(" and ")]
    left, shorter = (0.05 * noise_gains(value, (0.5, 0.5))[0] / min(without) for value in (cutoff, cutoff / 1.25))
    assert left**2 <= 0.01 < shorter**2
