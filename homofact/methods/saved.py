"""Read a saved fit of any kind: the header of the file selects the reader."""

import os

from homofact.errors import BadInput
from homofact.factor.factorization import FORMAT as PRODUCT
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.factor.spectral_fit import FORMAT as SPECTRAL
from homofact.factor.spectral_fit import SpectralFit
from homofact.files.archive import read_archive, saved_file
from homofact.files.fields import Fields
from homofact.parametric.model_fit import FORMAT as MODEL
from homofact.parametric.model_fit import ModelFit
from homofact.separable.separable import FORMAT as SEPARABLE
from homofact.separable.separable import Separable

_READERS = {
    PRODUCT: Factorization.load,
    SPECTRAL: SpectralFit.load,
    SEPARABLE: Separable.load,
    MODEL: ModelFit.load,
}


def open_saved(place: str | os.PathLike[str]) -> Fitted:
    """Return the fit of a saved file, or of a folder with one.

    Raises BadInput where there is none or it is damaged, and for a measurement, which is to be fitted first.
    """
    target = saved_file(place)
    try:
        header = read_archive(target)[1]
    except BadInput as error:
        from homofact.brdf.formats import format_of, npz

        # A damaged fit is an archive of arrays as well.
        if not target.is_file() or format_of(target) in (None, npz.NAME):
            raise
        hint = f"fit it first: `homofact.fit({str(target)!r})`"
        raise BadInput("is a measurement", where=target, expected="a saved fit", hint=hint) from error
    form = Fields(f"{target}: ", header).text("format", _READERS)
    return _READERS[form](target)
