"""Allow one run at a time: a run claims its place, and files of dead runs are distinguished from those of live ones.

A claim is a lock of the operating system on a small hidden file beside the place; a private folder is locked itself. A
lock ends with its process, whatever ends the process. If the operating system or the file system has no locks, no run
is refused and nothing is cleaned up.
"""

import contextlib
import errno
import hashlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

from homofact.errors import BadInput
from homofact.files.places import real_place, unwritable_refused

try:
    import fcntl
except ImportError:  # another system than POSIX
    fcntl = None

_UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP}
_claims: dict[Path, tuple[int, contextlib.ExitStack]] = {}
_guard = threading.Lock()


@contextlib.contextmanager
def claimed(path: str | os.PathLike[str]) -> Iterator[None]:
    """Keep every other process from claiming `path` while the block runs; the same process may claim it again.

    Missing parent folders are created, and removed at the end if they are still empty. Raises BadInput if another
    process has claimed `path`, or if nothing can be written beside it.
    """
    with unwritable_refused(path):
        target = real_place(path)
        with _guard:
            count, stack = _claims.get(target) or (0, _claim(path, target))
            _claims[target] = (count + 1, stack)
    try:
        yield
    finally:
        with _guard:
            count, stack = _claims.pop(target)
            if count > 1:
                _claims[target] = (count - 1, stack)
            else:
                stack.close()


@contextlib.contextmanager
def made_folders(folder: Path) -> Iterator[None]:
    """Create a folder and its missing parents; at the end, remove those of them that are empty."""
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for each in made:
            with contextlib.suppress(OSError):
                each.rmdir()


def lock(place: Path, flags: int) -> int | None:
    """Lock `place` and return its open handle; None if another process has the lock, or if `place` is gone.

    Raises NotImplementedError if the system has no locks, and OSError if `place` cannot be opened.
    """
    if fcntl is None:
        raise NotImplementedError("no locks on this system")
    try:
        handle = os.open(place, flags | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # The one who had it before may have deleted what was opened.
        if os.path.samestat(os.fstat(handle), os.lstat(place)):
            return handle
    except OSError as error:
        if error.errno in _UNSUPPORTED:
            os.close(handle)
            raise NotImplementedError("no locks on this file system") from error
        if not isinstance(error, BlockingIOError | FileNotFoundError):
            os.close(handle)
            raise
    except BaseException:
        os.close(handle)
        raise
    os.close(handle)
    return None


def _claim(path: str | os.PathLike[str], target: Path) -> contextlib.ExitStack:
    with contextlib.ExitStack() as stack:
        stack.enter_context(made_folders(target.parent))
        stack.enter_context(_lock_file(path, target))
        return stack.pop_all()


@contextlib.contextmanager
def _lock_file(path: str | os.PathLike[str], target: Path) -> Iterator[None]:
    # By a digest: the name itself may leave no room for a longer one.
    digest = hashlib.sha256(os.fsencode(target.name)).hexdigest()[:16]
    place = target.parent / f".homofact-{digest}.lock"
    try:
        handle = lock(place, os.O_RDWR | os.O_CREAT)
    except NotImplementedError:
        yield
        return
    if handle is None:
        raise BadInput(f"another run of homofact{_holder(place)} writes there", where=path, expected="one at a time")
    try:
        os.ftruncate(handle, 0)
        os.write(handle, b"%d\n" % os.getpid())
        yield
    finally:
        with contextlib.suppress(OSError):
            place.unlink()
        os.close(handle)


def _holder(place: Path) -> str:
    try:
        found = place.read_bytes()[:20].strip()
    except OSError:
        return ""
    return f" (process {found.decode()})" if found.isdigit() else ""
