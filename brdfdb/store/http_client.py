"""A store behind a service, read like one in a directory: `brdfdb.open("http://host:8000")`; standard library only."""

from __future__ import annotations

import functools
import hashlib
import http.client
import io
import json
import os
import re
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn
from urllib.parse import quote, urlencode, urlsplit, urlunsplit

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import array_lookup
from brdfdb.errors import (
    NoServiceError,
    ParameterError,
    StoreError,
    UnknownMaterialError,
    UnknownRevisionError,
    install_command,
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
from brdfdb.measurements.glints import Glints
from brdfdb.parameters import Floats
from brdfdb.store.paths import NAME, pinned
from brdfdb.tables.grids import Axis
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.table_base import BaseTable

if TYPE_CHECKING:
    import xarray as xr

TIMEOUT_S = 60.0  # for each step of an exchange: to connect, to send, to receive
PATIENCE_S = 20.0  # in total, for a busy service that says when to ask again; to mend a store takes longer

NPY = "application/x-npy"
JSON = "application/json"

_LIGHTS = ("1,0,0,0", "1,1,0,0", "1,0,1,0", "1,0,0,1")  # the last three are polarised: a matrix from its columns
# Limits of one request. Services and proxies accept them by default; an answer 413 halves them
_NPY_POINTS = 32_000  # bodies of 1.02 MB, of which nginx takes 1.05; larger ones are no faster
_NPY_VALUES = 2_000_000
_JSON_POINTS = 10_000
_JSON_VALUES = 200_000
_WAVELENGTHS = 200  # in the address, 33 bytes each; nginx cuts it at 8 kB


# Exchanges with a service


class TooLargeError(StoreError):
    """A request that is larger than the service, or a proxy before it, accepts."""


class _Answer(NamedTuple):
    """A complete answer of a service."""

    response: http.client.HTTPResponse
    content: bytes


class Fetched(NamedTuple):
    """The status of an answer, its bytes, and where it redirects to."""

    status: int
    content: bytes
    location: str


class Service:
    """HTTP to one service: a connection for each thread, kept open from one request to the next.

    `url` is ``http://`` or ``https://``, host, port, and a path if the service is not at the root; `timeout_s` is for
    each step of an exchange [s]. ParameterError says that either is wrong.
    """

    def __init__(self, url: str, timeout_s: float = TIMEOUT_S) -> None:
        try:
            split = urlsplit(url)
            host = split.hostname
            port = split.port
        except ValueError as error:
            raise ParameterError("url", f"{url!r} is not an address: {error}", url) from None
        if split.scheme not in ("http", "https") or not host or "@" in split.netloc or split.query or split.fragment:
            raise ParameterError("url", f"{url!r} is not an address such as http://127.0.0.1:8000", url)
        if not re.fullmatch("[!-~]+", url):
            raise ParameterError(
                "url", f"{url!r} is not an address: it contains spaces or characters outside ASCII", url
            )
        if not 0.0 < timeout_s <= threading.TIMEOUT_MAX:
            raise ParameterError(
                "timeout_s",
                f"{timeout_s:g} is outside (0, {threading.TIMEOUT_MAX:g}] s",
                timeout_s,
                (0.0, threading.TIMEOUT_MAX),
            )
        self._path = split.path.rstrip("/")
        self.timeout_s = timeout_s
        self.url = urlunsplit((split.scheme, split.netloc, self._path, "", ""))
        self._kind = http.client.HTTPSConnection if split.scheme == "https" else http.client.HTTPConnection
        self._host = host
        self._port = port or self._kind.default_port  # without a port, ::1 is read as port 1
        self._local = threading.local()

    def __reduce__(self) -> tuple[type[Service], tuple[str, float]]:
        return Service, (self.url, self.timeout_s)

    def document(self, path: str, body: Any = None) -> dict[str, Any]:
        """Return the JSON object at a path below the service, or its answer to a JSON body; errors as by `content`."""
        answer = self.content(path, None if body is None else json.dumps(body).encode(), JSON)
        try:
            content = json.loads(answer)
        except ValueError:
            content = None
        if not isinstance(content, dict):
            raise self.stranger()
        return content

    def array(self, path: str, shape: tuple[int, ...], points: NDArray[Any] | None = None) -> NDArray[np.float64]:
        """Return the array of `shape` at a path, or its answer to an array of points; errors as by `content`."""
        buffer = io.BytesIO()
        if points is not None:
            np.save(buffer, points, allow_pickle=False)
        answer = self.content(path, None if points is None else buffer.getvalue(), NPY)
        try:
            content = np.lib.format.read_array(io.BytesIO(answer), allow_pickle=False)
        except Exception:  # a header is Python text: what reading it raises is of many kinds
            raise self.stranger() from None
        if content.shape != shape or content.dtype != np.float64:
            raise self.stranger()
        return content

    def stranger(self) -> NoServiceError:
        """Return the error for an address where something else answers, such as the login page of a network."""
        return NoServiceError(f"{self.url} is not a brdfdb service")

    def content(self, path: str, body: bytes | None, media: str) -> bytes:
        """Return the bytes of an answer.

        If the service is busy for a short time that it names, ask again after that time. StoreError says that no
        service answers, that it cannot read its store, or that it fails; errors of the store itself are raised as it
        raised them.
        """
        end = time.monotonic() + min(self.timeout_s, PATIENCE_S)
        headers = {"Accept": media} if body is None else {"Accept": media, "Content-Type": media}
        while True:
            response, answer = self._exchanged(path, body, headers)
            wait = response.getheader("Retry-After", "") if response.status == 503 else ""
            if not wait.isdecimal() or time.monotonic() + int(wait) > end:
                break
            time.sleep(int(wait))
        status = response.status
        location = response.getheader("Location")
        if status == 200:
            return answer
        if 300 <= status < 400 and location is not None:
            source, target = (address.partition("?")[0] for address in (path, location))
            raise StoreError(f"{self.url} redirects {source} to {target}; open the address that the service itself has")
        try:
            problem = json.loads(answer)
            detail = str(problem["detail"])
        except (ValueError, TypeError, KeyError):  # the page of a proxy
            problem = {}
            detail = ""
        if status == 404 and not problem:
            raise self.stranger()
        if status == 404 and "closest" in problem:
            raise UnknownMaterialError(path.partition("/materials/")[2].partition("/")[0] or path, problem["closest"])
        if status == 404 and problem.get("parameter") == "revision":
            raise UnknownRevisionError(detail)
        if status == 422 and isinstance(parameter := problem.get("parameter"), str):
            raise ParameterError(parameter, detail.removeprefix(f"{parameter}: "))
        if status == 503 and detail:
            raise StoreError(detail)
        why = f": {detail}" if detail else " without a reason"
        sentence = f"{self.url} answered {status} {response.reason}".rstrip() + why
        raise TooLargeError(sentence) if status == 413 else StoreError(sentence)

    def fetched(self, path: str, headers: Mapping[str, str]) -> Fetched:
        """Return the answer of a web server to the request of a file; StoreError that no server answers."""
        response, answer = self._exchanged(path, None, headers)
        return Fetched(response.status, answer, response.getheader("Location", ""))

    def _exchanged(self, path: str, body: bytes | None, headers: Mapping[str, str]) -> _Answer:
        request = ("GET" if body is None else "POST", self._path + path, body, headers)
        own: _Connection | None = getattr(self._local, "connection", None)
        if own is None or own.process != os.getpid():  # a forked process does not share the connection of its parent
            own = self._local.connection = _Connection(self._kind(self._host, self._port, timeout=self.timeout_s))
        connection = own.connection
        try:
            if connection.sock is not None:
                with suppress(ConnectionError):
                    return _exchange(connection, *request)
                connection.close()  # the server had closed it in between: once more, on a new one
            connection.connect()
            return _exchange(connection, *request)
        except (OSError, UnicodeError, http.client.HTTPException) as error:
            connection.close()
            why = getattr(error, "strerror", None) or str(error).strip() or type(error).__name__
            raise StoreError(f"no answer from {self.url}: {why}") from error
        except BaseException:
            connection.close()  # the rest of this answer must not be read as the next one
            raise


class _Connection:
    """A connection and the process that made it; closed when its thread or the last user of the service ends."""

    def __init__(self, connection: http.client.HTTPConnection) -> None:
        self.connection = connection
        self.process = os.getpid()
        # not __del__: in a cycle the socket may be collected first, and warn
        weakref.finalize(self, connection.close)


def _exchange(
    connection: http.client.HTTPConnection, method: str, address: str, body: bytes | None, headers: Mapping[str, str]
) -> _Answer:
    """Send a request on an open connection, and read its answer."""
    sent = False
    with suppress(OSError):  # a server that refuses a body may answer and close before all of it is sent
        connection.request(method, address, body, headers)
        sent = True
    response = connection.getresponse()
    answer = response.read()
    if not sent:
        connection.close()  # the rest of this body is not the next request
    return _Answer(response, answer)


# The store behind a service


@dataclass(frozen=True, eq=False)
class RemoteTable(BaseTable):
    """The table of one revision of one material, looked up by a service; methods as of `Table`.

    Answers are those of the revision that it was opened with, also when the service has a newer one, or another store
    with the same numbers of revisions. A lookup raises StoreError if the service is gone, and UnknownRevisionError if
    that revision is. `attrs` are the stored attributes without the request of the build; `wavelength_nm` is None for a
    grey table, which has the same values at any wavelength.
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

    @functools.cached_property
    def glints(self) -> Glints | None:  # type: ignore[override]
        """The peaks of f_r that the values of the service have in them; None without any."""
        measured = self.metadata.known_measured()
        return None if measured is None else measured.glints

    def _at_angles(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        self._wavelengths(wavelength_nm)  # checked first, as by a table, before anything is sent
        shape_of_angles(*(np.asarray(angle) for angle in angles))
        given = checked_angles(*angles)
        return self._looked_up((given.theta_i, given.phi_i, given.theta_r, given.phi_r), given, wavelength_nm)

    @array_lookup
    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        self._wavelengths(wavelength_nm)
        given = checked_vectors(wi, wr)
        return self._looked_up((*spherical_angles(given.w_i), *spherical_angles(given.w_r)), given, wavelength_nm)

    @array_lookup
    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        wavelengths = self._wavelengths(wavelength_nm)
        given = checked_angles(theta_i, 0.0, 0.0, 0.0)
        values = np.zeros((given.theta_i.size, wavelengths.size))
        if self._specular and values.size:
            at = None if wavelength_nm is None else np.asarray(wavelength_nm, dtype=np.float64).tolist()
            theta = _sendable(given.theta_i).reshape(-1)

            def ask(part: slice) -> Any:
                body = {"theta_i": theta[part].tolist(), "theta_r": 0, "wavelength_nm": at}
                return self._service.document(f"{self._path}?format=json", body)["specular_reflectance"]

            _in_parts(ask, values, min(_JSON_POINTS, max(1, _JSON_VALUES // wavelengths.size)))
        shape = given.theta_i.shape + wavelengths.tail
        return finished(values.reshape(shape), given, trailing=len(wavelengths.tail))

    def _mueller_at(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        """Return the Mueller BRDF [1/sr] from the reflected Stokes vectors of four lights."""
        self._wavelengths(wavelength_nm)
        shape_of_angles(*(np.asarray(angle) for angle in angles))
        given = checked_angles(*angles)
        angles = (given.theta_i, given.phi_i, given.theta_r, given.phi_r)
        unpolarised, *polarised = (self._looked_up(angles, given, wavelength_nm, light) for light in _LIGHTS)
        return np.stack([unpolarised, *(reflected - unpolarised for reflected in polarised)], axis=-1)

    @property
    def _path(self) -> str:
        return f"/v1/materials/{self.name}/revisions/{pinned(self.revision, self.digest)}/lookup"

    def _looked_up(
        self, angles: Sequence[NDArray[Any]], given: Directions, wavelength_nm: ArrayLike | None, light: str = ""
    ) -> Floats:
        """Return f_r [1/sr] at checked angles [rad] of `given`; for a polarised light, the reflected Stokes vector."""
        wavelengths = self._wavelengths(wavelength_nm)
        count = wavelengths.size
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
            axes = (
                *(() if len(at) == 1 else wavelengths.tail),
                *elements,
            )  # in an address, a list of one number looks like a number

            def ask(part: slice) -> Any:
                points = np.stack([angle[part] for angle in flat], axis=-1)
                if len(points) > 1:
                    return self._service.array(f"{self._path}?{urlencode(query)}", (len(points), *axes), points)
                # a service answers one point fastest if it stands in the address
                point = zip(("theta_i", "phi_i", "theta_r", "phi_r"), points[0].tolist(), strict=True)
                return self._service.array(f"{self._path}?{urlencode([*query, *point])}", axes)

            size = count * (16 if light else 1)  # values, as services count them
            _in_parts(ask, values, min(_NPY_POINTS, max(1, _NPY_VALUES // size)))
        tail = (*wavelengths.tail, *elements)
        return finished(values.reshape(shape + tail), given, trailing=len(tail))


class RemoteStore(Mapping[str, RemoteTable]):
    """A store behind a service: a mapping of names to tables, with the methods of `brdfdb.store.reader.Store`.

    `url` is where ``brdfdb serve`` listens, such as ``http://127.0.0.1:8000``; `timeout_s` is for each step of an
    exchange: to connect, to send, to receive [s]. ParameterError says that either is wrong; StoreError, also later,
    that no service answers, or that it cannot read its store.
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
        """Return the complete revisions of a material, oldest first."""
        return [str(revision) for revision in self._material(name)["revisions"]]

    def head(self, name: str) -> str:
        """Return the current revision of a material, such as ``r000003``; each call asks the service."""
        return str(self._material(name)["revision"])

    def summary(self, name: str) -> Mapping[str, Any]:
        """Return what lists show of the current revision: title, model, error_p99, created, bytes and more."""
        for line in self._lines(name) if NAME.fullmatch(name) else ():
            if line["name"] == name:
                return line
        raise UnknownMaterialError(name, list(self))

    def metadata(self, name: str) -> TableMetadata:
        """Return the metadata of the current revision, without the request of its build."""
        return self[name].metadata

    def dataset(self, name: str, revision: str | None = None) -> xr.Dataset:
        """Return a revision, by default the current one, as a lazy Dataset that is read over HTTP as far as needed.

        Each file is checked against the manifest of the revision. Errors are those of `Store.dataset`; StoreError also
        says that fsspec and aiohttp, which read zarr over HTTP, are not installed.
        """
        document = self._material(name, "" if revision is None else f"/revisions/{quote(revision, safe='')}")
        if find_spec("fsspec") is None or find_spec("aiohttp") is None:
            raise StoreError(f"a dataset over HTTP needs fsspec and aiohttp: {install_command('http')}")
        from brdfdb.store.zarr_store import CheckedRemoteRevision
        from brdfdb.tables.xarray_view import opened

        where = f"{name} {document['revision']} of {self.url}"
        path = f"/v1/store/materials/{name}/{pinned(document['revision'], document['digest'])}"
        content = self._service.content(f"{path}.MANIFEST.json", None, JSON)
        if hashlib.sha256(content).hexdigest() != document["digest"]:
            raise StoreError(f"{where}: its manifest is another one, as of a cache between here and the service")
        return opened(CheckedRemoteRevision(f"{self.url}{path}", where, json.loads(content)["files"]))

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
        error = document["error"]
        wavelengths = document["wavelength_nm"]
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
    """Fill the rows of `values` with answers, `step` rows at a time, or fewer if the service asks for that."""
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
