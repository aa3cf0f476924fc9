"""Hypotheses on what files mean: the right option is named where samples can tell, and none on right files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.materials import presets
from brdfdb.measurements import Samples
from brdfdb.measurements.conventions import RELATIVE
from brdfdb.measurements.statement import statement
from tests.benchmarks.conventions import SURFACES, Directions, judged

LIGHTS, POLAR, TURNS = (10.0, 30.0, 50.0, 70.0), np.arange(10.0, 81.0, 10.0), np.arange(0.0, 360.0, 15.0)


def sheet(
    f_r: Any,
    lights: Any = LIGHTS,
    polar: Any = POLAR,
    turns: Any = TURNS,
    phi_i: Any = (0.0,),
    noise: float = 0.02,
    **others: Any,
) -> Samples:
    """Return samples on a grid of directions [degree], with noise; f_r is a function of `Directions`, or a surface."""
    grids = np.meshgrid(np.radians(lights), np.radians(phi_i), np.radians(polar), np.radians(turns), indexing="ij")
    i, p, r, d = (grid.reshape(-1) for grid in grids)
    values = (SURFACES[f_r] if isinstance(f_r, str) else f_r)(Directions(i, r, d))
    values = values * np.exp(np.random.default_rng(3).normal(0.0, noise, i.size))
    record = {} if len(phi_i) > 1 else {"azimuths": RELATIVE}
    record |= others.pop("record", {})
    return Samples("sheet", i, p, r, p + d, ("grey",), None, values[:, np.newaxis], record=record, **others)


def test_right_options_are_named_and_no_others(tmp_path: Path) -> None:
    """Files of twelve surfaces, right and by nine wrong conventions, with 2 % of noise: as the benchmark, but few."""
    files = list(judged(np.random.default_rng(2), 0.02, tmp_path))
    can = [file for file in files if file.can]
    assert len(files) == 120
    assert len(can) > 60
    assert np.mean([file.is_right for file in can]) >= 0.95
    assert [file for file in files if file.is_false] == []


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@pytest.mark.parametrize(
    "directions",
    [
        {"lights": (0.0, 30.0, 60.0), "polar": np.arange(0.0, 86.0, 5.0), "turns": np.arange(0.0, 181.0, 15.0)},
        {"lights": (45.0,)},
        {"lights": (20.0, 45.0, 60.0), "polar": (0.0, 20.0, 45.0, 60.0), "turns": (0.0, 180.0)},
        {"lights": (0.0, 1.0), "polar": np.arange(0.05, 1.5, 0.05), "turns": (0.0, 180.0)},
        {"lights": (15.0, 30.0, 45.0, 60.0), "polar": np.arange(0.0, 80.0, 2.5), "turns": (180.0,)},
        {"phi_i": (0.0, 45.0, 90.0)},
    ],
)
def test_right_files_are_not_doubted(directions: dict[str, Any], noise: float) -> None:
    for surface in SURFACES:
        assert statement(sheet(surface, noise=noise, **directions)).hints == (), surface


def test_pairs_state_both_numbers_and_the_option() -> None:
    """Pairs of f_r = 0.019 cos theta_i differ by the cosines, and agree exactly once they are divided."""
    known = statement(sheet(lambda at: 0.019 * np.cos(at.theta_i), polar=LIGHTS, turns=(0.0, 180.0), noise=0.0))
    a, b = np.cos(np.radians(np.array(LIGHTS)))[np.array(np.triu_indices(4, 1))]
    expected = 100.0 * np.median(np.abs(a - b) / (a + b))
    (hint,) = known.hints
    start = (
        f"Reciprocity? The asymmetry of 12 pairs has a median of {expected:.0f} % as f_r, and of less than 0.01 % if"
    )
    assert hint == f"{start} the values are f_r cos theta_i: --quantity f_r_cos_i."


def test_no_cosine_is_named_where_pairs_disagree_beyond_the_noise() -> None:
    """(cos theta_i cos theta_r)^0.7 of Minnaert, whose theta_i counts from the surface: no cosine mends it."""
    known = statement(
        sheet(lambda at: 0.1 * (np.sin(at.theta_i) * np.cos(at.theta_r)) ** 0.7, lights=np.arange(20.0, 81.0, 10.0))
    )
    assert known.hints == ()
    assert "beyond the noise" in known.untold[0]


@pytest.mark.parametrize("aoi", [5.0, 45.0])
def test_scatter_of_polished_mirrors_is_not_too_dark(aoi: float) -> None:
    """Scatter falls with the square of the angle to the mirror direction, and a coating a thousand times too dark."""

    def scatter(at: Directions) -> Any:
        wi, wr = at.vectors
        return 1e-9 / np.maximum(np.sum((wi + wr)[:, :2] ** 2, axis=1), 1e-6)

    plane = {"lights": (aoi,), "polar": np.arange(0.0, 81.0, 1.0), "turns": (0.0, 180.0)}
    assert statement(sheet(scatter, **plane)).hints == ()
    assert "Too dark" in statement(sheet(lambda at: 1e-3 * SURFACES["black coating"](at), **plane)).hints[0]


def test_a_quantity_that_was_stated_wrong_is_doubted_with_the_right_one() -> None:
    """The reader divided f_r by the cosine of the viewer."""
    (hint,) = statement(sheet(lambda at: 0.1 / np.cos(at.theta_r), record={"quantity": "f_r_cos"})).hints
    assert "as f_r cos theta_r" in hint
    assert hint.endswith("if the values are f_r: --quantity f_r.")


def test_samples_between_lights_stand_for_pairs() -> None:
    """No viewer has the polar angle of a light, and swaps are interpolated."""
    off = {"lights": (12.0, 27.0, 42.0, 57.0, 72.0), "polar": np.arange(0.0, 80.0, 5.0)}
    right = sheet("black coating", **off)
    assert statement(right).hints == ()
    (hint,) = statement(sheet(lambda at: SURFACES["black coating"](at) * np.cos(at.theta_i), **off)).hints
    assert "interpolated swaps" in hint
    assert "--quantity f_r_cos_i" in hint


@pytest.mark.parametrize(
    ("record", "viewer", "word"),
    [
        ({}, lambda p, d: d + 0.0 * p, "light"),
        ({}, lambda p, d: d - np.pi + 0.0 * p, "mirror"),
        ({"viewer_azimuth": "light"}, lambda p, d: (2.0 * p + d) % (2.0 * np.pi), "absolute"),
    ],
)
def test_lobes_that_turn_with_the_light_are_doubted(record: dict[str, str], viewer: Any, word: str) -> None:
    """Azimuths of viewers count from another direction than that of the file, and lights come from six azimuths."""
    right = sheet("glossy paint", lights=(30.0, 60.0), phi_i=np.arange(0.0, 360.0, 60.0))
    assert statement(right).hints == ()
    wrong = replace(right, phi_r=viewer(right.phi_i, right.phi_r - right.phi_i), record=record)
    (hint,) = statement(wrong).hints
    assert hint.endswith(f"--azimuth {word}.")


@pytest.mark.parametrize("offsets", [(40.0,) * 4, (150.0,) * 4, (-90.0,) * 4, (37.0, 111.0, 185.0, 222.0)])
def test_lobes_beside_the_plane_of_incidence_are_doubted(offsets: Any) -> None:
    """Azimuths have an offset, which no option mends, or that of each light, as absolute azimuths of viewers do."""
    right = sheet("glossy paint", lights=(25.0, 40.0, 55.0, 70.0))
    light = np.searchsorted((25.0, 40.0, 55.0, 70.0), np.degrees(right.theta_i) - 1.0)
    (hint,) = statement(replace(right, phi_r=right.phi_r + np.radians(np.array(offsets)[light]))).hints
    assert hint.startswith("Azimuths? Lobes of 4 lights lie beside the plane of incidence")
    if len(set(offsets)) == 1:
        assert abs(int(hint.split(" degrees")[0].split()[-1]) - (180.0 + offsets[0]) % 360.0) <= 15.0
        assert "correct the file" in hint
    else:
        assert "absolute" in hint


def test_forward_azimuths_are_doubted_for_lights_from_several_azimuths_and_not_for_a_hot_spot() -> None:
    """Lobes at lights of 30 and 50 degrees at four azimuths; two lights do not tell a lobe that grows as 1/cos."""
    right = sheet(
        "glossy paint", lights=(30.0, 50.0), phi_i=(0.0, 90.0, 180.0, 270.0), turns=np.arange(0.0, 360.0, 30.0)
    )
    assert statement(right).hints == ()
    assert "--azimuth forward" in statement(replace(right, phi_r=(right.phi_r + np.pi) % (2.0 * np.pi))).hints[0]

    def moon(at: Directions) -> Any:
        wi, wr = at.vectors
        angle = np.arccos(np.clip(np.sum(wi * wr, axis=1), -1.0, 1.0))
        return 0.05 / (wi[:, 2] + wr[:, 2]) * (1.0 + 1.2 * np.exp(-angle / 0.12)) * (1.0 + 0.3 * np.cos(angle) ** 2)

    for noise in (0.0, 0.02):
        axes = {"lights": (0.0, 30.0, 60.0), "polar": (0.0, 30.0, 60.0), "turns": np.arange(0.0, 360.0, 60.0)}
        assert statement(sheet(moon, **axes, noise=noise)).hints == ()


@pytest.mark.parametrize("full", [True, False])
def test_rings_with_two_lobes_or_a_hole_do_not_tell_elevations(full: bool) -> None:
    """The hot spot of the moon (Hapke 1981) fades beside its forward lobe, and a lobe in a hole leaves its flanks."""

    def moon(at: Directions) -> Any:
        wi, wr = at.vectors
        cosine = np.clip(np.sum(wi * wr, axis=1), -1.0, 1.0)
        hot = 1.0 + 1.0 / (1.0 + np.tan(0.5 * np.arccos(cosine)) / 0.06)
        back = 0.91 / (1.09 + 0.6 * cosine) ** 1.5
        h_i, h_r = ((1.0 + 2.0 * w) / (1.0 + 1.79 * w) for w in (wi[:, 2], wr[:, 2]))
        return 0.016 * (hot * back + h_i * h_r - 1.0) / (wi[:, 2] + wr[:, 2])

    turns = np.arange(0.0, 360.0 if full else 181.0, 30.0 if full else 15.0)
    lights = (10.0, 30.0, 50.0, 65.0) if full else (20.0, 40.0, 60.0, 75.0)
    assert statement(sheet(moon, lights, np.arange(0.0, 81.0, 5.0), turns, noise=0.0)).hints == ()
    right = sheet("black coating", turns=turns, noise=0.0)
    wi, wr = Directions(right.theta_i, right.theta_r, right.phi_r).vectors
    near = np.sum(wi * wr * [-1.0, -1.0, 1.0], axis=1) > np.cos(np.radians(20.0))
    for known in (replace(right, values=np.where(near[:, np.newaxis], np.nan, right.values)), right.selected(~near)):
        assert statement(known).hints == ()


def test_lobes_in_the_plane_that_fade_may_be_of_elevations() -> None:
    """Heights of lobes in scans in the plane may be those of the surface: they are stated, and raise no doubt."""
    plane = {"lights": np.arange(10.0, 81.0, 10.0), "polar": np.arange(5.0, 86.0, 5.0), "turns": (0.0, 180.0)}
    right = sheet("glossy paint", **plane)
    wrong = replace(right, theta_i=0.5 * np.pi - right.theta_i, theta_r=0.5 * np.pi - right.theta_r)
    assert "elevation" not in " ".join(statement(right).untold)
    known = statement(wrong)
    assert known.hints == ()
    assert "--angles elevation reads the latter" in known.untold[0]


@pytest.mark.parametrize("surface", ["satin metal", "black coating"])
@pytest.mark.parametrize("side", ["elevation_i", "elevation_r"])
def test_one_elevation_alone_is_told_by_the_place_and_the_widths_of_lobes(side: str, surface: str) -> None:
    def read(at: Directions) -> Any:
        theta_i, theta_r = at.theta_i, at.theta_r
        flipped = (0.5 * np.pi - theta_i, theta_r) if side == "elevation_i" else (theta_i, 0.5 * np.pi - theta_r)
        return SURFACES[surface](Directions(*flipped, at.delta))

    assert statement(sheet(read, lights=np.arange(10.0, 81.0, 10.0))).hints[0].endswith(f"--angles {side}.")


def test_a_retro_reflective_surface_is_not_told_from_azimuths_and_not_doubted() -> None:
    known = statement(sheet("retro-reflective"))
    assert known.hints == ()
    assert "whether the surface is retro-reflective or azimuths count from the forward direction" in known.untold[0]
    assert "no lobe" in statement(sheet("Spectralon")).untold[0]


def test_wavelengths_that_are_no_light_may_have_another_unit() -> None:
    """10.6 um of a laser as nm, and 550 nm or 0.55 um as metres; 13.5 nm is measured."""
    flat = sheet("Spectralon")
    for nm, unit in ((10.6, "um"), (13.5, ""), (550.0, ""), (5.5e11, "nm"), (5.5e8, "um")):
        at = Samples(
            *("sheet", *(getattr(flat, name) for name in ("theta_i", "phi_i", "theta_r", "phi_r"))),
            ("nm",),
            np.array([nm]),
            flat.values,
        )
        assert statement(at).hints == () if not unit else statement(at).hints[0].endswith(f"--wavelength-unit {unit}.")


def test_uncertainties_may_be_expanded() -> None:
    """Values with 2 % of noise state 4 %, as k = 2 does; with 2 % there is nothing to say."""
    values = sheet("Spectralon")
    for share, said in ((0.04, True), (0.02, False)):
        known = statement(sheet("Spectralon", uncertainty=share * values.values))
        assert known.hints == ()
        assert ("--coverage-factor 2" in known.untold[0]) == said


def test_an_anisotropic_surface_is_judged_by_its_plane() -> None:
    def ward(at: Directions) -> Any:
        zero = np.zeros_like(at.theta_i)
        return models.ward(at.theta_i, zero, at.theta_r, at.delta, rho_d=0.05, rho_s=0.3, alpha_x=0.15, alpha_y=0.45)

    assert statement(sheet(ward)).hints == ()
    (hint,) = statement(sheet(lambda at: ward(at) * np.cos(at.theta_r))).hints
    assert "--quantity f_r_cos." in hint


def test_no_doubt_names_an_option_that_the_file_refuses() -> None:
    """The same samples, of a file that takes all options and of one that takes none of them."""
    paint = sheet("glossy paint", lights=(30.0, 60.0), phi_i=np.arange(0.0, 360.0, 60.0))
    small = sheet("Spectralon")
    small = replace(small, **{name: np.radians(getattr(small, name)) for name in ("theta_i", "theta_r", "phi_r")})
    floor = np.where(np.arange(len(small)) % 20 == 0, 1e-6, 0.1)[:, np.newaxis]
    wrong = {
        "--azimuth light": replace(paint, phi_r=paint.phi_r - paint.phi_i),
        "--azimuth forward reads": sheet("retro-reflective"),
        "--angles elevation": sheet(
            lambda at: SURFACES["satin metal"](
                Directions(0.5 * np.pi - at.theta_i, 0.5 * np.pi - at.theta_r, at.delta)
            ),
            lights=np.arange(10.0, 81.0, 10.0),
        ),
        "--angles rad": small,
        "--wavelength-unit um": replace(sheet("Spectralon"), channels=("nm",), wavelength_nm=np.array([10.6])),
        "--missing 1e-06": replace(sheet("Spectralon"), values=floor),
    }
    for option, samples in wrong.items():
        known = statement(samples)
        assert option in " ".join((*known.hints, *known.untold)), option
        record = {**samples.record, "refused": ["--angles", "--azimuth", "--wavelength-unit", "--missing"]}
        known = statement(replace(samples, record=record))
        text = " ".join((*known.hints, *known.untold))
        assert "correct the file" in text, option
        assert not any(word in text for word in record["refused"])


@pytest.mark.parametrize("read", ["elevation", "elevation_i", "elevation_r"])
@pytest.mark.parametrize("kind", ["scattered", "lights", "half ring", "plane", "sheet"])
def test_elevations_of_surfaces_that_fade_are_never_named_wrongly(read: str, kind: str) -> None:
    """Lobes of fading sheets grow as mirror lobes do, and powers of elevations come close to cosines."""
    rng = np.random.default_rng(5)
    if kind in ("scattered", "lights"):
        i = np.arccos(rng.uniform(0.15, 1.0, 3000 if kind == "scattered" else 12)).repeat(
            1 if kind == "scattered" else 250
        )
        r, d = np.arccos(rng.uniform(0.1, 1.0, i.size)), rng.uniform(0.0, 2.0 * np.pi, i.size)
    else:
        turns = (0.0, np.pi) if kind in ("plane", "sheet") else np.radians(np.arange(0.0, 181.0, 15.0))
        axes = (np.radians(np.arange(15.0, 76.0, 15.0)), np.radians(np.arange(5.0, 81.0, 5.0)), turns)
        i, r, d = (axis.reshape(-1) for axis in np.meshgrid(*axes, indexing="ij"))
    for f_r in (SURFACES["retro-reflective"], *(_minnaert(k) for k in (0.6, 1.3, 1.7, 2.5))):
        values = f_r(Directions(i, r, d)) * np.exp(rng.normal(0.0, 0.02, i.size))
        theta_i = i if read == "elevation_r" else 0.5 * np.pi - i
        theta_r = r if read == "elevation_i" else 0.5 * np.pi - r
        record = {"plane": "mirror side"} if kind == "sheet" else {"azimuths": RELATIVE}
        samples = Samples("sheet", theta_i, 0.0 * i, theta_r, d, ("grey",), None, values[:, np.newaxis], record=record)
        assert not [hint for hint in statement(samples).hints if f"--angles {read}" not in hint]


def _minnaert(k: float) -> Any:
    return lambda at: 0.1 * (np.cos(at.theta_i) * np.cos(at.theta_r)) ** (k - 1.0)


def test_a_lobe_without_a_diffuse_part_tells_forward_azimuths() -> None:
    """f_r of He and Torrance's roughened aluminium falls by orders of magnitude between the lobe and the normal."""
    metal = presets()["roughened-aluminum-500nm"]
    right = sheet(lambda at: metal.lookup(at.theta_i, 0.0 * at.theta_i, at.theta_r, at.delta).reshape(-1))
    assert statement(right).hints == ()
    wrong = replace(right, phi_r=(right.phi_r + np.pi) % (2.0 * np.pi))
    assert "--azimuth forward" in statement(wrong).hints[0]
