"""A store behind a service, read like one in a directory: `brdfdb.open("http://host:8000")`; standard library only."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NoReturn
from urllib.parse import quote, urlencode

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import array_lookup
from brdfdb.errors import (
    StoreError,
    UnknownMaterialError,
)
from brdfdb.geometry import (
    Directions,
    checked_angles,
    checked_vectors,
    degrees,
    finished,
    shape_of_angles,
    spherical_angles,
)
from brdfdb.materials.source import FourAngles
from brdfdb.parameters import Floats
from brdfdb.store.http_service import JSON, TIMEOUT_S, Service, TooLargeError
from brdfdb.store.paths import NAME, pinned
from brdfdb.tables.grids import Axis
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.table_base import BaseTable

if TYPE_CHECKING:
    import xarray as xr


# Limits of one request. Services and proxies accept them by default; an answer 413 halves them
_LIGHTS = ("1,0,0,0", "1,1,0,0", "1,0,1,0", "1,0,0,1")  # of which three are polarised: a matrix from its columns
_NPY_POINTS, _NPY_VALUES = 32_000, 2_000_000  # bodies of 1.02 MB, of which nginx takes 1.05; larger ones are no faster
_JSON_POINTS, _JSON_VALUES = 10_000, 200_000
_WAVELENGTHS = 200  # stand in the address, 33 bytes each; nginx cuts it at 8 kB


@dataclass(frozen=True, eq=False)
class RemoteTable(BaseTable):
    """The table of one revision of one material, looked up by a service; methods as of `Table`.

    Answers are those of the revision that it was opened with, also when the service has a newer one, or another store
    with the same numbers of revisions. A lookup raises StoreError if the service is gone, and UnknownRevisionError if
    that revision is.

    Attributes
    ----------
    name, revision, digest : str
        Name of the material, its revision, and the sha256 of its manifest, by which the service is asked.
    attrs : dict
        The attributes as stored, without the request of the build; `metadata` is the typed record of them.
    wavelength_nm : array (L,) [nm] or None
        Wavelengths of a spectral table; None for a grey one, which holds at any wavelength.
    """

    name: str
    revision: str
    digest: str
    attrs: Mapping[str, Any] = field(repr=False)
    wavelength_nm: Axis | None = field(repr=False)
    _axes_deg: Mapping[str, Axis] = field(repr=False)
    _anisotropic: bool = field(repr=False)
    _specular: bool = field(repr=False)
    _service: Service = field(repr=False)

    @property
    def axes_deg(self) -> Mapping[str, Axis]:
        """Nodes of the angular axes [degree] by name."""
        return self._axes_deg

    @property
    def anisotropic(self) -> bool:
        """True if the table has an axis for the azimuth of the surface."""
        return self._anisotropic

    def _at_angles(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        self._wavelengths(wavelength_nm)  # what is wrong is refused in the order of a table, before anything is sent
        shape_of_angles(*(np.asarray(angle) for angle in angles))
        given = checked_angles(*angles)
        return self._looked_up((given.theta_i, given.phi_i, given.theta_r, given.phi_r), given, wavelength_nm)

    @array_lookup
    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        self._wavelengths(wavelength_nm)
        given = checked_vectors(wi, wr)
        (theta_i, phi_i), (theta_r, phi_r) = spherical_angles(given.w_i), spherical_angles(given.w_r)
        return self._looked_up((theta_i, phi_i, theta_r, phi_r), given, wavelength_nm)

    @array_lookup
    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        count, tail = self._asked(wavelength_nm)
        given = checked_angles(theta_i, 0.0, 0.0, 0.0)
        values = np.zeros((given.theta_i.size, count))
        if self._specular and values.size:
            at = None if wavelength_nm is None else np.asarray(wavelength_nm, dtype=np.float64).tolist()
            theta = _sendable(given.theta_i).reshape(-1)

            def ask(part: slice) -> Any:
                body = {"theta_i": theta[part].tolist(), "theta_r": 0, "wavelength_nm": at}
                return self._service.document(f"{self._path}?format=json", body)["specular_reflectance"]

            _in_parts(ask, values, min(_JSON_POINTS, max(1, _JSON_VALUES // count)))
        return finished(values.reshape(given.theta_i.shape + tail), given, trailing=len(tail))

    def _mueller_at(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        """Return the Mueller BRDF [1/sr] from what the service reflects of four lights."""
        self._wavelengths(wavelength_nm)
        shape_of_angles(*(np.asarray(angle) for angle in angles))
        given = checked_angles(*angles)
        angles = (given.theta_i, given.phi_i, given.theta_r, given.phi_r)
        unpolarised, *polarised = (self._looked_up(angles, given, wavelength_nm, light) for light in _LIGHTS)
        return np.stack([unpolarised, *(reflected - unpolarised for reflected in polarised)], axis=-1)

    @property
    def _path(self) -> str:
        return f"/v1/materials/{self.name}/revisions/{pinned(self.revision, self.digest)}/lookup"

    def _asked(self, wavelength_nm: ArrayLike | None) -> tuple[int, tuple[int, ...]]:
        """Return the number of wavelengths of a request, and the shape that they add."""
        at = self._wavelengths(wavelength_nm)
        return at.size, at.tail

    def _looked_up(
        self, angles: Sequence[NDArray[Any]], given: Directions, wavelength_nm: ArrayLike | None, light: str = ""
    ) -> Floats:
        """Return f_r [1/sr] at checked angles [rad], those of the directions `given`; of a light, what is reflected."""
        count, tail = self._asked(wavelength_nm)
        if wavelength_nm is not None and count > _WAVELENGTHS:
            starts = range(_WAVELENGTHS, count, _WAVELENGTHS)
            parts = (
                self._looked_up(angles, given, part, light) for part in np.split(np.asarray(wavelength_nm), starts)
            )
            return np.concatenate(list(parts), axis=-2 if light else -1)
        shape = np.broadcast_shapes(*(angle.shape for angle in angles))
        flat = [np.broadcast_to(_sendable(angle), shape).reshape(-1) for angle in angles]
        elements = (4,) if light else ()
        values = np.empty((flat[0].size, count, *elements))
        if values.size:
            at = [] if wavelength_nm is None else np.ravel(np.asarray(wavelength_nm, dtype=np.float64)).tolist()
            query = [("format", "npy"), *(("wavelength_nm", one) for one in at)]
            query += [("stokes", light)] if light else []
            axes = (*(() if len(at) == 1 else tail), *elements)  # an address cannot tell a list of one from a number

            def ask(part: slice) -> Any:
                points = np.stack([angle[part] for angle in flat], axis=-1)
                if len(points) > 1:
                    return self._service.array(f"{self._path}?{urlencode(query)}", (len(points), *axes), points)
                # a service answers one point fastest if it stands in the address
                point = zip(("theta_i", "phi_i", "theta_r", "phi_r"), points[0].tolist(), strict=True)
                return self._service.array(f"{self._path}?{urlencode([*query, *point])}", axes)

            size = count * (16 if light else 1)  # values, as services count them
            _in_parts(ask, values, min(_NPY_POINTS, max(1, _NPY_VALUES // size)))
        tail = (*tail, *elements)
        return finished(values.reshape(shape + tail), given, trailing=len(tail))


class RemoteStore(Mapping[str, RemoteTable]):
    """A store behind a service: a mapping of names to tables, with the methods of `brdfdb.store.reader.Store`.

    Parameters
    ----------
    url : str
        Where ``brdfdb serve`` listens, such as ``http://127.0.0.1:8000``.
    timeout_s : float
        For each step of an exchange: to connect, to send, to receive [s].

    Raises
    ------
    ValueError
        If `url` is not an address, or `timeout_s` out of range.
    StoreError
        If no service answers there, or it cannot read its store; later the same.
    """

    def __init__(self, url: str, timeout_s: float = TIMEOUT_S) -> None:
        self._service = Service(url, timeout_s)
        self.url = self._service.url
        try:
            len(self)
        except (StoreError, UnknownMaterialError):
            service, inside, _ = f"{self.url}/".partition("/v1/")
            if inside:
                raise StoreError(f"{self.url} lies in the service at {service}; name that address") from None
            raise

    def __iter__(self) -> Iterator[str]:
        return iter([line["name"] for line in self._lines()])

    def __len__(self) -> int:
        count = self._service.document("/readyz").get("materials")
        if not isinstance(count, int):
            raise self._service.stranger()
        return count

    def __contains__(self, name: object) -> bool:
        if not isinstance(name, str) or not NAME.fullmatch(name):
            return False
        return any(line["name"] == name for line in self._lines(name))

    def __getitem__(self, name: str) -> RemoteTable:
        return self._table(self._material(name))

    def table(self, name: str, revision: str) -> RemoteTable:
        """Return the table of a revision, current or not; errors are those of `Store.table`."""
        return self._table(self._material(name, f"/revisions/{quote(revision, safe='')}"))

    def revisions(self, name: str) -> list[str]:
        """Return the revisions of a material that are whole, oldest first."""
        return [str(revision) for revision in self._material(name)["revisions"]]

    def head(self, name: str) -> str:
        """Return the current revision of a material, such as ``r000003``; each call asks the service."""
        return str(self._material(name)["revision"])

    def summary(self, name: str) -> Mapping[str, Any]:
        """Return what lists show of the current revision: title, model, error_p99, created, bytes and more.

        Raises
        ------
        UnknownMaterialError
            If the store has no such material.
        """
        for line in self._lines(name) if NAME.fullmatch(name) else ():
            if line["name"] == name:
                return line
        raise UnknownMaterialError(name, list(self))

    def metadata(self, name: str) -> TableMetadata:
        """Return the metadata of the current revision; of the request of its build nothing."""
        return self[name].metadata

    def dataset(self, name: str, revision: str | None = None) -> xr.Dataset:
        """Return a revision, by default the current one, as a lazy Dataset that is read over HTTP as far as needed.

        Each file is checked against the manifest of the revision. Errors are those of `Store.dataset`. StoreError, too,
        if fsspec and aiohttp, which read zarr over HTTP, are not installed.
        """
        document = self._material(name, "" if revision is None else f"/revisions/{quote(revision, safe='')}")
        if find_spec("fsspec") is None or find_spec("aiohttp") is None:
            raise StoreError("a dataset over HTTP needs fsspec and aiohttp: pip install 'brdfdb[http]'")
        from brdfdb.store.zarr_store import WholeRemote
        from brdfdb.tables.xarray_view import opened

        where = f"{name} {document['revision']} of {self.url}"
        path = f"/v1/store/materials/{name}/{pinned(document['revision'], document['digest'])}"
        content = self._service.content(f"{path}.MANIFEST.json", None, JSON)
        if hashlib.sha256(content).hexdigest() != document["digest"]:
            raise StoreError(f"{where}: its manifest is another one, as of a cache between here and the service")
        return opened(WholeRemote(f"{self.url}{path}", where, json.loads(content)["files"]))

    def families(self) -> NoReturn:
        """Raise StoreError: families of a service are not read in Python."""
        raise StoreError(f"{self.url} has families for POST requests alone; open the directory of the store for those")

    def family(self, name: str) -> NoReturn:  # noqa: ARG002  # as a Store is asked
        """Raise StoreError: families of a service are not read in Python."""
        self.families()

    def _lines(self, words: str = "") -> Iterator[dict[str, Any]]:
        """Yield the lines of the catalogue, page after page; with `words` those that contain them."""
        path: str | None = f"/v1/materials?{urlencode({'q': words})}"
        while path is not None:
            page = self._service.document(path)
            yield from page["materials"]
            path = page["next"]

    def _material(self, name: str, revision: str = "") -> dict[str, Any]:
        if not NAME.fullmatch(name):
            raise UnknownMaterialError(name, list(self))
        return self._service.document(f"/v1/materials/{name}{revision}")

    def _table(self, document: dict[str, Any]) -> RemoteTable:
        error, wavelengths = document["error"], document["wavelength_nm"]
        return RemoteTable(
            name=document["name"],
            revision=document["revision"],
            digest=document["digest"],
            attrs=document["attributes"] if error is None else {**document["attributes"], "error": error},
            _axes_deg={axis: np.array(nodes) for axis, nodes in document["axes_deg"].items()},
            wavelength_nm=None if wavelengths is None else np.array(wavelengths),
            _anisotropic=document["anisotropic"],
            _specular=document["specular"],
            _service=self._service,
        )


def _sendable(angle: NDArray[Any]) -> NDArray[np.float64]:
    """Return angles in degrees for a service: azimuths within one turn, and 0 for nan, which is put back later."""
    known = np.nan_to_num(angle.astype(np.float64), nan=0.0)
    # azimuths of many turns would lose digits in degrees
    return degrees(np.where(np.abs(known) > np.pi, np.arctan2(np.sin(known), np.cos(known)), known))


def _in_parts(ask: Callable[[slice], Any], values: NDArray[np.float64], step: int) -> None:
    """Fill the rows of `values` with what `ask` answers, `step` rows at a time, or fewer if the service wants it."""
    start = 0
    while start < len(values):
        rows = values[start : start + step]
        try:
            rows[:] = np.reshape(ask(slice(start, start + step)), rows.shape)
        except TooLargeError:
            if len(rows) == 1:
                raise
            step = len(rows) // 2
        else:
            start += step
