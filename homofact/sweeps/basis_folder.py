"""A sweep with a shared basis: fit its sources together, and write the basis to a folder.

    basis.npz     layer 0 the mean textures, layer k direction k (`factor.layered`); logarithms, ε and A mean nothing
    basis.json    every material's name, A and coefficients, channel by channel; ε; errors, bytes, from when it pays

The folder is written whole or not at all, and never over an earlier one.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.evaluation.split import Split
from homofact.exporting.manifest import write_json
from homofact.factor.factorization import LEAST_MEAN, MOST_CHANNELS, Factorization
from homofact.factor.layered import MOST_LAYERS, Layered
from homofact.files.fields import Fields
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import BASIS
from homofact.files.plain import plain
from homofact.methods.fitting import ProgressCallback
from homofact.sweeps.shared_basis import SharedBasis, expanded, fit_basis
from homofact.sweeps.sweep_file import AskedSweep
from homofact.sweeps.together import one_search, open_together, with_epsilon
from homofact.version import __version__

REPORT = "basis.json"
FORMAT, FORMAT_VERSION = "homofact basis", 1


def check_place(folder: Path) -> None:
    """Raise BadInput if the basis cannot be written to `folder`; call this before long work."""
    check_new_folder(folder, BASIS, force=False)


def fit_asked(
    asked: AskedSweep,
    count: int,
    progress: ProgressCallback | None = None,
    reading: Callable[[str], object] = lambda words: None,
    notify: Callable[[str, int, int], object] = lambda words, done, all: None,
) -> SharedBasis:
    """Open a sweep's sources and fit their basis. Raises BadInput as `one_search`, `open_together` and `fit_basis`."""
    settings = one_search(asked, "basis")
    sources = open_together(asked, settings, reading)
    settings = with_epsilon(settings, sources)
    splits = [Split.of(source, asked.held_out, settings.seed, asked.source.subset) for source in sources]
    trains = [split.parts(source)[0] for split, source in zip(splits, sources, strict=True)]
    tests = [split.test_samples(source) for split, source in zip(splits, sources, strict=True)]
    return fit_basis([source.name for source in sources], trains, tests, settings, count, progress, notify)


def write_basis(folder: Path, fit: SharedBasis) -> dict[str, Any]:
    """Write the basis and its figures to a new folder, whole or not at all; return the figures."""
    first = fit.materials[0].fit
    own = [
        {"name": material.name, "A": material.fit.transform.mean.tolist(), "coefficients": numbers}
        for material, numbers in zip(fit.materials, fit.coefficients().tolist(), strict=True)
    ]
    record = plain(
        {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "version": __version__,
            "epsilon": first.transform.epsilon,
            "channels": list(first.channels),
            "figures": fit.record(),
            "materials": own,
        }
    )

    def fill(place: Path) -> None:
        fit.layered().save(place / BASIS.mark)
        write_json(place / REPORT, record)

    write_folder(folder, BASIS, fill)
    return record


def read_basis(folder: Path) -> dict[str, Factorization]:
    """Return every material by name, with its textures reconstructed from the basis.

    Raises BadInput if the folder contains no basis, or a damaged one.
    """
    fields = Fields.read(folder / REPORT, "a basis")
    fields.text("format", (FORMAT,))
    fields.version("format_version", FORMAT_VERSION)
    basis = Layered.load(folder / BASIS.mark)
    channels, count = tuple(fields.texts("channels", MOST_CHANNELS)), len(basis.layers) - 1
    epsilon, fits = fields.number("epsilon", above=0), {}
    if count < 1:
        raise BadInput(where=folder / BASIS.mark, found="no directions", expected=f"1 to {MOST_LAYERS - 1}")
    for entry in fields.inners("materials", 10**6):
        mean = torch.tensor(entry.numbers("A", len(channels), above=LEAST_MEAN), dtype=torch.float64)
        numbers = torch.tensor(entry.rows("coefficients", len(channels), count), dtype=torch.float64)
        fits[entry.text("name")] = expanded(basis, numbers, LogTransform(epsilon, mean), channels)
    return fits
