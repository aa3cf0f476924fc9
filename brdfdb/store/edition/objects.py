"""Objects by key: in a directory, in a bucket (obstore), or behind a web server, which is only read."""

from __future__ import annotations

import hashlib
import http.client
import os
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from brdfdb.errors import ParameterError, StoreError, import_extra
from brdfdb.place import is_bucket, is_service, path_of
from brdfdb.store.files import NON_BLOCKING, regular_bytes, sync_path, write_file
from brdfdb.store.http_client import Service

try:
    import fcntl
except ModuleNotFoundError:  # Windows
    fcntl = None  # type: ignore[assignment]

_AT_ONCE = 16  # objects that are written at the same time
_TRIES = 4  # of a request that fails or ends early
_BUCKET_S = 30.0  # longest time of the tries in a bucket
_OF_CLIENT = re.compile(  # options of obstore for HTTP, among those of a store
    "(?:aws_|azure_|google_)?(allow_.*|(?:connect_)?timeout|default_content_type|default_headers|http[12]_.*|pool_.*|"
    "proxy_.*|randomize_addresses|user_agent)"
)
_CREDENTIALS = {  # variables of the environment: how they begin, and those that obstore needs
    "s3": ("AWS", "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"),
    "gs": ("GOOGLE", "GOOGLE_APPLICATION_CREDENTIALS"),
    "az": ("AZURE", "AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY"),
}
_WAIT_S = 0.1  # before the second try; doubled before each later one


class MissingObjectError(StoreError):
    """An object that does not exist."""


class ChangedRootError(StoreError):
    """A root that another publisher has swapped."""


class Versioned(NamedTuple):
    """The content of an object, and what a conditional write of it compares; None where there is no object."""

    content: bytes | None
    version: Any


class Objects(Protocol):
    """Immutable objects by key, and a root that is swapped. Errors are StoreError; keys contain no `..`."""

    @property
    def name(self) -> str:
        """The place, as users name it."""
        ...

    def get(self, key: str, start: int = 0, size: int | None = None) -> bytes:
        """Return an object, or `size` bytes of it from `start`; MissingObjectError if there is none."""
        ...

    def has(self, key: str) -> bool:
        """Return True if there is an object."""
        ...

    def put(self, contents: Mapping[str, bytes]) -> None:
        """Write objects by key, each complete or not at all; afterwards they outlast a power cut."""
        ...

    def versioned(self, key: str) -> Versioned:
        """Return an object for a later `swap`."""
        ...

    def swap(self, key: str, content: bytes, expected: Versioned) -> None:
        """Replace an object that is still the expected one; ChangedRootError if it is another."""
        ...


def objects_at(place: str | Path, storage_options: Mapping[str, Any] | None = None) -> Objects:
    """Return the objects at a place: a path, ``s3://bucket/prefix``, ``gs://``, ``az://``, or ``https://``, read only.

    `storage_options` are those of obstore, such as ``endpoint`` and ``region`` of S3, and of its client, such as
    ``timeout``; by default it reads the variables of the environment, such as ``AWS_ENDPOINT_URL``. ParameterError says
    that the place is of none of these kinds, or names the option that is wrong.
    """
    if is_bucket(place):
        return _Bucket(place.rstrip("/"), storage_options)
    if storage_options:
        raise ParameterError("storage_options", f"{str(place)!r} takes none; they are for s3://, gs:// and az://")
    return _Web(place) if is_service(place) else _Directory(path_of(place, "place").absolute())


