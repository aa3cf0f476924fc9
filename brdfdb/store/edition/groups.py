"""Groups of an edition: revisions on one grid, stacked along `material` in sharded arrays, or the table of a revision.

The chunks of the main variable, ``brdf`` or ``parts``, are those of the store, byte for byte; a shard strings them
together. Any reader of zarr v3 opens a group.
"""

from __future__ import annotations

import itertools
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.storage import MemoryStore

from brdfdb.store.codec import chunk_bytes, group_files, shard_bytes
from brdfdb.store.decoding import is_ours, read_group
from brdfdb.store.edition.records import Chunk, GroupEntry, RevisionFiles, encoded_records, sha256
from brdfdb.store.paths import METADATA
from brdfdb.tables.tabulation import VARIABLES, StoredArray

MATERIAL = "material"  # the dimension along which members are stacked
MOST_MEMBERS = 1000  # of a group
_MOST_BYTES = 64 * 2**20  # largest size of the members of a group: a reader of one loads the records of all
_MOST_WAITING_BYTES = 256 * 2**20  # largest size of the revisions that wait for others of their kind


class EditionGroup(NamedTuple):
    """A group, ready to be written: its files, its records, and its members in their order."""

    files: dict[str, bytes]
    records: bytes
    members: Sequence[RevisionFiles]

    @property
    def digest(self) -> str:
        """Name of the group."""
        return sha256(self.records)

    @property
    def plain_bytes(self) -> int:
        """Size [byte] of f_r itself beside numbers of another kind; 0 without it."""
        brdf = sum(len(content) for key, content in self.files.items() if key.startswith("brdf/"))
        return brdf if "parts/zarr.json" in self.files else 0

    @property
    def entry(self) -> GroupEntry:
        """The line of the group in an index."""
        names = [member.name for member in self.members]
        size = sum(map(len, self.files.values())) + len(self.records)
        return {
            "digest": self.digest,
            "first": min(names),
            "last": max(names),
            "materials": len(names),
            "bytes": size,
            "objects": len(self.files) + 1,
            "names": names,
        }


def grouped(revisions: Iterable[RevisionFiles], *, plain: bool = False) -> Iterator[EditionGroup]:
    """Yield the groups of revisions, whose names are different and sorted.

    Revisions whose arrays have the same axes, shapes and attributes share groups of at most `MOST_MEMBERS`. With
    `plain`, each group also has ``brdf``, f_r [1/sr] in float32, where numbers of another kind are tabulated.
    """
    waiting: dict[str, list[RevisionFiles]] = defaultdict(list)
    sizes: dict[str, int] = defaultdict(int)
    for revision in revisions:
        kind = _kind(revision)
        waiting[kind].append(revision)
        sizes[kind] += sum(map(len, revision.files.values()))
        if not kind or len(waiting[kind]) == MOST_MEMBERS or sizes[kind] > _MOST_BYTES:
            yield group_of(waiting.pop(kind), plain=plain)
            del sizes[kind]
        elif sum(sizes.values()) > _MOST_WAITING_BYTES:
            kind = max(sizes, key=sizes.__getitem__)
            yield group_of(waiting.pop(kind), plain=plain)
            del sizes[kind]
    for members in waiting.values():
        yield group_of(members, plain=plain)


def _kind(revision: RevisionFiles) -> str:
    """Return a digest that revisions share whose arrays can be stacked; empty for one that stands alone."""
    described = _described(revision)
    chunks = _main_chunks(revision)
    if described is None or len(chunks) != 1:
        return ""
    axes = [
        revision.manifest["files"][key]["sha256"]
        for name, array in described.items()
        if _dims(array) == [name]
        for key in revision.files
        if key.startswith(f"{name}/c")
    ]
    return sha256(json.dumps([described, axes]).encode())


def _described(revision: RevisionFiles) -> dict[str, Any] | None:
    """Return the metadata of the arrays of a revision; None if another program encoded them."""
    described: dict[str, Any] | None = (revision.metadata.get("consolidated_metadata") or {}).get("metadata")
    return None if described is None or not all(map(is_ours, described.values())) else described


