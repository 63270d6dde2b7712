"""Saved fits of every kind as `RuntimeFit`s."""

import os
from collections.abc import Callable
from pathlib import Path

from homofact.factor.stored import FORMAT as PRODUCT
from homofact.factor.stored import StoredProduct
from homofact.files.archive import read_archive, saved_file
from homofact.files.fields import Fields
from homofact.parametric.stored import FORMAT as MODEL
from homofact.parametric.stored import StoredModel
from homofact.runtime.evaluate import ModelRuntime, RuntimeFit, TextureRuntime
from homofact.separable.stored import FORMAT as SUM
from homofact.separable.stored import StoredSum


def _product(path: Path) -> RuntimeFit:
    return TextureRuntime.of(StoredProduct.load(path))


def _sum(path: Path) -> RuntimeFit:
    return TextureRuntime.of(StoredSum.load(path))


def _model(path: Path) -> RuntimeFit:
    stored = StoredModel.load(path)
    return ModelRuntime(stored.channels, stored.provenance, stored.model)


_READERS: dict[str, Callable[[Path], RuntimeFit]] = {PRODUCT: _product, SUM: _sum, MODEL: _model}


def load(place: str | os.PathLike[str]) -> RuntimeFit:
    """The fit of a saved file, or of a result's folder, as `homofact.load` reads them, but for exported textures.

    Raises BadInput where there is none or it is damaged.
    """
    target = saved_file(place)
    form = Fields(f"{target}: ", read_archive(target)[1]).text("format", _READERS)
    return _READERS[form](target)