class _Directory:
    """Objects in a directory, as files."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self.name = str(root)

    def get(self, key: str, start: int = 0, size: int | None = None) -> bytes:
        try:
            if size is None:
                return regular_bytes(self._root / key)[start:]
            with open(os.open(self._root / key, os.O_RDONLY | NON_BLOCKING), "rb") as file:
                file.seek(start)
                return file.read(size)
        except (FileNotFoundError, NotADirectoryError):
            raise MissingObjectError(f"{self.name} is damaged: {key} is missing") from None
        except OSError as error:
            raise StoreError(f"{self.name}: {key} cannot be read: {error.strerror}") from error

    def has(self, key: str) -> bool:
        return (self._root / key).is_file()

    def put(self, contents: Mapping[str, bytes]) -> None:
        _at_once(self._write, contents.keys(), contents.values())
        folders = {folder for key in contents for folder in (self._root / key).parents}
        _at_once(sync_path, folders.difference(self._root.parents))

    def _write(self, key: str, content: bytes) -> None:
        path = self._root / key
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_file(path, content, path.parent)
        except OSError as error:
            raise StoreError(f"cannot write {key} to {self.name}: {error.strerror}") from error

    def versioned(self, key: str) -> Versioned:
        try:
            content = self.get(key)
        except MissingObjectError:
            return Versioned(None, None)
        return Versioned(content, None)

    def swap(self, key: str, content: bytes, expected: Versioned) -> None:
        if fcntl is None:
            raise StoreError(f"cannot write to {self.name}: this system has no file locks; use Linux or macOS")
        try:
            self._root.mkdir(parents=True, exist_ok=True)
            with (self._root / f".{key}.lock").open("wb") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                if self.versioned(key).content != expected.content:
                    raise _swapped(self.name)
                self.put({key: content})
        except OSError as error:
            raise StoreError(f"cannot write {key} to {self.name}: {error.strerror}") from error


class _Web:
    """Objects behind a web server, read by the standard library; a server without ranges sends complete objects."""

    def __init__(self, url: str) -> None:
        self._service = Service(url)
        self.name = self._service.url

    def get(self, key: str, start: int = 0, size: int | None = None) -> bytes:
        headers = {} if size is None else {"Range": f"bytes={start}-{start + size - 1}"}
        wait = _WAIT_S
        for number in range(_TRIES):
            last = number == _TRIES - 1
            try:
                status, content, location = self._service.fetched(f"/{key}", headers)
            except StoreError as error:
                if last or not isinstance(error.__cause__, http.client.HTTPException | ConnectionError):
                    raise
            else:
                if status in (404, 410):
                    raise MissingObjectError(f"{self.name} has no {key}")
                if status == 206 and size is not None:
                    return content
                if status == 200:
                    return content[start:] if size is None else content[start : start + size]
                if location:
                    raise StoreError(f"{self.name} redirects {key} to {location}; open the address that has the files")
                if last or status not in (429, 500, 502, 503, 504):
                    raise StoreError(f"{self.name} answered {status} for {key}")
            time.sleep(wait)
            wait *= 2.0
        raise AssertionError("unreachable")

    def has(self, key: str) -> bool:  # noqa: ARG002
        raise self._read_only()

    def put(self, contents: Mapping[str, bytes]) -> None:  # noqa: ARG002
        raise self._read_only()

    def versioned(self, key: str) -> Versioned:  # noqa: ARG002
        raise self._read_only()

    def swap(self, key: str, content: bytes, expected: Versioned) -> None:  # noqa: ARG002
        raise self._read_only()

    def _read_only(self) -> ParameterError:
        return ParameterError("place", f"{self.name} is only read; write to a directory, s3:// or gs://", self.name)


class _Bucket:
    """Objects in a bucket, by obstore."""

    _process = 0  # the first that used obstore, whose threads a child by fork has not: it would wait for ever

    def __init__(self, url: str, storage_options: Mapping[str, Any] | None) -> None:
        import_extra("obstore")
        import obstore
        import obstore.store

        self._obstore = obstore
        self._errors = (obstore.exceptions.BaseError, OSError, ValueError)
        _Bucket._process = _Bucket._process or os.getpid()
        self.name = url
        self._options = storage_options
        options = dict(storage_options or {})
        try:
            self._store = _from_url(url, options)
        except ValueError as error:
            for name in options:  # without the option that is wrong there is no error
                with suppress(ValueError):
                    _from_url(url, {each: value for each, value in options.items() if each != name})
                    wrong = ParameterError("storage_options", f"{name}: {_first_line(error)}", name)
                    break
            else:
                wrong = ParameterError("place", f"{url!r}: {_first_line(error)}", url)
            raise wrong from error

    def __reduce__(self) -> tuple[type[_Bucket], tuple[str, Mapping[str, Any] | None]]:
        return _Bucket, (self.name, self._options)

    @property
    def _reached(self) -> Any:
        """The store of obstore; StoreError in a child by fork."""
        if _Bucket._process != os.getpid():
            raise StoreError(f"{self.name} cannot be reached from a process made by fork; start it by spawn")
        return self._store

    @contextmanager
    def _reading(self, key: str) -> Iterator[None]:
        """Raise errors of obstore as MissingObjectError, or StoreError with a sentence."""
        try:
            yield
        except self._errors as error:
            raise self._failed(f"{self.name}: {key} cannot be read", key, error) from error

    def _failed(self, what: str, key: str, error: Exception) -> StoreError:
        scheme, _, path = self.name.partition("://")
        if re.search("NoSuchBucket|ContainerNotFound|The specified bucket does not exist", str(error)):
            return StoreError(f"{scheme}://{path.partition('/')[0]}: there is no such bucket")
        if "//169.254.169.254/" in str(error):  # where a machine in a cloud asks for credentials
            kind, variables = _CREDENTIALS[scheme.lower()]
            return StoreError(
                f"{self.name}: no credentials were found; set {variables}, or {kind}_SKIP_SIGNATURE=true for a public "
                "bucket"
            )
        if isinstance(error, FileNotFoundError | self._obstore.exceptions.NotFoundError):
            return MissingObjectError(f"{self.name} has no {key}")
        return StoreError(f"{what}: {_first_line(error)}")

    def get(self, key: str, start: int = 0, size: int | None = None) -> bytes:
        with self._reading(key):
            if size is None:
                return bytes(self._obstore.get(self._reached, key).bytes())[start:]
            return bytes(self._obstore.get_range(self._reached, key, start=start, length=size))

    def has(self, key: str) -> bool:
        try:
            with self._reading(key):
                self._obstore.head(self._reached, key)
        except MissingObjectError:
            return False
        return True

    def put(self, contents: Mapping[str, bytes]) -> None:
        _at_once(lambda key: self._put(key, contents[key], "overwrite"), contents)

    def versioned(self, key: str) -> Versioned:
        try:
            with self._reading(key):
                found = self._obstore.get(self._reached, key)
                version = {key: found.meta[key] for key in ("e_tag", "version") if found.meta[key] is not None}
                return Versioned(bytes(found.bytes()), version)
        except MissingObjectError:
            return Versioned(None, None)

    def swap(self, key: str, content: bytes, expected: Versioned) -> None:
        self._put(key, content, "create" if expected.content is None else expected.version)

    def _put(self, key: str, content: bytes, mode: Any) -> None:
        exceptions = self._obstore.exceptions
        try:
            self._obstore.put(self._reached, key, content, mode=mode, use_multipart=False)
        except (exceptions.AlreadyExistsError, exceptions.PreconditionError):
            raise _swapped(self.name) from None
        except self._errors as error:
            raise self._failed(f"cannot write {key} to {self.name}", key, error) from error


def _from_url(url: str, options: Mapping[str, Any]) -> Any:
    """Return a store of obstore; ValueError if it refuses an option. Those of its client may be among the others."""
    from_url: Any = import_extra("obstore.store").from_url
    try:
        options = {**options, **options.get("config", {})}
        of_client = {name: match[1] for name in options if (match := _OF_CLIENT.fullmatch(name.lower()))}
        endpoints = [str(options[name]) for name in options if name.lower().endswith(("endpoint", "endpoint_url"))]
        plain = (endpoint.startswith("http:") for endpoint in endpoints or [os.environ.get("AWS_ENDPOINT_URL", "")])
        client = {"allow_http": any(plain), **{key: options[name] for name, key in of_client.items()}}
        settings = {
            "retry_config": {"max_retries": _TRIES, "retry_timeout": timedelta(seconds=_BUCKET_S)},
            **{name: value for name, value in options.items() if name != "config" and name not in of_client},
            "client_options": {**client, **options.get("client_options", {})},
        }
        return from_url(url, **settings)
    except BaseException as error:  # a panic of Rust is no Exception
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        raise ValueError(str(error)) from error


def _at_once(work: Callable[..., None], *arguments: Iterable[Any]) -> None:
    """Call a function for each item, in threads."""
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        list(pool.map(work, *arguments))


def checked(objects: Objects, key: str, digest: str, start: int = 0, size: int | None = None) -> bytes:
    """Return an object, or a part of it, whose sha256 is known; StoreError if it is another one."""
    content = objects.get(key, start, size)
    if hashlib.sha256(content).hexdigest() != digest:
        part = "" if size is None else f" from byte {start}"
        raise StoreError(
            f"{objects.name} is damaged: the content of {key}{part} is not the one whose digest was recorded; a cache "
            "in between may hold another"
        )
    return content


def _swapped(name: str) -> ChangedRootError:
    return ChangedRootError(f"another edition was published at {name} meanwhile; publish again to replace it")


def _first_line(error: BaseException) -> str:
    """Return the first line of a message, without the XML of an answer; those of obstore append a trace of sources."""
    line = str(error).strip().partition("\n")[0].partition(": <")[0]
    code = re.search("<Code>(.*?)</Code>", str(error))
    return line + (f": {code[1]}" if code else "") or type(error).__name__
