"""Any saved fit read back, whatever its kind: the header of the file says which reader it needs."""

import os

from homofact.factor.factorization import FORMAT as PRODUCT
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.files.archive import read_archive, saved_file
from homofact.files.fields import Fields
from homofact.parametric.model_fit import FORMAT as MODEL
from homofact.parametric.model_fit import ModelFit
from homofact.separable.separable import FORMAT as SEPARABLE
from homofact.separable.separable import Separable

_READERS = {PRODUCT: Factorization.load, SEPARABLE: Separable.load, MODEL: ModelFit.load}


def open_saved(place: str | os.PathLike[str]) -> Fitted:
    """The fit of a saved file, or of a folder with one. Raises BadInput where there is none or it is damaged."""
    target = saved_file(place)
    form = Fields(f"{target}: ", read_archive(target)[1]).text("format", _READERS)
    return _READERS[form](target)
