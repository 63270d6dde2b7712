"""List the stored results of the study of small textures, and the command that repeats each measurement.

Every experiment is one file of JSON lines, [key, result], that an existing program writes. `conditions.jsonl` beside
them has for each experiment the command, the machine with its versions, the day, and a note for the paper.
"""

import datetime
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from homofact.brdf.source import open_source
from homofact.brdf.tilt import Straightened
from homofact.errors import BadInput
from homofact.evaluation.machine import machine
from homofact.geometry.directions import from_spherical

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy import straightening
from scripts.compression import real_measurements
from scripts.compression.real_fits import CAR_PAINT, LABELS, PAINTS, RGL, TAPE, Subject
from scripts.compression.real_tables import Table
from scripts.relighting import relight_lobes
from scripts.shared.harness import CORNELL, ROOT, Finished, data_folder
from scripts.speed import error_against_time

KEPT = ROOT / "docs" / "papers" / "small_textures" / "results"
# The lines of docs/real.md; a folder of results with lines of its own has precedence.
PUBLISHED_LINES = ROOT / "scripts" / "compression" / "real_measurements.jsonl"
STRAIGHTENING, SLICES, SEARCH, TIME, RELIGHTING = "straightening", "slices", "search", "time", "relighting"
CONDITIONS = "conditions"
SLICED, SLICE_DEGREES, SLICE_WIDTH = "cc_nothern_aurora", (30.0, 60.0), 8.0
PIXELS, FACTORED_TERMS, COEFFICIENTS = 40, 32, 256
MESH = "spot"
GLOSSY = ("ashikhmin-shirley", "exponent 2000", "golden yellow")
RELIT = ("lambert", *GLOSSY)


def slices(folder: Path) -> dict[str, dict[str, list[float]]]:
    """Profiles of one measurement in the plane of incidence: raw and straightened, as it is and swapped.

    The light's angle is one of `SLICE_DEGREES`; the viewer's goes `SLICE_WIDTH` to both sides of the mirror direction.
    Swapped values were measured with light and viewer exchanged; of a reciprocal material they are the same. A value is
    the mean of the channels in sr⁻¹.
    """
    path = str(folder / "rgl" / f"{SLICED}_rgb.bsdf")
    raw, straight = (open_source(path, count=1000, calibrate=[kind]).reflectance for kind in ("none", "auto"))
    if not isinstance(straight, Straightened) or raw is None:
        raise BadInput(where=path, found="no tilt", expected="a measurement with a tilt that can be undone")
    found = {}
    for degrees in SLICE_DEGREES:
        offset = torch.linspace(-SLICE_WIDTH, SLICE_WIDTH, 81, dtype=torch.float64)
        light = torch.deg2rad(torch.full_like(offset, degrees))
        viewer = torch.deg2rad(degrees + offset)
        wi = from_spherical(light, torch.zeros_like(light))
        wo = from_spherical(viewer, torch.full_like(light, torch.pi))
        for name, reflectance in (("raw", raw), ("straightened", straight)):
            values = {"measured": reflectance.evaluate(wi, wo), "swapped": reflectance.evaluate(wo, wi)}
            kept = {key: [round(float(v), 6) for v in value.mean(1)] for key, value in values.items()}
            found[f"{name} {degrees:g}"] = {"offset": [round(float(v), 3) for v in offset], **kept}
    return found


def _straightening(data: Path, file: Path) -> None:
    straightening.main(["--data", str(data), "--done", str(file)])


def _slices(data: Path, file: Path) -> None:
    kept = Finished(file)
    for key, found in slices(data).items():
        kept.get(key, lambda found=found: found)


def _search(data: Path, file: Path) -> None:
    real_measurements.main(["--data", str(data), "--done", str(file)])


def _time(data: Path, file: Path) -> None:
    error_against_time.main(["--data", str(data), "--work", str(file)])


def _relighting(data: Path, file: Path) -> None:
    given = ["--data", str(data), "--work", str(file), "--meshes", MESH, "--pixels", str(PIXELS)]
    given += ["--kept", str(COEFFICIENTS), "--sun", "texels", "--materials"]
    relight_lobes.main([*given, ",".join(RELIT)])
    relight_lobes.main([*given, ",".join(GLOSSY), "--lobe", "factored", "--terms", str(FACTORED_TERMS)])


