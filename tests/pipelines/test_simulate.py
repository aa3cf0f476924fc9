"""Simulated surfaces: the command, recipes, what is refused, resumed builds, and energy."""

from __future__ import annotations

import functools
import json
import pickle
import shutil
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.measurements.record import SimulationRecord
from brdfdb.microgeometry.simulation import Simulation
from brdfdb.microgeometry.surfaces import MadeSurface, gaussian_field
from brdfdb.store.estimates import begin_estimates, estimates_path
from brdfdb.store.reader import Store
from brdfdb.store.records import make_store
from brdfdb.store.summary_words import audited_materials
from brdfdb_pipelines import audit, recipe_file, simulated_job, workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_grids import RecipeError
from tests.pipelines.a_build import chunks, staged
from tests.pipelines.command import Captured, refused, run

LIGHTS = np.array([[0.0, 0.0, 1.0], [np.sin(0.7), 0.0, np.cos(0.7)], [0.0, np.sin(0.7), np.cos(0.7)]])
QUICK = {"nodes": 128, "rays": 256, "standard_error": 0.3}
ROUGH = {"surface": "gaussian", "slope_deg": 20, "rho": 1.0, **QUICK}


def options(keys: dict[str, Any]) -> list[object]:
    """Return keys of a recipe as options of the command."""
    return [text for key, value in keys.items() for text in (f"--{key.replace('_', '-')}", value)]


def recipe_of(folder: Path, *, tolerance: float = 0.1, **keys: Any) -> Path:
    """Write a recipe of one simulated material, "rough"."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in {**ROUGH, **keys}.items()]
    path = folder / "rough.toml"
    path.write_text(f'materials = ["rough"]\ntolerance = {tolerance}\n[define.rough]\n' + "\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a store that the command made, the recipe that it wrote, and its output as JSON."""
    folder = tmp_path_factory.mktemp("simulated")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        with (folder / "out.json").open("w") as out:
            patch.setattr("sys.stdout", out)
            command = ("simulate", *options(ROUGH), "--name", "rough", "--tolerance", 0.1, "--jobs", 1)
            assert run(*command, "--store", "store", "--recipe", "made.toml", "--json") == 0
    return folder


# What a simulation states


def test_a_white_surface_loses_no_light_and_is_audited_without_a_violation(simulated: Path) -> None:
    document = json.loads((simulated / "out.json").read_text())
    stated = document["simulation"]
    assert document["summary"]["violates"] == document["summary"]["above_1"] == []
    albedo = np.sum([stated[part] for part in ("one", "two", "further")], axis=0)
    at = np.array(stated["lights_deg"])
    # A white furnace. A light at theta meets tan(theta) times the slope more or less than its share at each of 16 x 256
    # points; interpolation adds 0.5 %
    noise = np.tan(np.radians(at)) * np.tan(np.radians(20.0)) / np.sqrt(16 * 256)
    assert np.all(np.abs(albedo - 1.0)[at < 80.0] <= (4.0 * noise + 0.005)[at < 80.0])
    assert stated["two"][0] > stated["further"][0] > 0.005
    assert stated["slopes"] == pytest.approx([np.tan(np.radians(20.0))] * 2, rel=0.1)
    assert stated["standard_error"] <= stated["target"] == 0.3
    assert stated["standard_error_of_map"] is None
    assert staged(simulated / "store") == []


def test_the_written_recipe_makes_the_same_table_and_computes_nothing(
    simulated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object) -> None:
        raise AssertionError

    recipe = recipe_file.load(simulated / "made.toml")
    monkeypatch.setattr(Simulation, "estimate", never)
    with workers.threads(1) as at:
        (built,) = build(recipe, simulated / "store", at)
    assert (built.state, built.job.name) == ("unchanged", "rough")
    keys = tomllib.loads((simulated / "made.toml").read_text())["define"]["rough"]
    assert keys == ROUGH
    with pytest.raises(AssertionError), workers.threads(1) as at:  # the planted function is the one that is called
        build(recipe, tmp_path / "other", at)


