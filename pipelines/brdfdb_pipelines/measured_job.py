"""The job that builds one table of measured data, from a file of any format that is read."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError

from brdfdb import formats
from brdfdb.errors import BrdfdbError, FileFormatError, ParameterError, StoreError, sentence_of
from brdfdb.formats._input import check_file
from brdfdb.materials.provenance import Text
from brdfdb.measurements import MeasuredSource, Samples, joined
from brdfdb.measurements.conventions import ANGLE_WORDS, CONVENTION_KEYS, Convention
from brdfdb.measurements.measured_source import LIGHTS_DEG, MARGIN
from brdfdb.measurements.statement import statement
from brdfdb.place import path_of
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import material_path, revision_path
from brdfdb.store.publication import publish_files, stated_table
from brdfdb.store.records import make_store, point_to, read_manifest
from brdfdb.store.revisions import Standing, standing
from brdfdb.tables.albedo import directional_albedo, largest_albedo
from brdfdb.tables.layout import TABLE_VERSION, Layout
from brdfdb.tables.measured_layout import MeasuredLayout, tabulated
from brdfdb.tables.mueller_field import check_polarised, field_of
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import glints_of
from brdfdb_pipelines.recipe_grids import STRICT, RecipeError

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable

MEASURED_VERSION = 10  # of the way from a file to the values of its table
# Keys of a request that are left out where they have their default.
_ADDED = {
    "columns",
    "where",
    "missing",
    "quantity",
    "angles",
    "azimuth",
    "wavelength_unit",
    "coverage_factor",
    "wavelength_nm",
    "side",
    "mueller_frame",
    "polarised",
}
_MOST_MARGIN = 0.9  # of a light whose table is above 1 by far, such as one with glints between its lights
_MARGINS = 3  # tables of data that are made to conserve, each a little darker, until none is above 1


def _checked_angles(words: str) -> str:
    """Return words on angles; ValueError if one is not known, or two exclude each other."""
    return Convention(angles=words).angles


Texts = Annotated[
    list[Annotated[str, Field(min_length=1)]],
    BeforeValidator(lambda value: [value] if isinstance(value, str) else value),
    Field(min_length=1),
]


class MeasuredTable(BaseModel):
    """A material of a recipe that is measured."""

    model_config = STRICT

    samples: Texts = Field(
        description="path of the file, of any format that is read, or paths of files that are joined"
    )
    format: str = Field(default="", description="format of the file; by default the one that recognises it")
    member: str = Field(default="", description="file of an archive of networks; by default it is no archive")
    columns: dict[str, Texts] = Field(
        default={}, description="headers of the columns of a text, by role, such as theta_i; by default by their names"
    )
    where: dict[str, Texts] = Field(
        default={}, description="values of columns of a text, by header: only rows that have one of them are read"
    )
    missing: float | None = Field(
        default=None, allow_inf_nan=False, description="number of the file that marks values that were not measured"
    )
    quantity: Literal[
        "",
        "f_r",
        "reflectance_factor",
        "percent",
        "reflectance_factor_percent",
        "log10",
        "ln",
        "decibel",
        "f_r_cos",
        "f_r_cos_i",
    ] = Field(
        default="", description="what the values of the file are; by default what the format, names and titles say"
    )
    angles: Annotated[str, AfterValidator(_checked_angles)] = Field(
        default="",
        description=f"what the angles of the file are: {', '.join(ANGLE_WORDS)}, or several with commas",
    )
    azimuth: Literal["", "light", "forward", "mirror", "absolute"] = Field(
        default="",
        description="from where azimuths of viewers count: light, mirror, absolute; or forward, where those of lights "
        "are those into which it travels; by default as the format says",
    )
    wavelength_unit: Literal["", "nm", "um", "m"] = Field(
        default="", description="unit of the wavelengths of the file; by default that of the format"
    )
    coverage_factor: float | None = Field(
        default=None, gt=0.0, allow_inf_nan=False, description="factor k of expanded uncertainties"
    )
    wavelength_nm: float | None = Field(
        default=None, ge=10.0, le=1e6, description="wavelength [nm] of a file of one channel that states none"
    )
    side: Literal["", "back", "front"] = Field(default="", description="side of a Klems matrix; by default back")
    mueller_frame: Literal["", "s", "p"] = Field(
        default="",
        description="polarisation that Q > 0 means in the Mueller matrices of a file: s, the default, or p, with the "
        "signs of Q and V that ellipsometers write",
    )
    polarised: bool = Field(default=False, description="tabulate the Mueller matrices of the file, too")
    title: Text | None = Field(default=None, description="a line for people; by default the name in the file")
    source: Text | None = Field(default=None, description="who measured, where it is published; by default the file's")
    reciprocal: bool = Field(default=False, description="tabulate the nearest values that are reciprocal")
    conserving: bool = Field(default=False, description="tabulate the nearest values with no albedo above 1")

    @property
    def keywords(self) -> dict[str, Any]:
        """Return the keywords of `brdfdb.formats.read`."""
        names = ("member", "where", *CONVENTION_KEYS, "wavelength_nm", "side", "mueller_frame")
        others = {name: getattr(self, name) for name in names}
        given = {name: value for name, value in others.items() if value}
        return {**self.columns, **given, **({} if self.missing is None else {"missing": self.missing})}

    def read(self, paths: Sequence[Path]) -> FileTable | Samples:
        """Return f_r of the one file, or the samples of several that are joined; errors as by `joined`."""
        return formats.read(paths[0], self.format, **self.keywords) if len(paths) == 1 else self.joined(paths)

    def joined(self, paths: Sequence[Path]) -> Samples:
        """Return the joined samples of files; FileFormatError, ParameterError or OSError for a bad file."""
        samples = joined([formats.samples(path, self.format, **self.keywords) for path in paths])
        if self.polarised:
            check_polarised(samples)
        return samples


@dataclass(frozen=True)
class MeasuredJob:
    """One table of measured data to build, to a tolerance."""

    name: str
    paths: tuple[Path, ...]
    sha256: str
    table: MeasuredTable
    tolerance: float

    model = "measured"

    @property
    def files(self) -> str:
        """Return the names of the files."""
        return ", ".join(path.name for path in self.paths)

    @property
    def request(self) -> dict[str, Any]:
        """Everything that decides the table, ready for JSON: the same request makes the same table."""
        table = self.table.model_dump(mode="json", exclude={"samples", *_ADDED})
        added = self.table.model_dump(mode="json", include=_ADDED, exclude_defaults=True)
        return {
            "table_version": TABLE_VERSION,
            "measured_version": MEASURED_VERSION,
            "measured_name": self.name,
            "file_sha256": self.sha256,
            "tolerance": self.tolerance,
            **table,
            **added,
        }

    def source(self) -> MeasuredSource:
        """Return the data of the files as a source, unchanged; errors as of `MeasuredTable.joined`."""
        read = self.table.read(self.paths)
        title = self.table.title or read.name
        file = f"the file {self.files}" if len(self.paths) == 1 else f"the files {self.files}"
        if isinstance(read, Samples):
            provenance = self.table.source or read.provenance or file
            read = replace(read, record={**read.record, "doubts": statement(read).hints})
            source = MeasuredSource.of_samples(read, name=self.name, title=title, provenance=provenance)
        else:
            source = MeasuredSource.of_function(
                read.evaluate,
                read.channels,
                read.wavelength_nm,
                name=self.name,
                title=title,
                provenance=self.table.source or file,
                nodes=read.nodes() if read.nodes is not None and read.listed else None,
            )
        return source.recorded(file=self.files, file_sha256=self.sha256)

    def lawful_source(self) -> MeasuredSource:
        """Return the data, made reciprocal or energy-conserving if the table asks for it; errors as of `source`."""
        source = self.source()
        for law in ("reciprocal", "conserving"):
            if getattr(self.table, law):
                source = source.made(law)
        return source


def measured_table(name: str, fields: Mapping[str, Any]) -> MeasuredTable:
    """Return the keys of a measured material of a recipe; RecipeError if one is not what it must be."""
    try:
        return MeasuredTable.model_validate(dict(fields))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise RecipeError(".".join(["define", name, *map(str, first["loc"])]), sentence_of(first)) from None


def measured_job(name: str, fields: Mapping[str, Any], folder: Path | None, tolerance: float | None) -> MeasuredJob:
    """Return the job of a measured material of a recipe; RecipeError if it cannot be built."""
    if tolerance is None:
        raise RecipeError("tolerance", f"is missing; {name} is measured, and grids are only for models")
    table = measured_table(name, fields)
    paths = tuple((folder or Path()) / path_of(sample, "samples") for sample in table.samples)
    digests = []
    for path in paths:
        try:
            check_file(path)
            digests.append(sha256_of(path))
        except FileFormatError as error:
            raise RecipeError(f"define.{name}.samples", str(error)) from None
        except OSError as error:
            raise RecipeError(f"define.{name}.samples", f"{path}: {error.strerror}") from None
    return MeasuredJob(name, tuple(path.absolute() for path in paths), ", ".join(digests), table, tolerance)


def sha256_of(path: Path) -> str:
    """Return the sha256 of a file, or of the names and digests of the files in the directory of a zarr group."""
    if path.is_dir():
        files = sorted(part for part in path.rglob("*") if part.is_file())
        listing = "\n".join(f"{file.relative_to(path).as_posix()} {sha256_of(file)}" for file in files)
        return hashlib.sha256(listing.encode()).hexdigest()
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class MeasuredResult(NamedTuple):
    """The result of one job, in the fields of `brdfdb_pipelines.build.Built`."""

    state: str
    revision: str
    bytes: int
    why: str
    shape: tuple[int, ...] = ()
    wavelengths: int = 0


def revision_bytes(root: Path, name: str, revision: str) -> int:
    """Return the size [byte] of the files of a revision, as its manifest states it."""
    size: int = read_manifest(revision_path(root, name, revision), None).content["summary"]["bytes"]
    return size


def build_measured(root: str, job: MeasuredJob) -> MeasuredResult:
    """Build the table of a job unless the store has it: a task for a worker."""

    def table() -> MeasuredLayout:
        laws = {"reciprocal": job.table.reciprocal, "conserving": job.table.conserving}
        polarised = job.table.joined(job.paths) if job.table.polarised else None
        made = tabulated_lawfully(job.source(), job.tolerance, **laws)
        if polarised is None:
            return made
        source = made.layout.source
        field = field_of(polarised, chiral=isinstance(source, MeasuredSource) and source.measured.chiral)
        return made._replace(layout=replace(made.layout, field=field))

    return build_of_data(Path(root), job.name, job.request, table, f"{job.files}: ")


def build_of_data(
    root: Path, name: str, request: Mapping[str, Any], table: Callable[[], MeasuredLayout], where: str = ""
) -> MeasuredResult:
    """Publish the table of data unless the store has it; ParameterError names the material and `where` its data are."""
    status = standing(root, name, request)
    if status.state != "missing":
        return _found(root, name, status)
    try:
        layout, values = table()
        return _published(root, name, layout, request, values, status.why)
    except StoreError:
        raise
    except BrdfdbError as error:
        raise ParameterError(name, f"{where}{error}") from None


def _found(root: Path, name: str, status: Standing) -> MeasuredResult:
    """Return the result of a job whose table the store has, and make that revision the current one."""
    if status.state == "adoptable":
        with Lock(root, name), writing(root, name):
            point_to(material_path(root, name), status.revision)
    state = "unchanged" if status.state == "current" else "adopted"
    return MeasuredResult(state, status.revision, revision_bytes(root, name, status.revision), status.why)


def _published(
    root: Path, name: str, layout: Layout, request: Mapping[str, Any], values: NDArray[np.float32], why: str
) -> MeasuredResult:
    """Publish a new table, unless another build did; return the result of the job. `why` says why the table is new."""
    staged = stated_table(layout, request, values=values)
    make_store(root)
    with Lock(root, name):
        status = standing(root, name, request)
        if status.state == "missing":
            new = publish_files(root, name, staged.files)
    if status.state != "missing":
        return _found(root, name, status)
    wavelengths = 0 if layout.wavelength_nm is None else layout.wavelength_nm.size
    return MeasuredResult("published", new.revision, new.bytes, why, tuple(layout.shape), wavelengths)


def tabulated_lawfully(
    source: MeasuredSource, tolerance: float, *, reciprocal: bool, conserving: bool
) -> MeasuredLayout:
    """Tabulate data to a tolerance, made reciprocal or energy-conserving where that is asked for.

    Interpolation can raise an albedo above 1 again: for these lights the data are then darkened further, in at most
    `_MARGINS` steps.
    """
    wavelength_nm = None if source.wavelengths_nm is None else np.array(source.wavelengths_nm)
    if reciprocal:
        source = source.made("reciprocal")
    if not conserving:
        return tabulated(source, wavelength_nm, tolerance)
    margin = np.full(LIGHTS_DEG.size, MARGIN)
    for _ in range(_MARGINS):
        made = source.made("conserving", margin)
        table = tabulated(made, wavelength_nm, tolerance)
        read = replace(Table.of(*table), glints=glints_of(table.layout))
        largest = largest_albedo(read, made)
        if not largest.above_1:
            break
        albedos = directional_albedo(read, source=made)
        excess = np.append(albedos.albedo.max(axis=(1, 2)), largest.albedo or 2.0) - 1.0
        theta_i_deg = np.append(albedos.theta_i_deg, largest.theta_i_deg)
        order = np.argsort(theta_i_deg, kind="stable")
        padded = np.pad(np.maximum(excess, 0.0)[order], 1)
        highest = np.lib.stride_tricks.sliding_window_view(padded, 3).max(axis=1)  # lights between two have the larger
        margin = np.minimum(margin + 1.1 * np.interp(LIGHTS_DEG, theta_i_deg[order], highest), _MOST_MARGIN)
    return table
