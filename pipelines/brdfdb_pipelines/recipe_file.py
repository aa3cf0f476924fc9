"""Recipes: which materials to tabulate, on which grids and at which wavelengths, checked before anything is built."""

from __future__ import annotations

import fnmatch
import functools
import itertools
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    FailFast,
    Field,
    PrivateAttr,
    ValidationError,
)

from brdfdb.errors import MaterialError, ParameterError, sentence_of
from brdfdb.geometry import radians
from brdfdb.materials import PAPERS, Material, exact_material, libraries, presets, source_of, written_name
from brdfdb.materials.polarised import polarised_source
from brdfdb.models import MODELS
from brdfdb.parameters import closest
from brdfdb.store.family import Sweep
from brdfdb.store.paths import NAME
from brdfdb.tables.grids import Grid, check_wavelengths
from brdfdb.tables.layout import TABLE_VERSION, Interpolation, Layout, digest, over_wavelengths
from brdfdb.tables.mixture import refined_wavelengths
from brdfdb.tables.planner import PLAN_VERSION, coarsest, offset_of, planned
from brdfdb.tables.polarisation import GRID_TOLERANCE, planned_theta_d
from brdfdb.tables.stokes import POLARISATION_VERSION
from brdfdb.tables.sweeps import SHARED_PLAN_VERSION
from brdfdb_pipelines import toml_file
from brdfdb_pipelines.measured_job import MeasuredJob, measured_job
from brdfdb_pipelines.recipe_grids import LIST, STRICT, Grids, Nodes, Range, RecipeError, nodes_of

if TYPE_CHECKING:  # rays and their statistics take a second to load
    from brdfdb_pipelines.simulated_job import SimulatedJob

_SIMULATED = {"surface", "height_map", "slope_deg", "facets"}  # keys that simulated materials alone have
_WITHOUT_MODEL = {"samples", *_SIMULATED}  # keys of materials without a model
_MOST_VALUES = 1 << 36  # values of a table: 275 GB
_MOST_PATTERNS = 10_000  # names and patterns of a recipe; each is compared with every name
_MOST_MEMBERS = 100_000  # members of all families of a recipe
_MOST_SWEPT = 6  # parameters of a family; a lookup interpolates between two members along each, 64 in all


def _known_library(name: str) -> str:
    """Return the name of a library; ValueError for pydantic if there is none."""
    names = libraries()
    if name not in names:
        raise ValueError(f"{name!r} is not one of {', '.join(names)}")
    return name


