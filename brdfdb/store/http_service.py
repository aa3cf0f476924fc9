"""Exchanges with a service over HTTP; standard library only."""

from __future__ import annotations

import http.client
import io
import json
import os
import re
import threading
import time
import weakref
from collections.abc import Mapping
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit, urlunsplit

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import (
    ParameterError,
    StoreError,
    UnknownMaterialError,
    UnknownRevisionError,
)

TIMEOUT_S = 60.0  # for each step of an exchange: to connect, to send, to receive
PATIENCE_S = 20.0  # in all, for a service that is busy and says when to ask again; to mend a store takes longer

NPY = "application/x-npy"
JSON = "application/json"


class TooLargeError(StoreError):
    """More than the service, or a proxy before it, takes at once."""


class Service:
    """HTTP to one service: a connection for each thread, kept open from one request to the next.

    Parameters
    ----------
    url : str
        ``http://`` or ``https://``, host, port, and a path if the service is not at the root.
    timeout_s : float
        For each step of an exchange [s].

    Raises
    ------
    ValueError
        If `url` is not such an address, or `timeout_s` out of range.
    """

    def __init__(self, url: str, timeout_s: float = TIMEOUT_S) -> None:
        try:
            split = urlsplit(url)
            host, port = split.hostname, split.port
        except ValueError as error:
            raise ParameterError("url", f"{url!r} is not an address: {error}", url) from None
        if split.scheme not in ("http", "https") or not host or "@" in split.netloc or split.query or split.fragment:
            raise ParameterError("url", f"{url!r} is not an address such as http://127.0.0.1:8000", url)
        if not re.fullmatch("[!-~]+", url):
            raise ParameterError(
                "url", f"{url!r} is not an address: it has characters other than those of ASCII, or spaces", url
            )
        if not 0.0 < timeout_s <= threading.TIMEOUT_MAX:
            raise ParameterError(
                "timeout_s",
                f"{timeout_s:g} is outside (0, {threading.TIMEOUT_MAX:g}] s",
                timeout_s,
                (0.0, threading.TIMEOUT_MAX),
            )
        self._path, self.timeout_s = split.path.rstrip("/"), timeout_s
        self.url = urlunsplit((split.scheme, split.netloc, self._path, "", ""))
        self._kind = http.client.HTTPSConnection if split.scheme == "https" else http.client.HTTPConnection
        self._host, self._port = host, port or self._kind.default_port  # without one, ::1 is read as port 1
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

    def stranger(self) -> StoreError:
        """Return the error for an address where something else answers, such as the login page of a network."""
        return StoreError(f"{self.url} is no service of brdfdb")

    def content(self, path: str, body: bytes | None, media: str) -> bytes:
        """Return the bytes of an answer.

        Raises
        ------
        StoreError
            If there is no service at the address, it cannot read its store, or it fails.
        UnknownMaterialError, UnknownRevisionError, ParameterError
            As the store itself raises them.
        """
        response, answer = self._answer(path, body, media)
        status, location = response.status, response.getheader("Location")
        if status == 200:
            return answer
        if 300 <= status < 400 and location is not None:
            source, target = (address.partition("?")[0] for address in (path, location))
            raise StoreError(f"{self.url} redirects {source} to {target}; open the address that the service itself has")
        try:
            problem = json.loads(answer)
            detail = str(problem["detail"])
        except (ValueError, TypeError, KeyError):  # the page of a proxy
            problem, detail = {}, ""
        if status == 404 and "closest" in problem:
            raise UnknownMaterialError(path.partition("/materials/")[2].partition("/")[0] or path, problem["closest"])
        if status == 404 and problem.get("parameter") == "revision":
            raise UnknownRevisionError(detail)
        if status == 422 and isinstance(parameter := problem.get("parameter"), str):
            raise ParameterError(parameter, detail.removeprefix(f"{parameter}: "))
        if status == 503 and detail:
            raise StoreError(detail)
        why = f": {detail}" if detail else ", and does not say why"
        sentence = f"{self.url} answered {status} {response.reason}".rstrip() + why
        raise TooLargeError(sentence) if status == 413 else StoreError(sentence)

    def _answer(self, path: str, body: bytes | None, media: str) -> tuple[http.client.HTTPResponse, bytes]:
        """Return a whole answer, and its bytes; one that names a short wait is asked for again after it."""
        end = time.monotonic() + min(self.timeout_s, PATIENCE_S)
        while True:
            response, answer = self._exchanged(path, body, media)
            wait = response.getheader("Retry-After", "") if response.status == 503 else ""
            if not wait.isdecimal() or time.monotonic() + int(wait) > end:
                return response, answer
            time.sleep(int(wait))

    def _exchanged(self, path: str, body: bytes | None, media: str) -> tuple[http.client.HTTPResponse, bytes]:
        headers = {"Accept": media} if body is None else {"Accept": media, "Content-Type": media}
        request = ("GET" if body is None else "POST", self._path + path, body, headers)
        connection = self._connection()
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

    def _connection(self) -> http.client.HTTPConnection:
        """Return the connection of this thread, open or not; a forked process does not share that of its parent."""
        held: _Held | None = getattr(self._local, "held", None)
        if held is None or held.process != os.getpid():
            held = self._local.held = _Held(self._kind(self._host, self._port, timeout=self.timeout_s))
        return held.connection


class _Held:
    """A connection and the process that made it; closed with its thread, or when nobody holds the service any more."""

    def __init__(self, connection: http.client.HTTPConnection) -> None:
        self.connection, self.process = connection, os.getpid()
        # not __del__: in a cycle the socket may be collected first, and warn
        weakref.finalize(self, connection.close)


def _exchange(
    connection: http.client.HTTPConnection, method: str, address: str, body: bytes | None, headers: Mapping[str, str]
) -> tuple[http.client.HTTPResponse, bytes]:
    """Send a request on an open connection, and read all of its answer."""
    sent = False
    with suppress(OSError):  # who refuses a body may answer, and close or read no more, before all of it is sent
        connection.request(method, address, body, headers)
        sent = True
    response = connection.getresponse()
    answer = response.read()
    if not sent:
        connection.close()  # the rest of this body is not the next request
    return response, answer
