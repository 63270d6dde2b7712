"""Writing a file whole or not at all: beside its place first, then renamed over it."""

import os
from collections.abc import Callable
from pathlib import Path

from homofact.errors import BadInput


def replace_file(path: str | os.PathLike[str], write: Callable[[Path], None]) -> None:
    """Let `write` make a file beside `path` (with its suffix) and rename it to `path`.

    Whatever `write` raises leaves an older `path` as it was and nothing beside it. Raises BadInput where
    the place cannot be written.
    """
    target = Path(path)
    beside = target.with_name(f".{target.stem}.partial-{os.getpid()}{target.suffix}")
    try:
        write(beside)
        os.replace(beside, target)
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(f"{target}: cannot be written ({reason}), expected a writable place") from error
    finally:
        if beside.exists():
            beside.unlink()