def _main_chunks(revision: RevisionFiles) -> list[str]:
    """Return the paths of the chunks of the main variable, in their order; none if there is no such variable."""
    described = _described(revision) or {}
    variable = next((name for name in ("brdf", "parts") if name in described), None)
    if variable is None:
        return []
    rows = -(-described[variable]["shape"][0] // _chunk_shape(described[variable])[0])
    rest = ["0"] * (len(described[variable]["shape"]) - 1)
    return ["/".join([variable, "c", str(row), *rest]) for row in range(rows)]


def group_of(members: Sequence[RevisionFiles], *, plain: bool = False) -> EditionGroup:
    """Return the group of revisions of one kind."""
    if len(members) == 1:
        return _single(members[0], plain=plain)
    first = members[0]
    described = _described(first)
    assert described is not None
    chunk = _main_chunks(first)[0]
    variable = chunk.partition("/")[0]
    shard = "/".join([variable, "c", "0", *chunk.split("/")[2:]])
    count = len(members)
    places, content = _shard([member.files[chunk] for member in members])
    others = {shard: content, f"{variable}/{METADATA}": _sharded(described[variable], count, stacked=True)}
    names = _names(members)
    others |= {f"{MATERIAL}/{key}": data for key, data in names.items()}
    shared, stacks = _other_arrays(members, described, variable)
    others |= shared
    if plain and variable == "parts":
        others |= _plain(members)
    known, *more = [member.metadata["attributes"] for member in members]
    attributes = {key: value for key, value in known.items() if all(each.get(key) == value for each in more)}
    files = group_files(stacks, attributes, others)
    files[METADATA] = _with_note(files[METADATA], variable)
    records = encoded_records(members, shard, [{chunk: place} for place in places], files)
    return EditionGroup(files, records, members)


def _single(member: RevisionFiles, *, plain: bool) -> EditionGroup:
    """Return the group of a single revision: its files, with the chunks of the main variable in one shard."""
    files = dict(member.files)
    places: dict[str, Chunk] = {}
    chunks = _main_chunks(member)
    shard = ""
    if chunks:
        described = _described(member)
        assert described is not None
        shard = chunks[0]
        variable = shard.partition("/")[0]
        if len(chunks) == 1:
            places = {shard: Chunk(0, len(files[shard]))}
        else:
            found, content = _shard([files.pop(chunk) for chunk in chunks])
            places = dict(zip(chunks, found, strict=True))
            files[shard] = content
            files[f"{variable}/{METADATA}"] = _sharded(described[variable], len(chunks), stacked=False)
        # the metadata of small arrays stand in that of the group alone: a file less for each
        axes = {variable, *_dims(described[variable])}
        for name in described.keys() - axes:
            del files[f"{name}/{METADATA}"]
        if plain and variable == "parts":
            files |= _plain([member])
        files[METADATA] = _consolidated(member.metadata, files, described)
    return EditionGroup(files, encoded_records([member], shard, [places], files), [member])


def _consolidated(metadata: Mapping[str, Any], files: Mapping[str, bytes], described: Mapping[str, Any]) -> bytes:
    """Return the metadata of a group, with those of the arrays as its files have them."""
    arrays = {key.removesuffix(f"/{METADATA}"): json.loads(files[key]) for key in files if key.endswith(f"/{METADATA}")}
    inline = {**metadata["consolidated_metadata"], "metadata": {**described, **arrays}}
    return json.dumps({**metadata, "consolidated_metadata": inline}, allow_nan=False).encode()


def _chunk_shape(array: Mapping[str, Any]) -> list[int]:
    shape: list[int] = array["chunk_grid"]["configuration"]["chunk_shape"]
    return shape


def _dims(array: Mapping[str, Any]) -> list[str]:
    """Return the names of the dimensions of an array; a scalar has none."""
    dims: list[str] = array.get("dimension_names") or []
    return dims


def _shard(chunks: Sequence[bytes]) -> tuple[list[Chunk], bytes]:
    """Return the places of chunks in a shard, and the shard."""
    starts = itertools.accumulate(map(len, chunks), initial=0)
    places = [Chunk(start, len(chunk)) for start, chunk in zip(starts, chunks, strict=False)]  # the last start: the end
    return places, shard_bytes(chunks, len(chunks))


def _sharded(array: Mapping[str, Any], count: int, *, stacked: bool) -> bytes:
    """Return the metadata of an array whose chunks lie in a shard: `count` of them, one a member if `stacked`."""
    inner = _chunk_shape(array)
    codecs = {
        "chunk_shape": [1, *inner] if stacked else inner,
        "codecs": array["codecs"],
        "index_codecs": [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "crc32c"}],
        "index_location": "end",
    }
    outer = [count, *inner] if stacked else [count * inner[0], *inner[1:]]
    metadata = {
        **array,
        "shape": [count, *array["shape"]] if stacked else array["shape"],
        "dimension_names": [MATERIAL, *_dims(array)] if stacked else _dims(array),
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": outer}},
        "codecs": [{"name": "sharding_indexed", "configuration": codecs}],
    }
    return json.dumps(metadata, allow_nan=False).encode()


