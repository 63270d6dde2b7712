"""Sweeps made in no time: one small fit under many names, with figures as a test wants them."""

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from PIL import Image

from homofact.brdf.source import open_source
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.metric_table import REPORTED
from homofact.files.plain import plain
from homofact.methods.mccool_fit import McCool
from homofact.sections import SourceSettings
from homofact.sweeps.ledger import SweepLedger, sealed
from homofact.sweeps.report.reading import ReadSweep, ReportedFinding, ReportedFit
from homofact.sweeps.summary import FitRow
from homofact.sweeps.sweep_file import settings_record
from homofact.sweeps.task import Task
from homofact.version import __version__

SOURCE, COUNT, LABELS = "material:phong-10", 400, ("ours", "ggx")
MATERIALS = (SOURCE, "folder/red paint.npz", 'other/<b>odd<i> & "name".npz')
Change = Callable[[dict[str, Any], Task], object]


@cache
def small_fit() -> tuple[Path, dict[str, Any]]:
    """A saved fit of two textures, and its report."""
    row = fit_and_measure(open_source(SOURCE, count=COUNT), McCool(size=4))
    place = Path(mkdtemp(prefix="homofact-test-")) / "factorization.npz"
    row.factorization.save(place)
    return place, plain(row.record())


def task(source: str, label: str, seed: int = 0, version: str = __version__) -> Task:
    """A task; that of "ggx" is a model without textures."""
    settings = {"seed": seed, "label": label}
    method = "ggx" if label == "ggx" else "mccool"
    digest = hashlib.sha256(source.encode()).hexdigest()
    return Task(source, digest, settings_record(SourceSettings(count=COUNT)), label, method, settings, 0.2, version)


def make_sweep(
    folder: Path,
    sources: Sequence[str] = MATERIALS,
    labels: Sequence[str] = LABELS,
    seeds: Sequence[int] = (0,),
    change: Change = lambda report, task: None,
    refused: Sequence[str] = (),
    name: str = "a test",
    version: str = __version__,
) -> Path:
    """A sweep's folder of every source with every label and seed; `change` edits each report before it is written.

    The fits of the labels `refused` are set aside instead.
    """
    saved, report = small_fit()
    tasks = [task(source, label, seed, version) for source in sources for label in labels for seed in seeds]
    ledger = SweepLedger(folder)
    ledger.begin(name, tasks)
    for number, each in enumerate(tasks):
        if each.label in refused:
            ledger.set_aside(each, f"refused {each.name}: a test <i>wants</i> it")
            continue
        place = ledger.place(each)
        place.mkdir(parents=True)
        shutil.copyfile(saved, place / "factorization.npz")
        Image.new("RGB", (8, 8), (40 * number % 256, 90, 90)).save(place / "compare.png")
        own = json.loads(json.dumps(report)) | {"task": each.record()}
        if each.method == "ggx":
            own |= {"textures": 0, "bytes": 32, "fetches": 0, "shapes": []}
        own["error"]["held_out"]["log_mse"] = 0.001 * (number + 1)
        change(own, each)
        (place / "report.json").write_text(json.dumps(sealed(own, saved)), encoding="utf-8")
    return folder


def read_of(values: Sequence[dict[str, float | None]], labels: Sequence[str] = ("ours",)) -> ReadSweep:
    """A sweep that is on no disk: a fit for each of `values` (metrics by name), three a material."""
    fits = []
    for number, given in enumerate(values):
        each = task(f"folder/material {number // 3}.npz", labels[number % len(labels)], number)
        metrics = {metric.name: given.get(metric.name) for metric in REPORTED}
        seconds, trusted = 0.5 + number / 7, number % 2 == 0
        known = (f"{number:032x}", each.source, each.name, each.label, number, 100 + number, 2, 2)
        row = FitRow(*known, 1e-5 * 10 ** (number % len(labels)), seconds, "direct", trusted, metrics)
        fits.append(
            ReportedFit(each, row, "right", (ReportedFinding("light", "visible", "found", "remedy"),), Path("none"))
        )
    return ReadSweep("many", Path("none"), tuple(fits), (), 0)