@dataclass(frozen=True)
class Job:
    """One table to build: on a grid, or to a tolerance, of which one is None; `family` says what it is a member of.

    `planned_on` has the formula that the model of `material` is the exact form of. It plans the axes faster. With
    `shared_plan` the table may take the plan of another member of its family.
    """

    material: Material
    wavelength_nm: NDArray[np.float64] | None
    grid: Grid | None
    tolerance: float | None
    interpolation: str = "linear"
    planned_on: Material | None = None
    family: Mapping[str, Any] | None = None
    polarised: bool = False
    hot_spot_tolerance: float | None = None
    shared_plan: bool = False

    @classmethod
    def from_request(cls, request: Mapping[str, Any]) -> Job:
        """Return the job of a `request`; BrdfdbError if this program cannot read its material."""
        alike = request.get("planned_on")
        material, planned_on = (None if one is None else source_of(one) for one in (request, alike))
        assert isinstance(material, Material)
        assert planned_on is None or isinstance(planned_on, Material)
        return cls(
            material,
            None if request["wavelength_nm"] is None else np.array(request["wavelength_nm"]),
            None if request["grid"] is None else Grid(request["grid"]),
            request["tolerance"],
            request["interpolation"] or "linear",
            planned_on,
            request.get("family"),
            "polarised" in request,
            request.get("hot_spot_tolerance"),
            "shared_plan" in request,
        )

    def layout(self) -> Layout:
        """Return the layout of the table; to a tolerance, this takes the planner a second or more."""
        return self.planned()[0]

    def planned(self) -> tuple[Layout, NDArray[np.float32] | None]:
        """Return the layout of the table, and its values if a plan has computed them."""
        layout, values = self._unpolarised()
        if not self.polarised:
            return layout, values
        assert layout.wavelength_nm is not None  # of all models with Mueller matrices
        within = GRID_TOLERANCE if self.tolerance is None else self.tolerance
        nodes = planned_theta_d(self.material, layout.wavelength_nm, within)
        return replace(layout, facet_theta_d_deg=nodes), values

    def _unpolarised(self) -> tuple[Layout, NDArray[np.float32] | None]:
        if self.grid is not None:
            method = self.interpolation.removeprefix("log-")
            logarithm = method != self.interpolation
            offset = offset_of(self.material, self.wavelength_nm) if logarithm else 0.0
            how = Interpolation(method, logarithm, offset, wavelengths=over_wavelengths(self.material))
            return Layout(self.material, self.grid, self.wavelength_nm, interpolation=how), None
        assert self.tolerance is not None
        wavelength_nm = self.wavelength_nm
        refined_nm = wavelength_nm  # the members of a family share their wavelengths
        if self.family is None:
            refined_nm = refined_wavelengths(self.material, wavelength_nm, self.tolerance)
        plan = functools.partial(planned, alike=self.planned_on, hot_spot_tolerance=self.hot_spot_tolerance)
        try:
            return plan(self.material, refined_nm, self.tolerance)
        except ParameterError:
            if refined_nm is None or wavelength_nm is None or refined_nm.size == wavelength_nm.size:
                raise
        return plan(self.material, wavelength_nm, self.tolerance)

    def check(self) -> None:
        """Raise the ParameterError that `layout` would raise for what does not suit the material."""
        grid = coarsest(self.material) if self.grid is None else self.grid
        layout = Layout(self.material, grid, self.wavelength_nm)
        if self.polarised:
            polarised_source(self.material)
        if layout.size > _MOST_VALUES:
            shape = " x ".join(map(str, layout.shape))
            raise RecipeError("", f"{shape} nodes are {layout.size:.3g} values; a table has at most {_MOST_VALUES:.3g}")

    @property
    def name(self) -> str:
        """Name of the table."""
        return self.material.name

    @property
    def model(self) -> str:
        """Name of the model."""
        return self.material.model

    @property
    def request(self) -> dict[str, Any]:
        """Everything that decides the table, ready for JSON: the same request makes the same table."""
        member = {} if self.family is None else {"family": dict(self.family)}
        alike = {} if self.planned_on is None else {"planned_on": self.planned_on.document()}
        polarised = {"polarised": POLARISATION_VERSION} if self.polarised else {}
        hot_spot = {} if self.hot_spot_tolerance is None else {"hot_spot_tolerance": self.hot_spot_tolerance}
        shared = {"shared_plan": SHARED_PLAN_VERSION} if self.shared_plan else {}
        return {
            **member,
            **alike,
            **polarised,
            **hot_spot,
            **shared,
            "table_version": TABLE_VERSION,
            **self.material.document(),
            "wavelength_nm": None if self.wavelength_nm is None else self.wavelength_nm.tolist(),
            "grid": None if self.grid is None else {name: nodes.tolist() for name, nodes in self.grid.axes.items()},
            "interpolation": None if self.grid is None else self.interpolation,
            "tolerance": self.tolerance,
            "plan_version": None if self.tolerance is None else PLAN_VERSION,
        }


MemberPoint = tuple[int, tuple[float, ...]]  # number of a member from 0, values of the swept parameters as in files


