"""The sample job: a training set of materials times directions, written shard by shard into one zarr group."""

from __future__ import annotations

import collections
import contextlib
import fcntl
import functools
import importlib.metadata
import itertools
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials.hypercube import Axis, axes_of, in_units, materials, pairs
from brdfdb.models import MODELS
from brdfdb.parameters import Floats, ModelSpec
from brdfdb.place import path_of
from brdfdb.store.codec import array_files, chunk_bytes, group_files, shard_bytes
from brdfdb.store.files import write_file
from brdfdb.store.paths import METADATA
from brdfdb.tables.tabulation import StoredArray
from brdfdb_pipelines import terminal

Array = NDArray[np.float64]

_CHUNK_VALUES = 1 << 18  # usual values of a chunk, 1 MB: what is read for a single value
_MOST_VALUES = 1 << 27  # of a chunk, 512 MB
_SHARD_VALUES = 1 << 23  # usual values of a shard, 32 MB: a file, which an interruption loses
_DIMENSIONS = ("material", "direction")
_LAST = "last.json"  # the metadata of the group until all shards are there: nothing opens the directory before
_SUFFIXES = ("", ".zarr")


class SampleError(BrdfdbError):
    """A training set that cannot be written."""


@dataclass(frozen=True)
class TrainingSet:
    """A training set before its values: the drawn materials and directions.

    `written` has the drawn parameters (M,) as files write them, `angles` those (D,) [degree] of light and viewer. With
    `gradients`, derivatives by the drawn parameters are written, too. A chunk has `chunk` materials, and a shard
    `shard`; None: the usual size. The last `test` materials are those of the test.
    """

    spec: ModelSpec
    axes: list[Axis]
    written: dict[str, Array]
    angles: dict[str, Array]
    gradients: bool
    chunk: int | None = None
    shard: int | None = None
    test: int = 0

    @functools.cached_property
    def shape(self) -> tuple[int, int]:
        """Numbers of materials and of directions."""
        return len(next(iter(self.written.values()))), len(self.angles["theta_i"])

    @functools.cached_property
    def rows(self) -> int:
        """Materials of a chunk."""
        return min(self.chunk or max(1, _CHUNK_VALUES // self.shape[1]), self.shape[0])

    @functools.cached_property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.shape[0] // self.rows)

    @functools.cached_property
    def chunks_of_shard(self) -> int:
        """Chunks of a shard."""
        fitting = (self.shard or _SHARD_VALUES // self.shape[1]) // self.rows
        return min(max(1, fitting), self.chunks)

    @functools.cached_property
    def arguments(self) -> Mapping[str, Array]:
        """Parameters (M,) in the units of the model."""
        return in_units(self.axes, self.written)

    @functools.cached_property
    def directions(self) -> tuple[Array, Array]:
        """Unit vectors (D, 3) of light and viewer."""
        theta_i, phi_i, theta_r, phi_r = (radians(angle) for angle in self.angles.values())
        return unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)

    @functools.cached_property
    def variables(self) -> dict[str, dict[str, str]]:
        """Attributes of the arrays by their names: f_r, and its derivatives."""
        attributes = {"f_r": {"units": "1/sr", "long_name": "BRDF, without the cosine"}}
        if self.gradients:
            for axis in self._derived:
                unit = "" if axis.parameter.unit == "1" else f"/{axis.parameter.unit}"
                attributes[f"f_r_by_{axis.parameter.name}"] = {
                    "units": f"1/sr{unit}",
                    "long_name": f"derivative of f_r by {axis.parameter.name}",
                }
        return attributes

    @property
    def _derived(self) -> list[Axis]:
        return [axis for axis in self.axes if axis.parameter.name != "wavelength_nm"]

    def values(self, chunk: int) -> list[Floats]:
        """Return the arrays (materials of the chunk, D) of `variables`."""
        part = slice(chunk * self.rows, (chunk + 1) * self.rows)
        columns = {name: values[part, np.newaxis] for name, values in self.arguments.items()}
        if not self.gradients:
            return [self.spec.vectors(*self.directions, **columns)]
        assert self.spec.gradient is not None
        gradient = self.spec.gradient(*self.directions, **columns)
        derivatives = []
        for axis in self._derived:
            angle = axis.parameter.unit == "degree"
            by = gradient.derivatives[axis.parameter.name.removesuffix("_deg") if angle else axis.parameter.name]
            derivatives.append(radians(by) if angle else by)  # 1 / degree
        return [gradient.f_r, *derivatives]


def run(
    model: str,
    out: Path,
    *,
    count: int,
    directions: int,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    seed: int = 0,
    gradients: bool = False,
    chunk: int | None = None,
    shard: int | None = None,
    test: float = 0.0,
    jobs: int = 1,
) -> None:
    """Write a training set, or resume one that was interrupted.

    Until the zarr group is complete its name ends in ``.partial``. Ranges of parameters have the names and units of
    recipes. The same seed draws the same set. `chunk` and `shard` are numbers of materials, `test` is the share of the
    materials that are for tests: the last ones, which are as random as the others.

    Raises
    ------
    ParameterError
        If the model is unknown or has no derivatives, or a range, a size or a share is refused.
    SampleError
        If the group exists already, another process writes it, or part of another set has its name.
    """
    out = path_of(out, "out")
    spec = MODELS[model]
    if seed < 0:
        raise ParameterError("--seed", f"{seed} is less than 0", seed)
    if gradients and spec.gradient is None:
        known = [one.name for one in MODELS.values() if one.gradient is not None]
        text = f"{model} has no derivatives; models with derivatives: {', '.join(known)}"
        raise ParameterError("--gradients", text, model, known)
    if out.suffix not in _SUFFIXES:
        raise SampleError(f"{out} is no name of a training set, a folder that zarr reads; let it end in .zarr")
    if os.path.lexists(out):
        raise SampleError(f"{out} exists already; remove it, or give another name")
    _check_sizes(count, directions, chunk, shard)
    tests = round(test * count) if 0.0 <= test < 1.0 else -1
    if test and not 0 < tests < count:
        text = f"{test:g} of {count} materials are none or all; give a share such as 0.1"
        raise ParameterError("--test", text, test)
    axes = axes_of(spec, ranges or {})
    drawn = materials(spec, axes, count, seed)
    if tests and not any(np.unique(values).size == count for values in drawn.values()):
        raise ParameterError("--test", "the ranges are so narrow that a material may be on both sides", test)
    made = TrainingSet(spec, axes, drawn, pairs(directions, seed), gradients, chunk, shard, tests)
    partial = out.with_name(f"{out.name}.partial")
    with _alone(partial, out):
        _write(made, seed, partial, jobs)
        os.replace(partial, out)
    size = terminal.size(sum(file.stat().st_size for file in out.rglob("*") if file.is_file()))
    parts = f", the last {tests} for tests" if tests else ""
    print(f"{out}: {count} materials of {model} times {directions} directions{parts}, {size}")
    print(f"{made.rows} materials a chunk, {made.rows * made.chunks_of_shard} a file")


def _check_sizes(count: int, directions: int, chunk: int | None, shard: int | None) -> None:
    """Raise a ParameterError for a chunk that is too large, or a shard that is not made of chunks."""
    if chunk is not None and (values := min(chunk, count) * directions) > _MOST_VALUES:
        text = f"{chunk} materials take {terminal.size(4 * values)}; at most {_MOST_VALUES // directions} are allowed"
        raise ParameterError("--chunk", text, chunk)
    if shard is not None and (chunk is None or shard % chunk):
        wrong = "needs --chunk" if chunk is None else f"{shard} is not a multiple of {chunk}, the materials of a chunk"
        raise ParameterError("--shard", wrong, shard)


@contextlib.contextmanager
def _alone(partial: Path, out: Path) -> Iterator[None]:
    """Hold the directory of a set that is being written, as its only writer."""
    partial.mkdir(parents=True, exist_ok=True)
    handle = os.open(partial, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.lexists(out):  # another process has just finished the set
            with contextlib.suppress(OSError):
                partial.rmdir()
            raise SampleError(f"{out} exists already; remove it, or give another name")
        yield
    except BlockingIOError:
        raise SampleError(f"another process is writing {partial}; wait for it, or give another name") from None
    finally:
        os.close(handle)


def _write(made: TrainingSet, seed: int, partial: Path, jobs: int) -> None:
    """Write all files of a set that are missing. Its metadata come first, under another name, and last."""
    chunk, shard = ((rows, made.shape[1]) for rows in (made.rows, made.rows * made.chunks_of_shard))
    arrays = {  # whose shards are written one by one
        f"{name}/{METADATA}": array_files(_DIMENSIONS, made.shape, chunk, "<f4", json.dumps(attributes), None, shard)[
            METADATA
        ]
        for name, attributes in made.variables.items()
    }
    files = group_files(_coordinates(made), _attributes(made, seed), arrays)
    last = files.pop(METADATA)
    begun = [partial / name for name in (_LAST, METADATA) if (partial / name).exists()]
    if any(file.read_bytes() != last for file in begun):
        raise SampleError(f"{partial} is part of another set; finish that set, or remove it")
    if not begun and any(not file.name.startswith(".") for file in partial.iterdir()):
        raise SampleError(f"{partial} contains files that do not belong to a set; remove them, or give another name")
    write_file(partial / _LAST, last, partial)
    for name, data in files.items():
        write_file(partial / name, data, partial)
    _write_shards(made, partial, jobs)
    os.replace(partial / _LAST, partial / METADATA)


def _write_shards(made: TrainingSet, partial: Path, jobs: int) -> None:
    """Write the missing shards. An interrupted write leaves no part of a shard."""

    def shard_file(name: str, shard: int) -> Path:
        return partial / name / "c" / str(shard) / "0"

    def encoded(chunk: int) -> list[bytes]:
        return [chunk_bytes(values, made.rows) for values in made.values(chunk)]

    every = range(made.chunks)
    parts = [every[start : start + made.chunks_of_shard] for start in every[:: made.chunks_of_shard]]
    last = next(reversed(made.variables))  # the array whose shards are written last
    missing = {shard: part for shard, part in enumerate(parts) if not shard_file(last, shard).exists()}
    for half in partial.glob(".*"):  # files of a killed process
        half.unlink()
    with terminal.progress() as bar, ThreadPoolExecutor(jobs) as executor:
        done = made.chunks - sum(map(len, missing.values()))
        task = bar.add_task(made.spec.name, total=made.chunks, completed=done)
        try:
            chunks = _in_order(executor, encoded, [chunk for part in missing.values() for chunk in part], 2 * jobs)
            for shard, part in missing.items():
                columns = []
                for _ in part:
                    columns.append(next(chunks))
                    bar.advance(task)
                for name, column in zip(made.variables, zip(*columns, strict=True), strict=True):
                    write_file(shard_file(name, shard), shard_bytes(column, made.chunks_of_shard), partial)
        except BaseException:
            executor.shutdown(cancel_futures=True)
            raise


def _in_order(
    executor: ThreadPoolExecutor, task: Callable[[int], list[bytes]], numbers: Sequence[int], ahead: int
) -> Iterator[list[bytes]]:
    """Yield the results of a task for each number; `ahead` of them are computed before they are asked for."""
    waiting = iter(numbers)
    running = collections.deque(executor.submit(task, number) for number in itertools.islice(waiting, ahead))
    while running:
        result = running.popleft().result()
        running.extend(executor.submit(task, number) for number in itertools.islice(waiting, 1))
        yield result


def _coordinates(made: TrainingSet) -> dict[str, StoredArray]:
    """Return parameters along the materials, and angles along the directions."""
    variables = {}
    for parameter in (axis.parameter for axis in made.axes):
        attributes = {"units": parameter.unit, "long_name": parameter.meaning}
        variables[parameter.name] = StoredArray(_DIMENSIONS[:1], made.written[parameter.name], attributes)
    for name, angles in made.angles.items():
        variables[name] = StoredArray(_DIMENSIONS[1:], angles, {"units": "degree"})
    return variables


def _attributes(made: TrainingSet, seed: int) -> dict[str, Any]:
    """Return the attributes of the group."""
    spec = made.spec
    first = made.shape[0] - made.test
    rule = (
        "rows of train and test, from the first to before the last: no material is in both; the seed draws their order"
    )
    split = {"split": {"train": [0, first], "test": [first, made.shape[0]]}, "split_rule": rule} if made.test else {}
    fixed = {one.name: one.default for one in spec.parameters if isinstance(one.default, bool)}
    return {
        "coordinates": " ".join([*made.written, *made.angles]),
        "title": f"Training set: {made.shape[0]} materials of {spec.title}",
        "model": spec.name,
        "model_version": spec.version,
        "form": spec.equation,
        "reference": spec.reference,
        "seed": seed,
        "ranges": {axis.parameter.name: [axis.low, axis.high] for axis in made.axes},
        "logarithmic": [axis.parameter.name for axis in made.axes if axis.logarithmic],
        "condition": spec.draw.condition,
        "fixed": fixed,
        "materials": "Latin hypercube over the ranges",
        "directions": "Latin hypercube, even in solid angle; every material has all of them",
        **split,
        "versions": {name: importlib.metadata.version(name) for name in ("brdfdb", "numpy", "scipy")},
    }
