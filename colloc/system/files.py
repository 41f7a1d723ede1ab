"""Files that are replaced as a whole, names of result files, and locks."""

import contextlib
import errno
import os
import re
import reprlib
import secrets
import socket
import time
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, SoftFileLock, Timeout

from colloc.system.errors import ProblemError, StoreError

_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)
_FORGOTTEN = 3600.0  # seconds after which a temporary file belongs to a killed process
SUFFIX = ".h5"
FAILED, INTERRUPTED, SHRUNK, RUN = "failed", "interrupted", "shrunk", "run"
_ENDING = re.compile(
    r"\.(failed|interrupted|shrunk|run|starts|front|(?:start|former)-\d+)$", re.IGNORECASE
)
_LONGEST = 200  # characters of a name; file systems allow 255 bytes, and endings are added


@contextlib.contextmanager
def replaced_file(path: Path) -> Iterator[str]:
    """Yield the name of a temporary file that replaces `path` if the block succeeds.

    `StoreError` if it cannot be written; what was there before is kept.
    """
    temporary = path.with_name(f".{path.name}.colloc-{secrets.token_hex(4)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for left in path.parent.glob(".*.colloc-*.part"):
            with contextlib.suppress(OSError):  # another writer may have removed it
                if time.time() - left.stat().st_mtime > _FORGOTTEN:
                    left.unlink()
        # 0o666 less the umask, as for any new file
        os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        yield str(temporary)
        with open(temporary, "rb") as written:
            os.fsync(written.fileno())
        os.replace(temporary, path)
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}.") from None
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)


def write_text(path: Path, text: str) -> None:
    with replaced_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8", newline="")


@contextlib.contextmanager
def lock_file(path: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold a lock file; if another does, `wait` for it or raise a `StoreError`."""
    with contextlib.ExitStack() as stack:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = stack.enter_context(FileLock(path, blocking=wait))
            if not isinstance(lock, SoftFileLock):  # which has its own content
                with contextlib.suppress(OSError):  # a full disk does not matter here
                    holder = f"process {os.getpid()} on {socket.gethostname()}"
                    path.write_text(holder, encoding="utf-8")
        except Timeout:
            holder = path.read_text(encoding="utf-8", errors="replace")[:200].strip()
            raise StoreError(
                f"{path.parent} is in use by {holder or 'another process'}; wait for it, or choose "
                f"another --output."
            ) from None
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise StoreError(
                    f"cannot write {path}: {error.strerror or error}; choose another --output."
                ) from None
        yield


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder after other holders. `StoreError` if it cannot be made or read."""
    with contextlib.ExitStack() as stack:
        try:
            import fcntl

            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX)
        except (ImportError, OSError):  # Windows and some network file systems lock files only
            stack.enter_context(lock_file(folder / ".colloc.lock", wait=True))
        yield


def reserved_ending(name: str) -> str:
    """Ending, without its dot, of a name that only colloc gives to files; else ""."""
    match = _ENDING.search(name)
    return match[1] if match else ""


def check_name(name: object) -> None:
    """Raise a `ProblemError` for a name that files cannot have."""
    if not isinstance(name, str) or not re.fullmatch(rf"\w[\w.-]{{,{_LONGEST - 1}}}", name, re.A):
        raise ProblemError(
            f"name must be at most {_LONGEST} letters, digits, '_', '-' or '.', the first of them "
            f"no '-' or '.': files are named after it; not {reprlib.repr(name)}."
        )
    if ending := reserved_ending(name):
        raise ProblemError(
            f"name must not end in '.{ending}': colloc itself names files like that; not {name!r}."
        )


def beside(path: Path, ending: str) -> Path:
    """``x.ENDING.h5`` for ``x.h5``."""
    return path.with_name(f"{path.stem}.{ending}{path.suffix}")


def run_file(path: Path) -> Path:
    return beside(path, RUN).with_suffix(".sqlite")