class Members(NamedTuple):
    """Members of a family that a recipe asks for; memory does not grow with their number.

    `bases` has the job of a member, and that of another if some members are isotropic and some are not: only the grid
    of their jobs differs. `axes` has the values of the swept parameters, and the last runs fastest.
    """

    name: str
    title: str
    width: int  # digits of the numbers in the names of members
    axes: dict[str, list[float]]
    bases: list[Job]
    numbers: Sequence[int]

    @property
    def size(self) -> int:
        """Number of members that the axes make."""
        return math.prod(map(len, self.axes.values()))

    def points(self) -> Iterator[MemberPoint]:
        """Yield the members, in the order of their names."""
        for number in self.numbers:
            rest = number
            values = []
            for axis in reversed(self.axes.values()):
                rest, place = divmod(rest, len(axis))
                values.append(axis[place])
            yield number, tuple(reversed(values))

    def jobs(self, points: Iterable[MemberPoint] | None = None) -> Iterator[Job]:
        """Yield the jobs of members, by default of all; the recipe has checked that their parameters are in range."""
        kinds = {base.material.anisotropic: base for base in self.bases}
        material = self.bases[0].material
        in_model = {written_name(parameter): parameter for parameter in material.spec.parameters}
        swept = [in_model[x] for x in self.axes]
        for number, values in self.points() if points is None else points:
            parameters = dict(material.parameters)
            for parameter, value in zip(swept, values, strict=True):
                parameters[parameter.name] = float(radians(value)) if parameter.unit == "rad" else value
            at = dict(zip(self.axes, values, strict=True))
            names = {"name": self.member(number), "title": _title(self.title, at)}
            member = material.model_copy(update={**names, "parameters": parameters})
            base = kinds.get(member.anisotropic, self.bases[0])
            yield replace(base, material=member, family={"name": self.name, "parameters": at})

    def member(self, number: int) -> str:
        """Return the name of a member."""
        return f"{self.name}-{number + 1:0{self.width}d}"

    def has(self, name: str) -> bool:
        """Return True if a member of the family has this name."""
        family, _, number = name.rpartition("-")
        right = family == self.name and len(number) == self.width and number.isdecimal()
        return right and 1 <= int(number) <= self.size

    def matching(self, pattern: str) -> Sequence[int]:
        """Return the numbers of the members whose names match a pattern: all if the name of the family does."""
        if fnmatch.filter([self.name], pattern):
            return range(self.size)
        literal = re.split(r"[*?[]", pattern, maxsplit=1)[0]
        if not f"{self.name}-".startswith(literal[: len(self.name) + 1]):
            return []
        return [number for number in range(self.size) if fnmatch.fnmatch(self.member(number), pattern)]


