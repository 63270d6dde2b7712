"""A spatially varying material: clusters of texels, each with its own measurements, fitted under shared projections.

Cluster k is the sweep's source number k, and the label map assigns its texels. All clusters are searched together
(`methods.search_fit.fit_shared`), so that one program with texture arrays evaluates them. Each cluster is also fitted
separately with the same settings, to measure the cost of sharing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from homofact.brdf.source import Source
from homofact.containers.formats import Format, format_named
from homofact.errors import BadInput
from homofact.evaluation.metrics import SixErrors, measure
from homofact.evaluation.split import Split
from homofact.exporting.layered import exported_layers, put_layers, with_sampling
from homofact.exporting.manifest import write_json
from homofact.factor.factorization import Factorization
from homofact.factor.layered import Layered
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import SVBRDF
from homofact.files.plain import plain
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.search import Search
from homofact.methods.search_fit import fit_shared
from homofact.sweeps.label_map import read_labels
from homofact.sweeps.sweep_file import AskedSweep
from homofact.sweeps.together import one_search, open_together, with_epsilon
from homofact.version import __version__

REPORT = "svbrdf.json"


@dataclass(frozen=True)
class SpatialTask:
    """What is fitted: the opened sources, the label map (rows, columns), the method, and how arrays are stored."""

    name: str
    sources: tuple[Source, ...]
    labels: np.ndarray
    settings: Search
    format: Format
    held_out: float
    subset: int


@dataclass(frozen=True)
class TexelCluster:
    """One cluster: its source's name, its number of texels, and both fits with their held-out errors."""

    name: str
    texels: int
    shared: MethodFit
    alone: MethodFit
    shared_error: SixErrors
    alone_error: SixErrors

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        sides = {"shared": (self.shared, self.shared_error), "alone": (self.alone, self.alone_error)}
        return {"source": self.name, "texels": self.texels} | {
            side: {
                "bytes": fit.nbytes,
                "fetches": fit.fetches,
                "held_out": error.record(),
                "kinds": fit.factorization.provenance["kinds"],
                "shapes": fit.factorization.provenance["shapes"],
                "status": fit.report.status.value,
                "seconds": fit.report.seconds,
            }
            for side, (fit, error) in sides.items()
        }


@dataclass(frozen=True)
class SpatialFit:
    """All clusters, and their fits under shared projections as layers of texture arrays."""

    asked: SpatialTask
    clusters: tuple[TexelCluster, ...]
    layers: Layered

    def record(self) -> dict[str, Any]:
        """Return the JSON form: bytes (float32) and mean held-out log errors side by side, then cluster by cluster."""
        count = len(self.clusters)
        return plain(
            {
                "format": "homofact svbrdf",
                "format_version": 1,
                "version": __version__,
                "name": self.asked.name,
                "labels": {"rows": self.asked.labels.shape[0], "columns": self.asked.labels.shape[1]},
                "shared": {
                    "programs": 1,
                    "bytes": self.layers.nbytes,
                    "log_mse": sum(cluster.shared_error.log_mse for cluster in self.clusters) / count,
                },
                "alone": {
                    "programs": count,
                    "bytes": sum(cluster.alone.nbytes for cluster in self.clusters),
                    "log_mse": sum(cluster.alone_error.log_mse for cluster in self.clusters) / count,
                },
                "clusters": [cluster.record() for cluster in self.clusters],
            }
        )


def read_asked(asked: AskedSweep, notify: Callable[[str], object] = lambda words: None) -> SpatialTask:
    """Open the sources and the label map of a sweep with [svbrdf]; `notify` receives the name of each source.

    Raises BadInput, before anything is fitted, for a sweep without [svbrdf], more than one method, size or seed, a
    method other than the search, sources with different channels, and a label map that `read_labels` rejects.
    """
    if asked.svbrdf is None:
        raise BadInput(where="svbrdf", found="no section [svbrdf]", expected='one with labels = "FILE"')
    settings = one_search(asked, "svbrdf")
    labels = read_labels(asked.svbrdf.labels, len(asked.sources))
    sources = open_together(asked, settings, notify)
    stored = format_named(asked.svbrdf.format)
    return SpatialTask(asked.name, sources, labels, settings, stored, asked.held_out, asked.source.subset)


def fit_clusters(
    asked: SpatialTask,
    progress: ProgressCallback | None = None,
    notify: Callable[[str, int, int], object] = lambda words, done, all: None,
) -> SpatialFit:
    """Fit all clusters together, then each alone; `notify(name, done, total)` is called before every fit."""
    fits = len(asked.sources) + 1
    splits = [Split.of(source, asked.held_out, asked.settings.seed, asked.subset) for source in asked.sources]
    trains = [split.parts(source)[0] for split, source in zip(splits, asked.sources, strict=True)]
    notify("all clusters together", 0, fits)
    settings = with_epsilon(asked.settings, asked.sources)
    shared = fit_shared(trains, settings, progress)
    clusters = []
    for k, (source, split) in enumerate(zip(asked.sources, splits, strict=True)):
        notify(f"{source.name} alone", k + 1, fits)
        alone = settings.fit(trains[k], progress)
        test = split.test_samples(source)
        texels = int((asked.labels == k).sum())
        # Both in the logs of the same ε and A.
        transform = shared[k].factorization.transform
        errors = [measure(fit.factorization, test, transform) for fit in (shared[k], alone)]
        clusters.append(TexelCluster(source.name, texels, shared[k], alone, *errors))
    made = (fit.factorization for fit in shared)
    return SpatialFit(asked, tuple(clusters), Layered(tuple(each for each in made if isinstance(each, Factorization))))


def check_place(folder: Path) -> None:
    """Raise BadInput if the fit cannot be written to `folder`; call this before long work."""
    check_new_folder(folder, SVBRDF, force=False)


def write_clusters(folder: Path, fit: SpatialFit) -> dict[str, Any]:
    """Write fit, report, arrays, shaders and labels to a new folder, whole or not at all; return the report.

    The shaders can importance-sample every layer. The report contains the sampling noise of every cluster.
    """
    made = with_sampling(exported_layers(fit.layers, fit.asked.format))
    record = fit.record()

    def fill(place: Path) -> None:
        fit.layers.save(place / SVBRDF.mark)
        described = put_layers(place, made, fit.asked.labels)
        for cluster, layer in zip(record["clusters"], described["layers"], strict=True):
            cluster["noise"] = layer["sampling"]["measured"]
        write_json(place / REPORT, record)

    write_folder(folder, SVBRDF, fill)
    return record