def _names(members: Sequence[RevisionFiles]) -> dict[str, bytes]:
    """Return the files of the coordinate with the names of the members."""
    files: dict[str, Any] = {}
    array = zarr.create_array(
        MemoryStore(files), shape=(len(members),), chunks=(len(members),), dtype=str, dimension_names=(MATERIAL,)
    )
    array[:] = np.array([member.name for member in members], dtype=object)
    return {key: data.to_bytes() for key, data in files.items()}


def _other_arrays(
    members: Sequence[RevisionFiles], described: Mapping[str, Any], variable: str
) -> tuple[dict[str, bytes], dict[str, StoredArray]]:
    """Return the files of arrays that all members share, and stacks of the others; with parameters and errors."""
    shared: dict[str, bytes] = {}
    stacks: dict[str, StoredArray] = {}
    first = members[0]
    for name, array in described.items():
        if name == variable:
            continue
        keys = [key for key in first.files if key.startswith(f"{name}/")]
        if all(member.manifest["files"][key] == first.manifest["files"][key] for member in members for key in keys):
            shared |= {key: first.files[key] for key in keys}
            continue
        values = np.stack([_values(member, name, array) for member in members])
        stacks[name] = StoredArray((MATERIAL, *_dims(array)), values, array["attributes"])
    known = [member.metadata["attributes"] for member in members]
    taken = {*described, MATERIAL}
    for parameter in known[0].get("parameters", {}):
        numbers = [attributes.get("parameters", {}).get(parameter) for attributes in known]
        if parameter not in taken and all(type(number) in (int, float) for number in numbers):
            stacks[parameter] = StoredArray(
                (MATERIAL,), np.array(numbers, float), {"long_name": f"parameter {parameter}"}
            )
    offsets = [(attributes.get("interpolation") or {}).get("offset") for attributes in known]
    if variable == "parts" and all(isinstance(offset, int | float) for offset in offsets):
        about = {"units": "sr-1", "long_name": "number that the reconstruction takes away from the exponential"}
        stacks["offset"] = StoredArray((MATERIAL,), np.array(offsets, float), about)
    errors = [member.manifest["summary"]["error_p99"] for member in members]
    values = np.array([np.nan if error is None else error for error in errors])
    about = {"units": "1", "long_name": "relative error that 99 of 100 values keep to"}
    stacks["error_p99"] = StoredArray((MATERIAL,), values, about)
    return shared, stacks


def _values(member: RevisionFiles, name: str, array: Mapping[str, Any]) -> NDArray[Any]:
    """Return a small array of a member."""
    document = {"consolidated_metadata": {"metadata": {name: array}}}
    stored = read_group(lambda key: json.dumps(document).encode() if key == METADATA else member.files[key])
    assert stored is not None
    return stored.arrays[name]


def _with_note(metadata: bytes, variable: str) -> bytes:
    """Return the metadata of a stack that says how f_r follows from its numbers."""
    document = json.loads(metadata)
    if variable == "parts" and "reconstruction" not in document["attributes"]:
        document["attributes"]["reconstruction"] = (
            "brdf = uniform + max(exp(parts @ spectra) - offset, 0) / (cos(theta_i) * cos(theta_r))**power, without "
            "the exponential where interpolation.logarithm is false; uniform, spectra and offset where they exist"
        )
    return json.dumps(document, allow_nan=False).encode()


def _plain(members: Sequence[RevisionFiles]) -> dict[str, bytes]:
    """Return the files of ``brdf``, f_r [1/sr] at the nodes, in float32."""
    import xarray as xr

    from brdfdb.tables.xarray_view import with_brdf

    chunks = []
    shape: tuple[int, ...] = ()
    dims: tuple[str, ...] = ()
    for member in members:
        stored = read_group(member.files.__getitem__)
        assert stored is not None
        arrays = {name: (stored.dims[name], values) for name, values in stored.arrays.items()}
        dataset = with_brdf(xr.Dataset(arrays, attrs=stored.attrs))
        brdf = dataset["brdf"]
        values = brdf.to_numpy()
        shape, dims = values.shape, tuple(map(str, brdf.dims))
        chunks.append(chunk_bytes(values, len(values)))
    _, content = _shard(chunks)
    described = _described(members[0])
    assert described is not None
    like = described["parts"]
    array = {
        **like,
        "shape": list(shape),
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(shape)}},
        "dimension_names": list(dims),
        "attributes": VARIABLES["brdf"],
    }
    stacked = len(members) > 1
    path = "/".join(["brdf", "c", *["0"] * (len(shape) + stacked)])
    return {path: content, f"brdf/{METADATA}": _sharded(array, len(members), stacked=stacked)}