class Recipe(BaseModel):
    """A recipe file. Angles are degrees, wavelengths nanometres."""

    model_config = STRICT

    title: str = ""
    materials: Annotated[list[str], FailFast()] = Field(
        min_length=1, max_length=_MOST_PATTERNS, description="names or shell patterns"
    )
    library: Annotated[str, AfterValidator(_known_library)] = Field(
        default=PAPERS, description="library of presets that the names mean"
    )
    wavelengths_nm: Nodes = Field(default=[], description="of spectral materials that state none themselves")
    tolerance: float | None = Field(
        default=None, ge=1e-4, le=0.5, description="99th percentile of the relative error, instead of grids"
    )
    hot_spot_tolerance: float | None = Field(
        default=None,
        ge=1e-4,
        le=0.5,
        description="largest error of 98 of 100 values near the light: theta_r within 10 degrees of theta_i, delta_phi "
        "within 90; goes with tolerance",
    )
    grids: Grids | None = None
    interpolation: Literal["linear", "cubic", "log-linear", "log-cubic"] | None = Field(
        default=None, description="between the nodes of grids, of f_r or of its logarithm; by default linear"
    )
    forms: Literal["exact", "paper"] = Field(
        default="paper",
        description="exact: tabulate the integral that a formula approximates, if there is one, except of families",
    )
    polarised: bool = Field(
        default=False,
        description="true: tabulate Mueller matrices, too, to the tolerance; for models of polarised light. Measured "
        "materials have a key of their own",
    )
    define: dict[str, dict[str, Any]] = Field(
        default={},
        description="materials of your own, as in the preset files; with samples, a file, they are measured; with "
        "surface or height_map they are simulated",
    )
    sweep: dict[str, dict[str, Any]] = Field(
        default={}, description="families of materials: written like a material, with lists as values of parameters"
    )

    _folder: Path | None = PrivateAttr(default=None)  # that relative paths of CSV files begin at
    _measured: list[MeasuredJob] = PrivateAttr(default=[])
    _simulated: list[SimulatedJob] = PrivateAttr(default=[])
    _checked: list[Job | Members] | None = PrivateAttr(default=None)  # a recipe does not change once it is read

    def orders(self) -> list[Job | Members]:
        """Return a job for each table of a model alone, and the members of families; RecipeError if it is wrong."""
        if self._checked is None:
            self._checked = self._orders()
        return [*self._checked]

    def jobs(self) -> list[Job]:
        """Return a job for each table of a model that the recipe asks for; RecipeError if the recipe is wrong."""
        return [job for one in self.orders() for job in (one.jobs() if isinstance(one, Members) else [one])]

    def measured_jobs(self) -> list[MeasuredJob]:
        """Return a job for each table of measured data that the recipe asks for; errors as by `jobs`."""
        self.orders()
        return [*self._measured]

    def simulated_jobs(self) -> list[SimulatedJob]:
        """Return a job for each table of a simulated surface that the recipe asks for; errors as by `jobs`."""
        self.orders()
        return [*self._simulated]

    def _orders(self) -> list[Job | Members]:
        if (self.tolerance is None) == (self.grids is None):
            raise RecipeError("tolerance, grids", "give exactly one of them")
        if self.interpolation is not None and self.grids is None:
            raise RecipeError(
                "interpolation", "is allowed only with grids; with a tolerance, the planner chooses the interpolation"
            )
        if self.hot_spot_tolerance is not None and self.tolerance is None:
            raise RecipeError(
                "hot_spot_tolerance", "is allowed only with tolerance; on grids, the error is measured and stated"
            )
        given = {} if self.grids is None else {name: grid for name, grid in self.grids if grid is not None}
        grids = {name: self._grid(grid, name) for name, grid in given.items()}
        wavelengths = None
        if self.wavelengths_nm:
            try:
                wavelengths = check_wavelengths(nodes_of("wavelengths_nm", self.wavelengths_nm))
            except ParameterError as error:
                raise RecipeError(error.parameter, error.sentence) from None
        selected = self._selected(wavelengths)
        for kind, others in (("measured", self._measured), ("simulated", self._simulated)):
            if self.polarised and others:
                name = others[0].name
                text = f"{name} is measured: give polarised = true in define.{name}"
                text = f"{name} is simulated, and its polarisation is unknown" if kind == "simulated" else text
                raise RecipeError("polarised", text)
            if self.hot_spot_tolerance is not None and others:
                raise RecipeError("hot_spot_tolerance", f"is only for models, and {others[0].name} is {kind}")
        orders: list[Job | Members] = []
        for one in selected:
            if isinstance(one, Material):
                orders.append(self._job(one, None, grids, wavelengths))
            else:
                bases = [self._job(job.material, job.family, grids, wavelengths) for job in one.bases]
                orders.append(one._replace(bases=bases))
        return orders

    def _job(
        self,
        named: Material,
        family: Mapping[str, Any] | None,
        grids: Mapping[str, Grid],
        wavelengths: NDArray[np.float64] | None,
    ) -> Job:
        """Return the job of a material, checked."""
        material = exact_material(named) if self.forms == "exact" and family is None else named
        wavelength_nm = None
        if material.spectral:
            stated = material.wavelengths_nm
            wavelength_nm = wavelengths if stated is None else np.array(stated)
            if wavelength_nm is None:
                raise RecipeError(
                    "wavelengths_nm", f"is missing; {material.name} is spectral and states no wavelengths"
                )
        several = wavelength_nm is not None and wavelength_nm.size > 1
        kind = "anisotropic" if material.anisotropic else "spectral" if several else "isotropic"
        if self.grids is not None and kind not in grids:
            raise RecipeError(f"grids.{kind}", f"is missing; {material.name} needs it")
        job = Job(
            *(material, wavelength_nm, grids.get(kind), self.tolerance, self.interpolation or "linear"),
            planned_on=None if material is named or self.tolerance is None else named,
            family=family,
            polarised=self.polarised,
            hot_spot_tolerance=self.hot_spot_tolerance,
        )
        try:
            job.check()
        except ParameterError as error:
            where = "" if job.grid is None else f" on grids.{kind}"
            raise RecipeError(f"{material.name}{where}", str(error)) from None
        return job

    def _grid(self, grid: BaseModel, name: str) -> Grid:
        parts: dict[str, list[float | Range]] = dict(grid)
        try:
            axes = {field.removesuffix("_deg"): nodes_of(field, nodes) for field, nodes in parts.items()}
        except RecipeError as error:
            raise RecipeError(f"grids.{name}.{error.parameter}", error.sentence) from None
        try:
            return Grid(axes)
        except ParameterError as error:
            raise RecipeError(f"grids.{name}.{error.parameter}_deg", error.sentence) from None

    def sweeps(self, jobs: Sequence[Job]) -> list[Sweep]:
        """Return the families whose members are all among the jobs."""
        sweeps = []
        for name, table in self.sweep.items():
            axes = _swept(name, table)
            members = sorted((j for j in jobs if j.family and j.family["name"] == name), key=lambda j: j.material.name)
            if len(members) == math.prod(map(len, axes.values())):
                sweeps.append(
                    Sweep(
                        name=name,
                        title=table["title"],
                        model=table["model"],
                        axes=axes,
                        members=[job.material.name for job in members],
                        request_sha256=[digest(job.request) for job in members],
                    )
                )
        return sweeps

    def _selected(self, wavelengths: NDArray[np.float64] | None) -> list[Material | Members]:
        known = dict(presets(self.library))
        for name, table in self.define.items():
            if name in known:
                raise RecipeError(f"define.{name}", "is the name of a preset; choose another name")
            if not _WITHOUT_MODEL.isdisjoint(table):
                if not NAME.fullmatch(name):
                    raise RecipeError(f"define.{name}", "is not made of lower-case letters, digits and single hyphens")
                continue
            try:
                known[name] = Material.from_table(name, table, self._folder)
            except MaterialError as error:
                raise RecipeError(f"define.{name}", f"{error.parameter}: {error.sentence}") from None
        families: dict[str, Members] = {}
        count = 0
        for name, table in self.sweep.items():  # before the first member of the first family is made
            count += math.prod(map(len, _swept(name, table).values()))
            if count > _MOST_MEMBERS:
                raise RecipeError(
                    f"sweep.{name}.parameters",
                    f"the lists make {count} members; the families of a recipe have at most {_MOST_MEMBERS} in total",
                )
        for name, table in self.sweep.items():
            members = _members(name, table, self._folder)
            others = [*known, *families]
            taken = name if name in others or any(m.has(name) for m in families.values()) else None
            if (taken := taken or next(filter(members.has, others), None)) is not None:
                raise RecipeError(f"sweep.{name}", f"{taken!r} is the name of another material or family")
            families[name] = members
        chosen: dict[str, Material | Members] = {}
        measured = {name: table for name, table in self.define.items() if "samples" in table}
        simulated = {n: t for n, t in self.define.items() if n not in measured and not _SIMULATED.isdisjoint(t)}
        files: dict[str, MeasuredJob] = {}
        surfaces: dict[str, SimulatedJob] = {}
        for pattern in self.materials:
            matches = fnmatch.filter(known, pattern)
            named = fnmatch.filter(measured, pattern)
            files |= {x: measured_job(x, measured[x], self._folder, self.tolerance) for x in named if x not in files}
            of_rays = fnmatch.filter(simulated, pattern)
            surfaces |= {x: self._of_rays(x, wavelengths) for x in of_rays if x not in surfaces}
            among = {name: numbers for name, whole in families.items() if (numbers := whole.matching(pattern))}
            if not matches and not named and not of_rays and not among:
                apart = [whole.member(number) for whole in families.values() for number in whole.numbers]
                raise RecipeError(
                    "materials", _no_match(pattern, [*known, *apart, *measured, *simulated, *families], self.library)
                )
            chosen |= {name: known[name] for name in matches}
            for name, numbers in among.items():
                before = chosen.get(name)
                if isinstance(before, Members):
                    numbers = sorted({*numbers, *before.numbers})
                chosen[name] = families[name]._replace(numbers=numbers)
        self._measured = list(files.values())
        self._simulated = list(surfaces.values())
        return [one if isinstance(one, Material) else one._replace(bases=_kinds(one)) for one in chosen.values()]

    def _of_rays(self, name: str, wavelengths: NDArray[np.float64] | None) -> SimulatedJob:
        """Return the job of a simulated material; RecipeError if it cannot be built."""
        from brdfdb_pipelines.simulated_job import simulated_job

        at = None if wavelengths is None else wavelengths.tolist()
        return simulated_job(name, self.define[name], self._folder, self.tolerance, at)


