"""Any saved fit read back, whatever its kind: the header of the file says which reader it needs."""

import os

from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.files.archive import read_archive, saved_file
from homofact.separable.separable import FORMAT as SEPARABLE
from homofact.separable.separable import Separable

_READERS = {SEPARABLE: Separable.load}


def open_saved(place: str | os.PathLike[str]) -> Fitted:
    """The fit of a saved file, or of a folder with one. Raises BadInput where there is none or it is damaged."""
    target = saved_file(place)
    named = read_archive(target)[1].get("format")
    return _READERS.get(str(named), Factorization.load)(target)
