"""A cache folder for compiled code, if neither the package's folder nor the user's cache is writable.

numba stores compiled code beside the source, or else in the user's cache. If both are read-only, as in many containers
without a home folder, numba refuses to compile. homofact then gives the run a folder of its own.
"""

import atexit
import os
import shutil
import sys
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


def give_place(package: Path) -> None:
    """Make numba use a temporary folder, deleted at exit, if it has no other; numba is not imported."""
    if VARIABLE in os.environ or _writable(package / "linear" / "__pycache__") or _writable(_of_user()):
        return
    import tempfile

    try:
        folder = tempfile.mkdtemp(prefix="homofact-compiled-")
    except OSError:
        return
    os.environ[VARIABLE] = folder
    atexit.register(_delete, folder, os.getpid())


def _of_user() -> Path:
    """The user's cache as numba finds it (appdirs)."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home()))
    if sys.platform == "darwin":
        return Path(os.path.expanduser("~/Library/Caches/numba"))
    return Path(os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~/.cache"))) / "numba"


def _writable(folder: Path) -> bool:
    """Whether files can be made in a folder, or the folder itself in the nearest one above that is there."""
    there = next((each for each in (folder, *folder.parents) if each.is_dir()), None)
    return there is not None and os.access(there, os.W_OK | os.X_OK)


def _delete(folder: str, owner: int) -> None:
    # A fork ends too.
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