def test_show_and_list_say_what_was_simulated(simulated: Path, capsys: Captured) -> None:
    assert run("show", "rough", "--store", simulated / "store") == 0
    shown = capsys.readouterr().out
    assert "simulated by rays: Gaussian heights with Gaussian correlation, slopes of 20 degrees" in shown
    assert "was reached with 16 realisations of 256 rays for each light" in shown
    assert run("list", "--store", simulated / "store") == 0
    assert "rough " in capsys.readouterr().out
    for command in ("history", "verify"):
        assert run(command, "rough", "--store", simulated / "store") == 0


def test_an_audit_of_a_store_without_models_draws_no_figures_of_models(
    simulated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    def drawn() -> None:
        raise ParameterError("figures", "are drawn")

    monkeypatch.setattr(audit, "_figures", drawn)
    given = ("audit", "--store", simulated / "store", "--report", tmp_path / "audit.json", "--jobs", 1)
    assert run(*given) == 0
    capsys.readouterr()
    summary = Store.summary
    monkeypatch.setattr(Store, "summary", lambda store, name: {**summary(store, name), "model": "lambert"})
    assert refused(capsys, *given) == "figures: are drawn"  # a table of a model needs them


def test_a_fit_finds_a_sigma_near_the_slopes(tmp_path: Path, capsys: Captured) -> None:
    # Slope angles of small Gaussian slopes s along each axis have the density theta exp(-theta^2 / (2 s^2)), which is
    # that of eq. (26) of Oren and Nayar 1994: sigma is tan(13 degrees) rad, 13.2 degrees. Residuals that weight low
    # light, where the formula is worst, find more
    keys = {**ROUGH, "slope_deg": 13, "rho": 0.8, "standard_error": 0.2}
    assert run("simulate", *options(keys), "--out", tmp_path / "s.nc", "--jobs", 1) == 0
    capsys.readouterr()
    samples = formats.samples(tmp_path / "s.nc")
    assert samples.record["simulation"]["realisations"] == samples.record["realisations"]
    assert samples.uncertainty is not None
    assert np.all(samples.uncertainty > 0.0)
    weights = ("--residual", "uncertainty")
    assert run("fit", tmp_path / "s.nc", "--model", "oren_nayar", *weights, "--json", tmp_path / "fit.json") == 0
    (fitted,) = json.loads((tmp_path / "fit.json").read_text())["fits"]
    values = {estimate["name"]: estimate["value"] for estimate in fitted["estimates"]}
    assert values["sigma_deg"] == pytest.approx(13.2, abs=2.0)
    assert values["rho"] == pytest.approx(0.8, abs=0.05)
    capsys.readouterr()


def test_charts_and_samples_of_a_simulated_material_need_its_table(
    simulated: Path, tmp_path: Path, capsys: Captured
) -> None:
    recipe = simulated / "made.toml"
    for command in (("chart", "rough", "--out", tmp_path), ("photograph", "rough", "--out", tmp_path)):
        said = refused(capsys, *command, "--recipe", recipe, "--store", tmp_path / "none")
        assert said == "rough: is simulated; build the recipe first, and give the store"


def test_the_audit_of_a_simulated_table_speaks_of_rays_and_agrees_with_the_command(
    simulated: Path, capsys: Captured
) -> None:
    document = json.loads((simulated / "out.json").read_text())
    assert run("audit", "rough", "--store", simulated / "store", "--jobs", 1) == 0
    printed = capsys.readouterr().out
    assert "rough: standard error of the rays, where f_r exceeds a hundredth of its peak: at most " in printed
    assert "rough: it is simulated by rays, and the table does not contain them; not judged: nodes, table er" in printed
    (audited,) = audited_materials(simulated / "store")
    (table,) = document["tables"]
    assert (table["verdict"], table["energy"]) == (audited["verdict"], audited["conserves_energy"]["word"])
    assert table["energy"] == "not judged"  # an albedo of 1 is within the uncertainty
    assert audited["conserves_energy"]["text"].startswith("cannot be judged: albedo ")
    assert audited["as_published"]["text"] == audited["verdict_in_words"] == "passes where simulated, 90 %"
    assert audited["as_published"]["reason"].endswith("with 16 realisations of 256 rays for each light")
    assert "measured data" not in " ".join(sentence["text"] for sentence in audited["sentences"])


# Workers and interruptions


def build_until(recipe: Path, root: Path, killed: int) -> int:
    """Build with a task that fails like a killed process after some estimates; return how many are finished."""

    class Killed(BaseException):
        pass

    count = 0

    def report(event: dict[str, Any]) -> None:
        nonlocal count
        count += event["event"] == "estimate"
        if count == killed:
            raise Killed

    with pytest.raises(Killed), workers.threads(1) as at:
        build(recipe_file.load(recipe), root, at, report)
    return len(list(root.glob(".staging/rough/*/estimates/*.npz")))


def test_a_killed_build_resumes_and_makes_the_same_bytes(tmp_path: Path, simulated: Path) -> None:
    recipe = recipe_of(tmp_path)
    finished = build_until(recipe, tmp_path / "store", 5)
    assert 5 <= finished < 16
    torn = next((tmp_path / "store").glob(".staging/rough/*/estimates/000002.npz"))
    torn.write_bytes(torn.read_bytes()[:1000])  # a power cut
    events: list[dict[str, Any]] = []
    with workers.threads(2) as at:
        build(recipe_file.load(recipe), tmp_path / "store", at, events.append)
    kept = [event["kept"] for event in events if event["event"] == "estimate"]
    assert (len(kept), sum(kept)) == (16, finished - 1)
    assert chunks(tmp_path / "store", "rough") == chunks(simulated / "store", "rough")
    assert staged(tmp_path / "store") == []


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that gives the first result of another each time."""
    results: list[Any] = []

    def given(*arguments: Any, **keywords: Any) -> Any:
        results.extend([] if results else [function(*arguments, **keywords)])
        return results[0]

    return given


def test_two_builds_of_a_request_publish_one_revision(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = {"rho": 0.5, "conserving": False}
    job = recipe_file.load(recipe_of(tmp_path, tolerance=0.5, **keys)).simulated_jobs()[0]
    estimates = tmp_path / "estimates"
    estimates.mkdir()
    for number in range(16):
        simulated_job.estimate_simulated(str(estimates), job, number)
    for slow in ("simulated_source", "tabulated_lawfully"):
        monkeypatch.setattr(simulated_job, slow, once(getattr(simulated_job, slow)))
    for during in ("combined", "tabulated_lawfully"):  # another build ends before this one does that
        root = tmp_path / during
        make_store(root)
        folder = estimates_path(root, job.name, job.estimates_request)
        begin_estimates(folder, job.name, job.estimates_request)
        shutil.copytree(estimates, folder, dirs_exist_ok=True)
        task = functools.partial(simulated_job.build_simulated, str(root), str(folder), job, 16)
        others: list[str] = []
        original = getattr(simulated_job, during)

        def after_the_other(
            *arguments: Any, task: Any = task, others: list[str] = others, original: Any = original, **keywords: Any
        ) -> Any:
            if not others:
                others.append("begun")
                others.append(task().state)
            return original(*arguments, **keywords)

        with monkeypatch.context() as patch:
            patch.setattr(simulated_job, during, after_the_other)
            built = task()
        assert (others, built.state, built.revision) == (["begun", "published"], "unchanged", "r000001")
        assert [path.name for path in (root / "materials" / "rough").glob("r*[0-9]")] == ["r000001"]
        assert staged(root) == []


def test_estimates_that_another_build_removed_are_computed_again(tmp_path: Path) -> None:
    job = recipe_file.load(recipe_of(tmp_path)).simulated_jobs()[0]
    folder = estimates_path(tmp_path, job.name, job.estimates_request)
    simulated_job.estimate_simulated(str(folder), job, 1)  # its folder was removed, too
    built = simulated_job.combined(folder, job, 4)
    np.testing.assert_array_equal(
        built.total.mean, job.simulation.combined(map(job.simulation.estimate, range(4))).total.mean
    )


def test_gc_removes_what_an_abandoned_build_left(tmp_path: Path, capsys: Captured) -> None:
    assert build_until(recipe_of(tmp_path), tmp_path / "store", 1) >= 1
    assert run("gc", "--store", tmp_path / "store") == 0
    assert staged(tmp_path / "store") == []
    capsys.readouterr()


def test_the_number_of_estimates_follows_from_their_error(tmp_path: Path) -> None:
    job = recipe_file.load(recipe_of(tmp_path, standard_error=0.01, realisations=50)).simulated_jobs()[0]
    folder = tmp_path / "estimates"
    folder.mkdir()
    seen: list[range] = []
    events: list[dict[str, Any]] = []

    def compute(numbers: range) -> bool:
        seen.append(numbers)
        for number in numbers:
            simulated_job.estimate_simulated(str(folder), job, number)
        return True

    count = simulated_job.estimates_needed(job, folder, compute, events.append)
    assert [numbers.start for numbers in seen] == [0, *(numbers.stop for numbers in seen[:-1])]
    assert count == seen[-1].stop == 50  # 256 paths a map need more than is allowed
    assert all(event["standard_error"] > 0.01 for event in events)
    assert events[0]["realisations"] == 16
    assert events[0]["standard_error"] > 1.2 * events[-1]["standard_error"]
    assert simulated_job.estimates_needed(job, folder, lambda _: False, events.append) is None


def test_the_base_of_grooves_is_their_f_r(tmp_path: Path) -> None:
    keys = {"surface": "grooves", "slope_deg": 30, "rho": 0.9, "rays": 4096}
    job = recipe_file.load(recipe_of(tmp_path, **keys)).simulated_jobs()[0]
    viewers = unit_vector(np.radians([5.0, 40.0, 65.0, 70.0]), np.radians([10.0, 190.0, 100.0, 0.0]))
    few = replace(job.simulation, lights=LIGHTS, viewers=viewers)
    result = few.combined(few.estimate(number) for number in range(16))
    base = simulated_job._base(result)
    assert base is not None
    f_r = base(np.repeat(LIGHTS, 4, axis=0), np.tile(viewers, (3, 1))).reshape(result.total.mean.shape)
    # less than 1 % of the light leaves after more than two bounces; the base has its mean over directions
    np.testing.assert_allclose(f_r, result.total.mean, rtol=0.02, atol=4.0 * result.total.noise.max())
    turned = simulated_job._base(replace(result, simulation=replace(few, turned=True)))
    assert turned is None


# Height maps


@pytest.fixture(scope="module")
def height_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of heights whose slopes are 0.3 along each axis."""
    surface = gaussian_field(sigma_0_um=0.3 / np.sqrt(2.0), tau_x_um=1.0, step_um=0.2, nodes=128, seed=1)
    path = tmp_path_factory.mktemp("maps") / "rough.npy"
    np.save(path, surface.heights_um)
    return path


def test_a_height_map_states_its_own_error_beside_that_of_the_rays(height_map: Path, tmp_path: Path) -> None:
    keys = {"height_map": height_map, "pixel_um": 0.2, "height_um": 1, "rho": 1, "rays": 256, "standard_error": 0.3}
    assert run("simulate", *options(keys), "--out", tmp_path / "s.nc", "--jobs", 1) == 0
    stated = formats.samples(tmp_path / "s.nc").record["simulation"]
    assert stated["surface"].startswith(
        "height map rough.npy, less a plane, turned to all azimuths (the largest harmonic "
    )
    assert stated["slopes"] == pytest.approx([0.3, 0.3], rel=0.15)
    assert stated["standard_error_of_map"] > stated["standard_error"]
    assert stated["realisations"] == 32
    assert stated["noise"].endswith("negligible")
    assert stated["shadows"] == ""


def test_shadows_longer_than_a_height_map_are_stated(height_map: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "narrow.npy", np.load(height_map)[:32])
    keys = {"height_map": tmp_path / "narrow.npy", "pixel_um": 0.2, "height_um": 1, "rho": 1, "rays": 256}
    assert run("simulate", *options(keys | {"standard_error": 0.5}), "--out", tmp_path / "s.nc", "--jobs", 1) == 0
    stated = formats.samples(tmp_path / "s.nc").record["simulation"]
    # 31 steps of 0.2 um are as long as the shadow of four standard deviations of the heights
    levelled = np.load(tmp_path / "narrow.npy")
    x, y = np.indices(levelled.shape).reshape(2, -1)
    plane = np.column_stack([x, y, np.ones(x.size)])
    levelled = levelled.reshape(-1) - plane @ np.linalg.lstsq(plane, levelled.reshape(-1))[0]
    limit = np.degrees(np.arctan(31 * 0.2 / (4.0 * levelled.std())))
    assert stated["shadows"].startswith(f"beyond {limit:.0f} degrees shadows may be longer than the map")
    assert stated["shadows"] in SimulationRecord(**stated).in_words()[-1]


def test_another_file_of_the_same_name_is_another_request(height_map: Path, tmp_path: Path) -> None:
    keys = {"surface": None, "slope_deg": None, "nodes": None, "pixel_um": 0.2, "height_um": 1.0}
    given = {key: value for key, value in {**ROUGH, **keys, "height_map": "map.npy"}.items() if value is not None}
    heights = np.load(height_map)

    def request(scale: float = 1.0, **changes: Any) -> dict[str, Any]:
        np.save(tmp_path / "map.npy", scale * heights)
        return simulated_job.simulated_job("rough", {**given, **changes}, tmp_path, 0.1, None).estimates_request

    usual = request()
    assert request(standard_error=0.01, title="another", realisations=999) == usual  # they resume its estimates
    others = [request(2.0), request(isotropic=False), request(hole=0.0), request(seed=1), request(rho=0.5)]
    assert all(other != usual for other in others)


def map_job(folder: Path, **changes: Any) -> simulated_job.SimulatedJob:
    keys = {"height_map": "map.npy", "pixel_um": 0.1, "height_um": 1.0, "rho": 0.9, "rays": 256, **changes}
    return simulated_job.simulated_job("m", keys, folder, 0.1, None)


def test_a_file_that_was_replaced_makes_no_estimate(tmp_path: Path) -> None:
    path = tmp_path / "map.npy"
    np.save(path, MadeSurface("gaussian", 0.1, nodes=128).draw(1).heights_um)
    job = pickle.loads(pickle.dumps(map_job(tmp_path)))  # as a worker gets it
    simulated_job.estimate_simulated(str(tmp_path), job, 0)
    written = (tmp_path / "000000.npz").read_bytes()
    np.save(path, MadeSurface("gaussian", 0.8, nodes=128).draw(1).heights_um)
    simulated_job._levelled.cache_clear()
    job = pickle.loads(pickle.dumps(job))
    with pytest.raises(FileFormatError, match=r"map.npy: the file changed since the recipe was read; build again"):
        simulated_job.estimate_simulated(str(tmp_path), job, 1)
    assert [file.name for file in tmp_path.glob("*.npz")] == ["000000.npz"]
    assert (tmp_path / "000000.npz").read_bytes() == written


def test_a_map_with_a_direction_is_not_turned_unless_it_is_asked_for(tmp_path: Path) -> None:
    saw = 0.2 * (np.arange(128) % 16)
    np.save(tmp_path / "map.npy", saw[:, np.newaxis] + saw)
    keep = {"steps": "keep", "outliers": "keep"}
    job = map_job(tmp_path, **keep)
    assert not job.simulation.turned
    words = simulated_job._azimuth_words(job)
    assert words.startswith(" (harmonic ")
    assert words.endswith(" %, more than 10 %)")
    asked = map_job(tmp_path, **keep, isotropic=True)
    assert asked.simulation.turned
    assert simulated_job._azimuth_words(asked).startswith(" (as was asked for; harmonic ")


def test_a_map_and_its_transpose_give_f_r_with_x_and_y_exchanged(tmp_path: Path) -> None:
    steep_x = MadeSurface("gaussian", 0.3, 0.1, nodes=128, steps=4).draw(3)
    keys = {"pixel_um": steep_x.step_x_um, "height_um": 1.0, "facets": "mirror", "isotropic": False, "rays": 512}
    found = []
    for name, heights in (("along_x", steep_x.heights_um), ("along_y", steep_x.heights_um.T)):
        np.save(tmp_path / f"{name}.npy", heights.T[::-1])  # rows run along x, the first at the largest y
        job = simulated_job.simulated_job(name, {**keys, "height_map": f"{name}.npy"}, tmp_path, 0.1, None)
        simulation = job.simulation
        exchange = [0, 1, 2] if name == "along_x" else [1, 0, 2]
        # viewers of a light stand in the order of the patches, or around its lobe: those that agree are compared
        lights, viewers = simulation.lights[:, exchange], np.asarray(simulation.viewers)[..., exchange]
        chosen = [int(np.argmin(np.linalg.norm(lights - light, axis=1))) for light in LIGHTS]
        viewers_of_few = np.asarray(simulation.viewers)[chosen]
        few = replace(simulation, lights=simulation.lights[chosen], viewers=viewers_of_few, blocks=2)
        one = few.combined(few.estimate(number) for number in range(8)).one.mean[..., 0]
        orders = [np.lexsort(np.round(viewers[light], 6).T + 0.0) for light in chosen]
        found.append(
            (
                np.stack([viewers[light][order] for light, order in zip(chosen, orders, strict=True)]),
                np.stack([values[order] for values, order in zip(one, orders, strict=True)]),
                simulated_job._lobe_base(simulation)(lights[chosen][:, exchange], viewers[chosen, 0][:, exchange]),
            )
        )
    (there, f_r, base), (exchanged, of_transpose, other) = found
    np.testing.assert_allclose(exchanged, there, atol=1e-6)
    np.testing.assert_allclose(other, base, rtol=1e-6)
    # facets are halves of squares, cut along the same diagonal: other points of the same surface, and other rays
    bright = f_r > 0.05 * f_r.max()
    assert bright.sum() > 50
    assert np.median(np.abs(of_transpose[bright] / f_r[bright] - 1.0)) < 0.05
    assert np.abs(of_transpose - f_r)[bright].max() < 0.2 * f_r.max()


# What is refused

WRONG: list[tuple[dict[str, Any], str, str]] = [
    ({"slope_deg": None}, "slope_deg", "is missing; a gaussian surface needs it"),
    ({"slope_deg": 90.0}, "slope_deg", "90.0 must be at most 84"),
    ({"surface": "waves"}, "surface", "'waves' is not one of"),
    ({"height_map": "a.npy"}, "surface, height_map", "both are given; give one of them"),
    ({"isotropic": True}, "isotropic", "is allowed only for a height map"),
    ({"rho": None}, "rho", "is missing; facets of the kind lambert need it"),
    ({"rho": 1.5}, "rho", "1.5 is not in [0, 1]"),
    ({"facets": "mirror"}, "rho", "is not allowed for facets of the kind mirror, only for lambert and mixture"),
    ({"facets": "mixture"}, "mirror", "is missing"),
    ({"facets": "mixture", "mirror": 0.5}, "rho", "rho and mirror together are 1.5"),
    ({"facets": "mixture", "rho": 0.5, "mirror": 0.5, "k": 1.0}, "n", "is missing; k alone"),
    ({"facets": "mixture", "rho": 0.5, "mirror": 0.5, "n": [1.5, 1.6]}, "wavelengths_nm", "is missing; n needs"),
    (
        {"facets": "mixture", "rho": 0.5, "mirror": 0.5, "k": 1.0, "n": 1.0, "refractive_index": "Cu"},
        "refractive_index, n, k",
        "give a substance or numbers, not both",
    ),
    ({"facets": "glass"}, "facets", "'glass' is not one of"),
    ({"rho": [0.2, 0.3], "wavelengths_nm": [500.0]}, "rho", "a list of 2 values needs as many wavelengths_nm"),
    ({"wavelengths_nm": [500.0]}, "wavelengths_nm", "is not allowed without a spectrum"),
    ({"slope_y_deg": 1.0}, "slope_y_deg", "ten lengths of correlation need more than 128 nodes"),
    ({"surface": "grooves", "slope_y_deg": 5.0}, "slope_y_deg", "grooves have no slope along y"),
    ({"standard_error": 0.0}, "standard_error", "must be at least 0.001"),
    ({"realisations": 4}, "realisations", "must be at least 16"),
    ({"seed": -1}, "seed", "-1 must be at least 0"),
    ({"colour": "red"}, "colour", "unknown key"),
]


@pytest.mark.parametrize(("changes", "parameter", "sentence"), WRONG)
def test_a_wrong_key_is_one_sentence(changes: dict[str, Any], parameter: str, sentence: str, tmp_path: Path) -> None:
    given = {key: value for key, value in {**ROUGH, **changes}.items() if value is not None}
    with pytest.raises(RecipeError) as raised:
        simulated_job.simulated_job("rough", given, tmp_path, 0.1, None)
    assert raised.value.parameter == f"define.rough.{parameter}"
    assert sentence in raised.value.sentence


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "--surface, --height-map: neither is given; give one of them"),
        (("--surface", "gaussian", "--rho", "1"), "--slope-deg: is missing"),
        (("--surface", "gaussian", "--rho", "1", "--slope-deg", "95"), "--slope-deg: 95.0 must be at most 84"),
        (("--surface", "gaussian", "--slope-deg", "9", "--name", "foam", "--rho", "1"), "--name: 'foam' is the name"),
        (("--height-map", "missing.npy", "--rho", "1"), "--height-map: missing.npy: No such file"),
        (("--surface", "gaussian", "--slope-deg", "9", "--rho", "1", "--recipe", "no/x.toml"), "no/x.toml: No such"),
        (("--surface", "grooves", "--slope-deg", "9", "--facets", "mirror"), "--facets: mirrors of grooves"),
        (("--surface", "gaussian", "--slope-deg", "0.01", "--rho", "1"), "--slope-deg: "),
        (("--surface", "gaussian", "--slope-deg", "9", "--rho", "1", "--tolerance", "2"), "--tolerance: 2 is outside"),
        (("--surface", "gaussian", "--slope-deg", "9", "--rho", "0.1,0.2"), "needs as many --wavelengths-nm, none"),
    ],
)
def test_a_wrong_option_is_one_sentence(
    arguments: tuple[str, ...], sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    assert sentence in refused(capsys, "simulate", *arguments, "--store", tmp_path / "store")
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize(
    ("outputs", "option"),
    [
        ({}, "--store, --out, --recipe"),
        ({"out": "a.csv"}, "--out"),
        ({"recipe": "a.txt"}, "--recipe"),
        ({"out": "a.nc", "store": "store"}, "--out"),
        ({"out": "a.nc", "scheduler": "tcp://127.0.0.1:9"}, "--scheduler"),
    ],
)
def test_outputs_that_do_not_go_together_are_refused(outputs: dict[str, str], option: str) -> None:
    from brdfdb_pipelines.simulate import SimulationOutputs

    paths: dict[str, Any] = {key: value if key == "scheduler" else Path(value) for key, value in outputs.items()}
    with pytest.raises(ParameterError) as raised:
        SimulationOutputs("rough", **paths)
    assert raised.value.parameter == option


def test_holes_are_refused_and_filled_on_request(height_map: Path, tmp_path: Path, capsys: Captured) -> None:
    heights = np.load(height_map)
    heights[5:7, 8:10] = np.nan
    np.save(tmp_path / "holes.npy", heights)
    given = ("--height-map", tmp_path / "holes.npy", "--pixel-um", 0.2, "--height-um", 1, "--rho", 1, "--out", "s.nc")
    assert refused(capsys, "simulate", *given) == (
        "--holes: 4 heights of 16384 are missing; rays need all of them; allowed is fill, which interpolates between "
        "neighbours"
    )
    keys = {"height_map": "holes.npy", "pixel_um": 0.2, "height_um": 1.0, "rho": 1.0, "holes": "fill"}
    job = simulated_job.simulated_job("rough", keys, tmp_path, 0.1, None)
    assert "4 holes filled" in simulated_job.surface_words(job)


def test_heights_in_a_wrong_unit_are_refused(height_map: Path, tmp_path: Path, capsys: Captured) -> None:
    # nanometres read as micrometres: slopes are a thousand times too large
    options = ("--pixel-um", 0.5, "--height-um", 1000, "--s-filter-um", 0, "--rho", 0.5, "--store", tmp_path / "store")
    assert run("simulate", "--height-map", height_map, *options) == 2
    assert "allowed are up to 84 degrees: are the units of heights and pixels right?" in capsys.readouterr().err
    assert not (tmp_path / "store").exists()


def test_a_noisy_map_is_refused_until_the_user_decides(height_map: Path, tmp_path: Path, capsys: Captured) -> None:
    noise = 0.02 * np.random.default_rng(3).standard_normal((128, 128))  # slopes of sqrt(2) * 0.02 / 0.2 = 0.14
    np.save(tmp_path / "noisy.npy", np.load(height_map) + noise)
    given = ("--height-map", tmp_path / "noisy.npy", "--pixel-um", 0.2, "--height-um", 1, "--rho", 1, "--out", "s.nc")
    said = refused(capsys, "simulate", *given)
    assert said.startswith("--s-filter-um: is missing for a map with noise of the instrument: 0.0")
    assert said.endswith("or 0 to leave the noise in, which is right if sharp edges of the surface look like noise")
    keys = {"height_map": "noisy.npy", "pixel_um": 0.2, "height_um": 1.0, "rho": 1.0}

    def map_of(**more: float) -> simulated_job.LevelledMap:
        ready = simulated_job.simulated_job("rough", keys | more, tmp_path, 0.1, None).levelled
        assert ready is not None
        return ready

    left, filtered = map_of(s_filter_um=0.0), map_of(s_filter_um=0.8)
    assert "it is left in; slopes along x and y: 0.3" in left.noise
    assert (
        "after an S-filter of 0.8 um (Gaussian, ISO 16610-61); slopes of the noise alone after the filter: "
        in filtered.noise
    )
    assert filtered.surface.heights_um.shape == (124, 124)
    assert map_of(noise_um=0.001).noise.startswith("noise of the instrument: 0.001 um, as given; it is left in")


@pytest.mark.parametrize("text", ["Au", "main/Au/Johnson", "constant/0.43/2.455"])
def test_a_refractive_index_is_named_as_in_topography(text: str, tmp_path: Path) -> None:
    keys = {**ROUGH, "rho": None, "facets": "mirror", "refractive_index": text, "wavelengths_nm": [548.6]}
    job = simulated_job.simulated_job("gold", {k: v for k, v in keys.items() if v is not None}, tmp_path, 0.1, None)
    facets = job.reflecting.facets
    # Johnson and Christy 1972, table I, at 2.26 eV: n = 0.43, k = 2.455. Authors differ, but for all of them green
    # light is the end of the reflectance of gold: n is well below 1, and k between 2 and 3
    assert facets.n is not None
    assert 0.2 < np.ravel(facets.n)[0] < 0.5
    assert 2.2 < np.ravel(facets.k)[0] < 2.8
    with pytest.raises(
        RecipeError, match=r"refractive_index: 'Xx' is no refractive index; allowed are shelf/book/page"
    ):
        simulated_job.simulated_job("gold", {**ROUGH, "refractive_index": "Xx"}, tmp_path, 0.1, None)


def test_a_file_that_is_named_as_a_key_keeps_its_name(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "height_map.npy"
    np.save(path, np.zeros((64, 64)))
    given = ("--height-map", path, "--rho", 1, "--out", tmp_path / "s.nc")
    said = refused(capsys, "simulate", *given, "--unit", "mm")
    assert said == f"--unit: {path} states no lengths; give --pixel-um and --height-um instead"


@pytest.mark.parametrize("module", ["jinja2", "matplotlib"])
def test_what_the_audit_needs_is_missed_before_the_rays(
    module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    given = ("simulate", *options(ROUGH), "--store", tmp_path / "store", "--recipe", tmp_path / "rough.toml")
    assert refused(capsys, *given).startswith(f"{module} is not installed; it comes with pip install ")
    assert list(tmp_path.iterdir()) == []