# Each experiment: how it is measured, and the program to name for it.
EXPERIMENTS: dict[str, tuple[Callable[[Path, Path], None], str]] = {
    STRAIGHTENING: (_straightening, "scripts/accuracy/straightening.py"),
    SLICES: (_slices, "scripts/papers/small_textures.py --anew slices"),
    SEARCH: (_search, "scripts/compression/real_measurements.py"),
    TIME: (_time, "scripts/speed/error_against_time.py"),
    RELIGHTING: (_relighting, "scripts/relighting/relight_lobes.py"),
}


@dataclass(frozen=True)
class Results:
    """All experiments of the study: rows by key as their programs keep them, and under which conditions they ran."""

    straightening: Mapping[str, dict[str, Any]]
    slices: Mapping[str, dict[str, list[float]]]
    search: Table
    time: Mapping[str, dict[str, dict[str, float]]]
    relighting: Mapping[str, dict[str, Any]]
    conditions: Mapping[str, dict[str, str]]

    def relit(self, name: str, terms: int | None = None) -> dict[str, Any]:
        """The row of a material that is relit: as homofact chooses, or with in-out factors alone."""
        lobe = "auto" if terms is None else "factored"
        return self.relighting[relight_lobes.key_of(MESH, name, lobe, terms, COEFFICIENTS, PIXELS, "texels")]


def read(folder: Path) -> Results:
    """The kept results in a folder. Raises BadInput where a file is missing or an experiment is incomplete."""
    found = {name: dict(_lines(folder, name).items()) for name in (*EXPERIMENTS, CONDITIONS)}
    finished = _lines(folder, SEARCH)
    rows = real_measurements.rows_of(finished, _subjects(finished), LABELS)
    complete = _complete(found[TIME])
    if not complete:
        raise BadInput(where=str(folder / f"{TIME}.jsonl"), found="no complete material", expected="one line per way")
    straight = {key.removesuffix("_rgb"): row for key, row in sorted(found[STRAIGHTENING].items())}
    results = Results(straight, found[SLICES], Table(rows), complete, found[RELIGHTING], found[CONDITIONS])
    for name in RELIT:
        for terms in (None, FACTORED_TERMS) if name in GLOSSY else (None,):
            try:
                results.relit(name, terms)
            except KeyError as error:
                where = str(folder / f"{RELIGHTING}.jsonl")
                raise BadInput(where=where, found=f"no line of {error.args[0]}", expected="one") from None
    return results


def measure(names: list[str], folder: Path, data: Path | None) -> None:
    """Measure experiments again; an ended run goes on, and a file is replaced when its experiment is complete."""
    source = data_folder(data)
    for name in names:
        run, program = EXPERIMENTS[name]
        fresh = folder / f"{name}.new.jsonl"
        run(source, fresh)
        fresh.replace(folder / f"{name}.jsonl")
        note(folder, name, program, machine())


def note(folder: Path, name: str, program: str, where: str) -> None:
    """Write under which conditions an experiment ran."""
    kept = dict(Finished(folder / f"{CONDITIONS}.jsonl").items())
    day = datetime.date.today().isoformat()
    kept[name] = {"command": f"python {program}", "machine": where, "date": day, "note": ""}
    (folder / f"{CONDITIONS}.jsonl").unlink(missing_ok=True)
    again = Finished(folder / f"{CONDITIONS}.jsonl")
    for key, value in sorted(kept.items()):
        again.keep(key, value)


def _lines(folder: Path, name: str) -> Finished:
    file = folder / f"{name}.jsonl"
    if name == SEARCH and not file.is_file():
        file = PUBLISHED_LINES
    if not file.is_file():
        raise BadInput(where=str(file), found="no such file", expected="kept results, or --anew to measure them")
    return Finished(file)


def _complete(rows: Mapping[str, Any]) -> dict[str, dict[str, dict[str, float]]]:
    """The materials that were fitted by every way, so that medians are over the same materials."""
    first, *rest = error_against_time.WAYS
    names = [key.removesuffix(f" {first}") for key in rows if key.endswith(f" {first}")]
    return {
        name: {way: rows[f"{name} {way}"] for way in (first, *rest)}
        for name in names
        if all(f"{name} {way}" in rows for way in rest)
    }


def _subjects(finished: Finished) -> list[Subject]:
    """The materials of a file of results with their groups; the measurements themselves may be absent."""
    groups = {"carpaint_red": CAR_PAINT, "retro-3M-jaune": TAPE, **dict.fromkeys(CORNELL, PAINTS)}
    names = dict.fromkeys(key.split(" | ")[0] for key, _ in finished.items())
    return [Subject(name, Path(), groups.get(name, RGL)) for name in names]
