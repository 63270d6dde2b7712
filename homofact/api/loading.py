"""Saved fits, read back: `homofact.load`. No torch is loaded here."""

import os

from homofact.api.result import Fit, with_record
from homofact.errors import BadInput
from homofact.exporting.result import open_result, read_record


def load(path: str | os.PathLike[str]) -> Fit:
    """Return a saved fit, bit-identical.

    Parameters
    ----------
    path : what `Fit.save` wrote, the folder of a result, or the folder of an export.

    Returns
    -------
    The fit, with its report and its verdict where the file or the folder's report.json has them.

    Raises
    ------
    BadInput : for anything else, and for a damaged file.

    Examples
    --------
    >>> import homofact, pathlib, tempfile
    >>> fit = homofact.fit("material:phong-10", homofact.McCool(size=4))
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "paint.npz"
    >>> fit.save(path)
    >>> homofact.load(path).evaluate([0, 0, 1], [0, 0, 1]) == fit.evaluate([0, 0, 1], [0, 0, 1])
    True
    """
    if not isinstance(path, str | os.PathLike):
        raise BadInput(
            where="path", found=type(path).__name__, expected="a saved fit, or the folder of a result or export"
        )
    return with_record(Fit(open_result(path)), read_record(path))
