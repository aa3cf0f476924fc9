"""The choose job: times the forms of the materials of a scene, and writes choice.json, pictures and tables."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, StoreError
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
from brdfdb.store.publication import publish_layout
from brdfdb.store.reader import Store
from brdfdb.store.records import make_store
from brdfdb.store.staging import remove_begun
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import frame
from brdfdb_pipelines import terminal
from brdfdb_pipelines.scene_file import SceneError, load

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIMED = 20_000  # pairs of directions of a material for timing, drawn from those of the scene
SEED = 1992
ROUNDS = 7  # rounds of timing
FINER = 2  # width, relative to the picture, of the finer picture with one checked place per pixel
EDGES = 4000  # places near edges at which forms are compared; choices are checked at as many other places

TIMES = 2.0  # end of the colour bar, relative to the tolerance
BEYOND = "#e5341a"  # colour of larger differences
BAR = 16  # height of the colour bar [pixel]
_PANEL = 420  # nearest width of a panel [pixel]; each pixel of the scene is a square of whole pixels
_GAP = 14  # around panels [pixel]
_TITLE = 30  # above panels [pixel]
_MORE = 60  # right of the colour bar [pixel]
_DPI = 128  # a power of two, so that sizes in inches are whole pixels
_TEXT: dict[str, Any] = {"fontsize": 7}


class PublishedChoice(NamedTuple):
    """The revision that holds the table of a choice, and a sentence on the revision before it."""

    revision: str
    sentence: str


class _Checks(NamedTuple):
    """The places of a scene where forms are compared, and a function from the number of a check to fresh places."""

    planned: Look
    fresh: Callable[[int], Look | None]


class _Pairs(NamedTuple):
    """Pairs of directions (n, 3)."""

    wi: Array
    wr: Array


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

    Forms are compared in a picture of `width` pixels. The choice is checked at other places: `FINER` squared times as
    many, and `EDGES` near edges. A recorded scene has the size of its file, and no other places. Chosen tables are
    published in the store, each with its error, under the names of their materials.

    Raises
    ------
    SceneError
        If there is no such scene, it cannot be rendered, or its tolerance is infeasible.
    StoreError
        If the store cannot be written or is no store: before any work.
    """
    scene = load(name)
    made = False
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
    terminal.say_without_glints("the picture", *scene.materials.values())
    with terminal.progress(counted=False) as bar:
        task = bar.add_task("tabulating, timing", total=2 * len(materials))
        offered, prices = {}, {}
        for key, reflector in materials.items():
            offered[key] = offered_forms(reflector.source, reflector.wavelength_nm, tolerances)
            bar.advance(task)
            prices[key] = _prices(offered[key], _pairs(view, key), weigh)
            bar.advance(task)
        task = bar.add_task("choosing", total=len(materials) + 1)
        checks = _checks(scene, view, offered, materials)

        def checked(number: int) -> Look | None:
            bar.update(task, total=len(materials) + number)
            return checks.fresh(number)

        costs = {key: np.stack([one.costs for one in of_forms], axis=1) for key, of_forms in prices.items()}
        chosen = choose(checks.planned, checked, offered, costs, tick=lambda: bar.advance(task))
    forms = {key: offered[key][decision.pick.chosen].form for key, decision in chosen.items()}
    wanted = f"{Path(name).stem}, {within(scene.tolerance)}"
    layouts = {
        key: with_reason(form.layout, form.title, wanted)
        for key, form in forms.items()
        if form.layout is not None and key not in scene.stored
    }
    values = {key: forms[key].values for key in layouts}
    built = publish_choices(store, layouts, values) if store is not None and layouts else {}
    described = describe(
        scene,
        chosen,
        offered,
        prices,
        {key: checks.planned.even.pixels(key).size for key in offered},
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
    _draw(out / Path(name).stem, checks.planned.even, offered, chosen, left_out)
    _print(choice, built)
    if store is not None and not built:
        print("nothing to build: no table was chosen")
    print(f"{out}: choice.json, {choice.scene}.png, {choice.scene}-truth.exr and {choice.scene}-choice.exr")
    return choice


def _checks(
    scene: Scene, view: CameraView, offered: Mapping[str, Sequence[OfferedForm]], materials: Mapping[str, Reflector]
) -> _Checks:
    """Return the places of the picture, and a function of new places for each check; a recorded scene has none."""
    truths = {key: forms[0] for key, forms in offered.items()}
    picture = Seen(scene, view, truths, materials)
    if isinstance(scene.objects[0].shape, Recorded):
        return _Checks(Look(picture, None), lambda _: None)

    def at(places: Array) -> Seen:
        return Seen(scene, gather_at(scene, places), truths, materials)

    def near_edges(number: int) -> Seen:
        rng = np.random.default_rng([SEED, number, 0])
        return at(sample_positions.at_edges(scene, view.width, view.height, EDGES, rng))

    def check(number: int) -> Look:
        rng = np.random.default_rng([SEED, number, 1])
        return Look(at(sample_positions.even(FINER * view.width, FINER * view.height, rng)), near_edges(number))

    return _Checks(Look(picture, near_edges(0)), check)


def _pairs(view: CameraView, material: str) -> _Pairs:
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
    return _Pairs(wi[mixed], wr[mixed])


def _prices(forms: Sequence[OfferedForm], pairs: _Pairs, weigh: Weigh) -> list[Price]:
    """Return the costs of forms at the wavelengths of the scene."""
    times = timing.times([offered.form for offered in forms], pairs.wi, pairs.wr, most=TIMED, rounds=ROUNDS)
    prices = []
    for offered, time in zip(forms, times, strict=True):
        form = offered.form
        wavelengths = form.evaluate(pairs.wi[:1].astype(form.dtype), pairs.wr[:1].astype(form.dtype)).size
        ns = time.quartiles_ns[1] * wavelengths
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
    picks = {key: decision.pick for key, decision in chosen.items()}
    choice = seen.picture({key: offered[key][one.chosen] for key, one in picks.items()})
    lesser = {key: offered[key][one.cheaper] for key, one in picks.items() if one.cheaper is not None}
    best = {key: offered[key][one.chosen] for key, one in picks.items() if one.cheaper is None}
    for picture, suffix in ((seen.truth, "truth"), (choice, "choice")):
        image.write_exr(stem.with_name(f"{stem.name}-{suffix}.exr"), seen.scene, picture)
    cheaper = seen.picture({**best, **lesser}) if lesser else None
    stem.with_name(f"{stem.name}.png").write_bytes(png(seen, choice, cheaper, left_out))


def _print(choice: SceneChoice, built: Mapping[str, PublishedChoice]) -> None:
    """Print the choices as a table, their reasons, and the tables that were published."""
    numbers = ("error alone", "error together", "largest error", "ns", "bytes", "share of the truth")
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


def publish_choices(
    root: Path, layouts: Mapping[str, Layout], values: Mapping[str, NDArray[np.float32] | None] | None = None
) -> dict[str, PublishedChoice]:
    """Publish tables under names of materials, each with its error against the model that it stands for.

    A table that is current already stays. Tables without values are tabulated. StoreError if the store cannot be
    written.
    """
    built = {}
    with terminal.progress() as bar:
        task = bar.add_task("building tables", total=len(layouts))
        for name, layout in layouts.items():
            built[name] = _published(root, name, layout, (values or {}).get(name))
            bar.advance(task)
    return built


def _published(root: Path, name: str, layout: Layout, values: NDArray[np.float32] | None) -> PublishedChoice:
    store = Store(root)
    if _is_there(store, name, layout):
        return PublishedChoice(store.head(name), f"{store.head(name)} of the store is this table")
    if name not in store:
        before = "is new in the store"
    else:
        try:
            head = store.summary(name)
            error_before = terminal.error(head.get("error_p99"))
            before = f"replaces {head['revision']}, of {head['model']}, whose error was {error_before}"
        except StoreError:
            before = "replaces a damaged revision"
    revision, _, error = publish_layout(root, name, layout, values=values)
    model = layout.source.attributes().get("model", "a function")
    stated = f"{model}, whose error (p99) is {terminal.error(error.overall.p99)}"
    return PublishedChoice(revision, f"{revision} is a table of {stated}; it {before}")


def _is_there(store: Store, name: str, layout: Layout) -> bool:
    """Return True if the current table has this layout, for any reason, states its error, and is undamaged."""
    if name not in store:
        return False
    wanted = frame(layout)
    arrays = {**wanted.variables, **wanted.coordinates}
    try:
        store.verify(name)
        stored, metadata = store.dataset(name), store.metadata(name)
    except StoreError:
        return False
    known = metadata.attributes()
    return (
        metadata.error is not None
        and all(known.get(key) == value for key, value in wanted.attrs.items() if key != "reason")
        and all(key in stored and np.array_equal(stored[key], array.values) for key, array in arrays.items())
    )


def with_reason(layout: Layout, title: str, wanted: str) -> Layout:
    """Return a layout whose reason names the scene that it was chosen for."""
    planned = f"; {layout.reason}" if layout.reason else ""
    return replace(layout, reason=f"{title}, chosen for {wanted}{planned}")


def png(seen: Seen, choice: Array, cheaper: Array | None, left_out: Sequence[str] = ()) -> bytes:
    """Draw truth, choice and next cheaper forms, and below them a colour bar and the differences of the two.

    The forms that could not be made are listed below the bar. `cheaper` is None if nothing is cheaper.
    """
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    height, width = seen.truth.shape[:2]
    times = max(1, round(_PANEL / width))
    across, down = times * width, times * height
    wide = 3 * across + 4 * _GAP
    high = 2 * (down + _TITLE) + 2 * _GAP
    canvas = Figure(figsize=(wide / _DPI, high / _DPI), dpi=_DPI, facecolor="white")

    def panel(column: int, row: int, title: str, size: tuple[int, int] = (across, down)) -> Axes:
        left = _GAP + column * (across + _GAP)
        top = (row + 1) * _TITLE + row * (down + _GAP)
        axes = canvas.add_axes((left / wide, 1.0 - (top + size[1]) / high, size[0] / wide, size[1] / high))
        axes.set_title(title, **_TEXT)
        return axes

    tolerance = seen.scene.tolerance
    most = TIMES * tolerance.value
    scale = Normalize(0.0, most)
    colours = mpl.colormaps["viridis"].with_extremes(over=BEYOND)
    last = "nothing is cheaper" if cheaper is None else "next cheaper of each material"
    images = (("truth", seen.truth), ("choice", choice), (last, cheaper))
    for column, (title, picture) in enumerate(images):
        axes = panel(column, 0, title)
        axes.set_axis_off()
        if picture is None:
            continue
        axes.imshow(image.srgb(seen.scene, picture), interpolation="nearest", aspect="auto")
        if column > 0:
            off = seen.differences(picture)
            below = panel(column, 1, f"off by {off.max():.2g} at most")
            below.imshow(off, norm=scale, cmap=colours, interpolation="nearest", aspect="auto")
            below.set_axis_off()
    unit = "CIEDE2000" if tolerance.unit == "CIEDE2000" else "relative, at the worst wavelength"
    bar = canvas.colorbar(
        ScalarMappable(scale, colours),
        cax=panel(0, 1, f"difference from the truth, {unit}", (across - _MORE, BAR)),
        orientation="horizontal",
        extend="max",
        ticks=[0.0, tolerance.value, most],
    )
    bar.ax.set_xticklabels(["0", f"{tolerance.value:g}, the tolerance", f"{most:g}"], **_TEXT)
    bar.ax.axvline(tolerance.value, color="white", linewidth=2.0)
    beside: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset pixels", "va": "center"}
    bar.ax.annotate("more", (1.0, 0.5), (_MORE / 2.0, 0.0), **beside, **_TEXT)
    if left_out:
        bar.ax.annotate(
            "\n".join(["cannot be made:", *left_out]),
            (0.0, 0.0),
            (0.0, -3.0 * BAR),
            xycoords="axes fraction",
            textcoords="offset pixels",
            va="top",
            **_TEXT,
        )
    data = io.BytesIO()
    canvas.savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()