def _parameters_of(model: Any) -> list[str]:
    """Return the parameters of a model as recipes write them; none if there is no such model."""
    known = isinstance(model, str) and model in MODELS
    return [written_name(parameter) for parameter in MODELS[model].parameters] if known else []


def _swept(name: str, table: Mapping[str, Any]) -> dict[str, list[float]]:
    """Return the values of the swept parameters, which are lists, in the order of the model."""
    parameters = table.get("parameters")
    where = f"sweep.{name}.parameters"
    lists = {x: v for x, v in parameters.items() if isinstance(v, list)} if isinstance(parameters, dict) else {}
    if not lists:
        raise RecipeError(where, "give a list of numbers for at least one parameter")
    if len(lists) > _MOST_SWEPT:
        raise RecipeError(where, f"{len(lists)} parameters are lists; at most {_MOST_SWEPT} are allowed")
    known = _parameters_of(table.get("model"))
    axes = {}
    for x in sorted(lists, key=lambda x: known.index(x) if x in known else len(known)):
        try:
            parts = LIST.validate_python(lists[x])
        except ValidationError as error:
            raise _refusal(error, f"{where}.{x}") from None
        values = [float(f"{value:.12g}") for value in nodes_of(f"{where}.{x}", parts)]  # 0.3, not 0.1 + 0.1 + 0.1
        if len(values) < 2:
            raise RecipeError(f"{where}.{x}", "needs a list of at least two values")
        if not all(low < high for low, high in itertools.pairwise(values)):
            raise RecipeError(f"{where}.{x}", "the values must increase strictly")
        axes[x] = values
    return axes


