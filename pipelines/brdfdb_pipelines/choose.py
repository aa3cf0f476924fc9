"""The choose job: times the forms of the materials of a scene, and writes choice.json, pictures and tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.forms import timing
from brdfdb.scenes import image, sample_positions
from brdfdb.scenes.choice import (
    CONFIDENCE,
    GRAZING_DEG,
    Decision,
    Look,
    Price,
    SceneChoice,
    Seen,
    Weigh,
    check_feasible,
    choose,
    describe,
    statement,
    within,
)
from brdfdb.scenes.gbuffer import CameraView, gather, gather_at
from brdfdb.scenes.offered_forms import OfferedForm, offered_forms
from brdfdb.scenes.renderer import Reflector, reflectors
from brdfdb.scenes.scene import Scene
from brdfdb.scenes.shapes import Array, Recorded
from brdfdb.store.marker import make_store
from brdfdb.store.staging import remove_begun
from brdfdb_pipelines import terminal
from brdfdb_pipelines.choice_publication import Built, build, with_reason
from brdfdb_pipelines.scene_file import SceneError, load

TIMED = 20_000  # pairs of directions of a material for timing, drawn from those of the scene
SEED = 1992
ROUNDS = 7  # rounds of timing
FINER = 2  # width, relative to the picture, of the finer picture with one checked place per pixel
EDGES = 4000  # places beside edges where forms are compared, and as many others where choices are checked


def run(
    name: str,
    out: Path,
    *,
    width: int,
    weigh: Weigh = "time",
    store: Path | None = None,
    tolerances: Sequence[float] | None = None,
) -> SceneChoice:
    """Choose for a scene; write ``choice.json``, ``NAME.png``, ``NAME-truth.exr`` and ``NAME-choice.exr``.

    Parameters
    ----------
    name : str
        A scene by its file or name.
    out : Path
        Directory to write to; made if it is not there.
    width : int
        Pixels across the picture where forms are compared. The choice as a whole is checked at fresh places: `FINER`
        squared times as many, and `EDGES` beside edges. A recorded scene has the size of its file, and no other places.
    weigh : str
        Cost to minimise: "time", "bytes", or "both", which is their product.
    store : Path, optional
        Store where chosen tables are published, under the names of their materials, each with its error; made if it
        does not exist.
    tolerances : sequence of float, optional
        Tolerances of planned tables: see `brdfdb.scenes.offered_forms`.

    Returns
    -------
    SceneChoice
        The document that was written.

    Raises
    ------
    SceneError
        If there is no such scene, it cannot be rendered, or its tolerance is infeasible.
    StoreError
        If the store cannot be written or is no store: before any work.
    """
    scene, made = load(name), False
    try:
        check_feasible(scene.tolerance)  # before minutes of work, like the store
        made = store is not None and make_store(store)
        return _run(scene, name, out, width, weigh, store, tolerances)
    except ParameterError as error:
        if made and store is not None:
            remove_begun(store)
        raise SceneError(name, error.parameter, error.sentence) from None


def _run(
    scene: Scene,
    name: str,
    out: Path,
    width: int,
    weigh: Weigh,
    store: Path | None,
    tolerances: Sequence[float] | None,
) -> SceneChoice:
    with terminal.progress(counted=False, transient=True) as bar:
        bar.add_task("tracing rays", total=None)
        view = gather(scene, width)
    materials = reflectors(scene)
    with terminal.progress(counted=False) as bar:
        task = bar.add_task("tabulating, timing", total=2 * len(materials))
        offered, prices = {}, {}
        for key, reflector in materials.items():
            offered[key] = offered_forms(reflector.source, reflector.wavelength_nm, tolerances)
            bar.advance(task)
            prices[key] = _prices(offered[key], *_pairs(view, key), weigh)
            bar.advance(task)
        task = bar.add_task("choosing", total=len(materials) + 1)
        planned, check = _looks(scene, view, offered, materials)

        def checked(number: int) -> Look | None:
            bar.update(task, total=len(materials) + number)
            return check(number)

        costs = {key: np.stack([one.costs for one in of_forms], axis=1) for key, of_forms in prices.items()}
        chosen = choose(planned, checked, offered, costs, tick=lambda: bar.advance(task))
    forms = {key: offered[key][decision.pick.chosen].form for key, decision in chosen.items()}
    wanted = f"{Path(name).stem}, {within(scene.tolerance)}"
    layouts = {
        key: with_reason(form.layout, form.title, wanted)
        for key, form in forms.items()
        if form.layout is not None and key not in scene.stored
    }
    values = {key: forms[key].values for key in layouts}
    built = build(store, layouts, values) if store is not None and layouts else {}
    described = describe(
        scene,
        chosen,
        offered,
        prices,
        {key: planned.even.pixels(key).size for key in offered},
        {key: one.revision for key, one in built.items()},
    )
    choice = SceneChoice(
        brdfdb=version("brdfdb"),
        when=datetime.now(UTC),
        machine=terminal.machine(),
        scene=Path(name).stem,
        tolerance=scene.tolerance,
        weigh=weigh,
        picture=(view.width, view.height),
        confidence=CONFIDENCE,
        grazing_deg=GRAZING_DEG,
        statement=statement(scene.tolerance, (view.width, view.height), described),
        materials=described,
    )
    out.mkdir(parents=True, exist_ok=True)
    (out / "choice.json").write_text(choice.model_dump_json(indent=1) + "\n", encoding="utf-8")
    left_out = [f"{one.material}: {out.title}" for one in described for out in one.left_out]
    _draw(out / Path(name).stem, planned.even, offered, chosen, left_out)
    _print(choice, built)
    if store is not None and not built:
        print("nothing to build: no table was chosen")
    print(f"{out}: choice.json, {choice.scene}.png, {choice.scene}-truth.exr and {choice.scene}-choice.exr")
    return choice


def _looks(
    scene: Scene, view: CameraView, offered: Mapping[str, Sequence[OfferedForm]], materials: Mapping[str, Reflector]
) -> tuple[Look, Callable[[int], Look | None]]:
    """Return the scene where forms are compared, and a function from the number of a check to fresh places."""
    truths = {key: forms[0] for key, forms in offered.items()}
    picture = Seen(scene, view, truths, materials)
    if isinstance(scene.objects[0].shape, Recorded):
        return Look(picture, None), lambda _: None

    def at(places: Array) -> Seen:
        return Seen(scene, gather_at(scene, places), truths, materials)

    def beside_edges(number: int) -> Seen:
        rng = np.random.default_rng([SEED, number, 0])
        return at(sample_positions.at_edges(scene, view.width, view.height, EDGES, rng))

    def check(number: int) -> Look:
        rng = np.random.default_rng([SEED, number, 1])
        return Look(at(sample_positions.even(FINER * view.width, FINER * view.height, rng)), beside_edges(number))

    return Look(picture, beside_edges(0)), check


def _pairs(view: CameraView, material: str) -> tuple[Array, Array]:
    """Return pairs of directions (n, 3) at which the scene evaluates a material, shuffled; at least one."""
    pairs = [
        (points.wi[light, point], points.wr[point])
        for points in view.points
        if points.material == material
        for light, point in [np.nonzero(points.irradiance * (points.wr[:, 2] > 0.0))]
    ]
    wi, wr = (np.concatenate(directions) for directions in zip(*pairs, strict=True))
    if not len(wi):  # the material is in shadow
        wi = wr = np.array([[0.0, 0.0, 1.0]])
    mixed = np.random.default_rng(SEED).permutation(len(wi))[:TIMED]
    return wi[mixed], wr[mixed]


def _prices(forms: Sequence[OfferedForm], wi: Array, wr: Array, weigh: Weigh) -> list[Price]:
    """Return the costs of forms at the wavelengths of the scene."""
    times = timing.times([offered.form for offered in forms], wi, wr, most=TIMED, rounds=ROUNDS)
    prices = []
    for offered, time in zip(forms, times, strict=True):
        form = offered.form
        ns = time.quartiles_ns[1] * form.evaluate(wi[:1].astype(form.dtype), wr[:1].astype(form.dtype)).size
        # relative to the exact form in the same round: a busy machine slows both down
        shares = time.seconds / times[0].seconds
        costs = {"time": shares, "bytes": np.full(ROUNDS, float(form.bytes)), "both": shares * form.bytes}
        prices.append(Price(ns, costs[weigh]))
    return prices


def _draw(
    stem: Path,
    seen: Seen,
    offered: Mapping[str, Sequence[OfferedForm]],
    chosen: Mapping[str, Decision],
    left_out: Sequence[str],
) -> None:
    """Write the comparison as a picture, and the exact and the chosen one as spectral EXR."""
    from brdfdb_pipelines import choice_picture

    picks = {key: decision.pick for key, decision in chosen.items()}
    choice = seen.picture({key: offered[key][one.chosen] for key, one in picks.items()})
    lesser = {key: offered[key][one.cheaper] for key, one in picks.items() if one.cheaper is not None}
    best = {key: offered[key][one.chosen] for key, one in picks.items() if one.cheaper is None}
    for picture, suffix in ((seen.truth, "truth"), (choice, "choice")):
        image.write_exr(stem.with_name(f"{stem.name}-{suffix}.exr"), seen.scene, picture)
    cheaper = seen.picture({**best, **lesser}) if lesser else None
    stem.with_name(f"{stem.name}.png").write_bytes(choice_picture.png(seen, choice, cheaper, left_out))


def _print(choice: SceneChoice, built: Mapping[str, Built]) -> None:
    """Print the choices as a table, their reasons, and the tables that were published."""
    numbers = ("alone", "whole", "largest", "ns", "bytes", "share of the truth")
    rows = [
        (
            one.material,
            one.choice.title,
            f"{one.choice.error.counted:.2g}",
            f"{one.whole.counted:.2g}",
            f"{one.whole.most:.2g}",
            terminal.count(one.choice.ns),
            terminal.size(one.choice.bytes),
            f"{one.choice.share:.2g}",
        )
        for one in choice.materials
    ]
    title = f"{choice.scene}: {within(choice.tolerance)}"
    terminal.print_table(title, ("material", "choice", *numbers), rows, numbers=numbers)
    for one in choice.materials:
        print(f"  {one.material}: {one.choice.title} {one.reason}")
        for out in one.left_out:
            print(f"    left out: {out.title}: {out.reason}")
        if one.material in built:
            print(f"    {built[one.material].sentence}")
    print(choice.statement)
