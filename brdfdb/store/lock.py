"""The lock of a material, and the sentence for what cannot be written."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import IO

from brdfdb.errors import BusyError, StoreError
from brdfdb.store.paths import staged_path, staging_path

try:
    import fcntl
except ModuleNotFoundError:  # Windows
    fcntl = None  # type: ignore[assignment]


_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # of flock, from a file system that has none


class NoLocksError(StoreError):
    """A store on a system or a file system without locks."""


@contextmanager
def writing(root: Path, name: str) -> Iterator[None]:
    """Turn an OSError of the block into a StoreError of one sentence."""
    try:
        yield
    except OSError as error:
        raise StoreError(f"cannot write {name} to the store at {root}: {error.strerror or error}") from error


class Lock:
    """The right to change a material: a context manager.

    While another process or thread has it, wait, or else raise BusyError. StoreError says that the system has no file
    locks, or the store cannot be written.
    """

    def __init__(self, root: Path, name: str, *, wait: bool = True) -> None:
        self.path = staged_path(root, name) / "lock"
        self.root = root
        self.name = name
        self.wait = wait
        self._handle: IO[bytes] | None = None

    def __enter__(self) -> Lock:
        if fcntl is None:
            raise NoLocksError(
                f"cannot write to the store at {self.root}: this system has no file locks; use Linux or macOS"
            )
        with writing(self.root, self.name):
            staging_path(self.root).mkdir(exist_ok=True)
            while self._handle is None:
                self._handle = self._acquired()
        return self

    def _acquired(self) -> IO[bytes] | None:
        """Return the locked file; None if its holder removed it in the meantime."""
        try:
            self.path.parent.mkdir(exist_ok=True)
            handle = self.path.open("ab")
        except (FileNotFoundError, FileExistsError):  # its holder took the directory away, maybe between two calls
            if self.path.parent.is_file():  # one look: between two the directory may go
                raise
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX if self.wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(handle.fileno()).st_ino == self.path.stat().st_ino:
                return handle
        except BlockingIOError:
            handle.close()
            raise BusyError(f"another build is at work on {self.name}") from None
        except FileNotFoundError:
            pass
        except OSError as error:
            handle.close()
            if error.errno in _NO_LOCKS:
                self._tidy()
                raise NoLocksError(
                    f"cannot write to the store at {self.root}: its file system has no file locks (flock: "
                    f"{error.strerror}); use another, or mount it with locks"
                ) from error
            raise
        except BaseException:
            handle.close()
            raise
        handle.close()
        return None

    def _tidy(self) -> None:
        """Remove the directory of the lock if nothing else is in it."""
        with suppress(OSError):  # another build has come in: it is theirs
            if os.listdir(self.path.parent) == ["lock"]:
                self.path.unlink()
                self.path.parent.rmdir()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Release the lock, and remove its directory if nothing else is in it."""
        assert self._handle is not None
        self._tidy()
        fcntl.flock(self._handle, fcntl.LOCK_UN)  # closing is not enough where a child was forked meanwhile
        self._handle.close()
        self._handle = None


def is_taken(path: Path) -> bool:
    """Return True if somebody has the lock at a path; OSError if there is none, or it cannot be tried."""
    with path.open("rb") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