def _title(title: str, at: Mapping[str, float]) -> str:
    """Return the title of a member."""
    return ", ".join([title, *(f"{x} {value:.12g}" for x, value in at.items())])


def _members(name: str, table: Mapping[str, Any], folder: Path | None) -> Members:
    """Return the members of a sweep; RecipeError if the parameters of any are out of range."""
    axes = _swept(name, table)
    count = math.prod(map(len, axes.values()))
    title = table.get("title")
    family = Members(name, title if isinstance(title, str) else "", max(3, len(str(count))), axes, [], range(count))

    def checked(number: int) -> Material:
        ((_, values),) = family._replace(numbers=[number]).points()
        at = dict(zip(axes, values, strict=True))
        fields = {**table, "parameters": {**table["parameters"], **at}}
        if family.title:
            fields["title"] = _title(family.title, at)
        try:
            return Material.from_table(family.member(number), fields, folder)
        except MaterialError as error:
            if error.parameter in (*table["parameters"], *_parameters_of(table.get("model"))):
                raise RecipeError(f"sweep.{name}.parameters.{error.parameter}", error.sentence) from None
            raise RecipeError(f"sweep.{name}", f"{error.parameter}: {error.sentence}") from None

    first = checked(0)
    try:
        checked(count - 1)  # values increase, and ranges are intervals: all members between are in range, too
    except RecipeError:
        step = 1
        for axis in reversed(axes.values()):  # the first member that is wrong has the first value of all axes but one
            for place in range(len(axis)):
                checked(place * step)
            step *= len(axis)
        raise
    return family._replace(bases=[Job(first, None, None, None, family={"name": name})])


def _kinds(members: Members) -> list[Job]:
    """Return the job of the first isotropic and of the first anisotropic of some members, as far as there are such."""
    spec = members.bases[0].material.spec
    kinds: dict[bool, Job] = {}
    for job in members.jobs():
        kinds.setdefault(job.material.anisotropic, job)
        if len(kinds) == 2 or (spec.anisotropic is None and spec.lobe_axes is None):
            break
    return [*kinds.values()]


def path_from(folder: Path, file: Path) -> str:
    """Return the path of a file as a recipe in a folder writes it: relative to the folder, if that is possible."""
    try:
        return Path(os.path.relpath(file.absolute(), folder.absolute())).as_posix()
    except ValueError:  # on another drive
        return file.absolute().as_posix()


def load(path: Path | None = None, library: str = PAPERS, *, to_build: bool = True) -> Recipe:
    """Read a recipe file, by default that of a library of presets, and check that it can be built.

    If it is not `to_build`, it may leave out `materials`, which are those that it defines, and `tolerance` or `grids`.
    RecipeError names the file and the field; ParameterError if there is no such library.
    """
    source = recipe_of(library) if path is None else path
    try:
        content = toml_file.read(source)
        if not to_build:  # a list of materials and a tolerance, which nothing will use
            kinds = [content[kind] for kind in ("define", "sweep") if isinstance(content.get(kind), dict)]
            tolerance = {} if "grids" in content else {"tolerance": 0.1}
            content = {"materials": [name for kind in kinds for name in kind] or ["*"], **tolerance, **content}
        recipe = Recipe.model_validate(content)
        if path is not None:
            recipe._folder = path.parent
        recipe.orders()
    except OSError as error:
        refusal = RecipeError("", error.strerror or str(error))
    except toml_file.TomlError as error:
        refusal = RecipeError("", str(error))
    except ValidationError as error:
        refusal = _refusal(error)
    except RecipeError as error:
        refusal = error
    else:
        return recipe
    refusal.file = str(source)
    raise refusal from None


def _refusal(error: ValidationError, where: str = "") -> RecipeError:
    """Return the refusal of the first field that pydantic refuses, below a table of the recipe."""
    # pydantic lists each branch of number | range: a table was meant as a range, whatever else is wrong with it,
    # and the names of the branches are not names of the recipe
    errors = error.errors(include_url=False)
    first = next(item for item in errors if not ("float" in item["loc"][-1:] and isinstance(item["input"], dict)))
    field = ".".join(str(part) for part in first["loc"] if part not in ("float", "Range", "plain", "half"))
    hint = "; 0.01 is 1 %" if field == "tolerance" and first["type"] != "missing" else ""
    return RecipeError(".".join(part for part in (where, field) if part), sentence_of(first) + hint)


def recipe_of(library: str) -> Traversable:
    """Return the packaged recipe of a library of presets; ParameterError if there is no such library."""
    try:
        name = "default" if _known_library(library) == PAPERS else library
    except ValueError as error:
        raise ParameterError("library", str(error), library, tuple(libraries())) from None
    return resources.files("brdfdb_pipelines") / "recipes" / f"{name}.toml"


def _no_match(pattern: str, names: Iterable[str], library: str) -> str:
    """Return the sentence on a name or pattern that matches none of the names that a recipe can use."""
    for other in libraries():
        if other != library and fnmatch.filter(presets(other), pattern):
            return f'{pattern!r} is in the library {other}; for its materials, write library = "{other}"'
    option = "" if library == PAPERS else f" --library {library}"
    return f"{pattern!r} matches no material{closest(pattern, names)}; `brdfdb list --presets{option}` prints all names"
