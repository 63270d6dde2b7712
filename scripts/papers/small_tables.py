"""Make the tables of the study of small textures as booktabs tabulars from the stored results."""

import statistics
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.real_fits import BOUND, LABELS, OURS, PAINTS, PUBLISHED, RAW, RGL, RINGS, SAMPLES, STRAIGHT
from scripts.compression.real_tables import off, ratios
from scripts.papers.latex import NONE, booktabs, figure, fixed, percent, words
from scripts.papers.small_results import FACTORED_TERMS, GLOSSY, RELIT, Results
from scripts.speed.error_against_time import WAYS

SHAPES = {"2 × 16²": "small", "3 × 32²": "large"}
NEAR_FLOOR, NEAR_ENERGY, NEAR_ALBEDO = 1.25, 0.01, 0.10


def ours(label: str) -> str:
    """A method as the paper calls it."""
    return words(label.replace("ours", "homofact"))


def tilts(results: Results) -> str:
    """The tilt of every file, whether it is undone, and what that does to the lack of reciprocity."""
    rows = []
    for name, row in results.straightening.items():
        angle, fits = row["tilt"]["in_plane"], row["fits"]
        first = next(iter(fits.values()))["straight"]
        low, high = angle["interval"]
        rows.append((
            words(name), fixed(angle["degrees"], 3, sign=True),
            f"{fixed(low, 3, sign=True)} to {fixed(high, 3, sign=True)}", "yes" if row["tilt"]["undone"] else "no",
            fixed(angle["misfit"], 3), fixed(angle["misfit_undone"], 3), fixed(angle["misfit_of_the_table"], 3),
            fixed(first["raw floor"], 3), fixed(first["floor"], 3),
        ))  # fmt: skip
    head = (
        "file", r"$\delta$, $^\circ$", r"95\% interval", "undone", "$e(0)$", r"$e(\delta)$", "table",
        "floor", "straight",
    )  # fmt: skip
    return booktabs(head, rows)


def straightened_fits(results: Results) -> str:
    """Errors of fits to the raw and to the straightened measurement, both held against the straightened one."""
    rows = []
    for name, row in results.straightening.items():
        if not row["tilt"]["undone"]:
            continue
        cells = []
        for shape in SHAPES:
            both = row["fits"][shape]
            cells += [fixed(both["raw"]["straight"], 3), fixed(both["straight"]["straight"], 3)]
            cells += [fixed(both["raw"]["lamp"], 1), fixed(both["straight"]["lamp"], 1)]
        floor = next(iter(row["fits"].values()))["straight"]["floor"]
        rows.append((words(name), fixed(floor, 3), *cells))
    four = ("raw", "straight", "dB, raw", "dB, straight")
    return booktabs(("file", "floor", *four, *four), rows)


def equal_bytes(results: Results) -> str:
    """Medians over the raw RGL files: a method a row."""
    table, names = results.search, results.search.materials(RGL)
    rows: list[tuple[str, ...] | None] = []
    for label in LABELS:
        if not table.values(names, RAW, label, "MALE"):
            continue

        def middle(
            name: str, digits: Callable[[float], str], against: str = "own", label: str = label, way: str = RAW
        ) -> str:
            values = table.values(names, way, label, name, against)
            return digits(statistics.median(values)) if values else NONE

        over = [
            a / b
            for a, b in zip(*(table.values(names, RAW, label, name) for name in ("RMS", "floor")), strict=True)
            if b > 0
        ]
        albedo = [off(value) for value in table.values(names, RAW, label, "albedo")]
        if label == OURS[0]:
            rows.append(None)
        rows.append((
            ours(label), middle("bytes", "{:.0f}".format, "cost"), middle("MALE", figure), middle("RMS", figure),
            fixed(statistics.median(over), 2), rf"{percent(statistics.median(albedo))} ({percent(max(albedo))})",
            middle("PSNR, St Peter's", "{:.1f}".format), middle("PSNR, lamp", "{:.1f}".format),
            middle("operations", "{:.0f}".format, "cost"), middle("fetches", "{:.0f}".format, "cost"),
        ))  # fmt: skip
    head = ("method", "bytes", "MALE", "RMS", "/floor", "albedo", "St Peter's", "lamp", "ops", "fetches")
    return booktabs(head, rows)


def straight_bytes(results: Results) -> str:
    """What each size of ours reaches, on raw and on straightened files."""
    table, names = results.search, results.search.materials(RGL)

    def reached(found: list[bool]) -> str:
        return f"{sum(found)}/{len(found)}"

    def floors(label: str, way: str) -> str:
        pairs = zip(*(table.values(names, way, label, name) for name in ("RMS", "floor")), strict=True)
        return reached([a <= NEAR_FLOOR * b for a, b in pairs])

    def near(name: str, limit: float) -> Callable[[str, str], str]:
        return lambda label, way: reached([off(value) <= limit for value in table.values(names, way, label, name)])

    def brief(label: str, way: str, against: str = "own") -> str:
        found = ratios(table, names, label, way, against)
        return f"{statistics.median(found):.2f} ({sum(value < 1 for value in found)}/{len(found)})"

    lines: list[tuple[str, Callable[[str], str]] | None] = [
        ("MALE / NBRDF's, raw files", lambda label: brief(label, RAW)),
        ("the same, fitted to straightened", lambda label: brief(label, STRAIGHT, "raw")),
        None,
    ]
    for way in (RAW, STRAIGHT):
        lines += [
            (f"RMS within {NEAR_FLOOR} of floor, {way}", lambda label, way=way: floors(label, way)),
            (f"energy within {NEAR_ENERGY:.0%}, {way}", lambda label, way=way: near("energy", NEAR_ENERGY)(label, way)),
            (f"albedo within {NEAR_ALBEDO:.0%}, {way}", lambda label, way=way: near("albedo", NEAR_ALBEDO)(label, way)),
        ]
    rows = [None if line is None else (words(line[0]), *(line[1](label) for label in OURS)) for line in lines]
    return booktabs(("", *(words(label.removeprefix("ours ")) for label in OURS)), rows)


def left_out(results: Results) -> str:
    """MALE and RMS at samples and rings of Cornell's paints that no fit has seen."""
    table, names = results.search, results.search.materials(PAINTS)
    columns = [(name, way) for name in names for way in (SAMPLES, RINGS)]
    rows: list[tuple[str, ...] | None] = []
    for label in (each for each in LABELS if each not in PUBLISHED and each != BOUND):
        found = [table.row(name, way, label) for name, way in columns]
        if label == OURS[0]:
            rows.append(None)
        cells = [
            text
            for row in found
            for text in ((NONE, NONE) if row is None else (figure(row.value("MALE")), figure(row.value("RMS"))))
        ]
        if any(found):
            rows.append((ours(label), *cells))
    short = {SAMPLES: "s.", RINGS: "r."}
    head = [rf"{words(name.split('_')[0])}, {short[way]}" for name, way in columns]
    return booktabs(("method", *(cell for each in head for cell in (each, "RMS"))), rows)


def time_spent(results: Results) -> str:
    """Medians of bytes, processor seconds and both errors, a way of fitting a row."""
    rows = []
    for way in WAYS:
        figures = [each[way] for each in results.time.values()]
        cells = [statistics.median(each[key] for each in figures) for key in ("bytes", "seconds", "error", "rms")]
        rows.append((words(named(way)), f"{cells[0]:.0f}", figure(cells[1]), figure(cells[2]), figure(cells[3])))
    return booktabs(("method", "bytes", "CPU s", "Cole error", "RMS"), rows)


def relit(results: Results) -> str:
    """Terms, storage, precomputing and the picture's error under each sky: as homofact chooses, and factors alone."""
    skies = list(results.relit(RELIT[0])["errors"])
    rows: list[tuple[str, ...] | None] = []
    for name in RELIT:
        for terms in (None, FACTORED_TERMS) if name in GLOSSY else (None,):
            row = results.relit(name, terms)
            way = "lobe apart" if row["separate"] else "factors"
            errors = (percent(row["errors"][sky]) for sky in skies)
            cost = (f"{row['terms']:.0f}", f"{row['MB']:.0f}", figure(row["CPU seconds"]))
            rows.append((words(name), way, *cost, *errors))
    return booktabs(("material", "way", "$K$", "MB", "CPU s", *(words(sky) for sky in skies)), rows, 2)


def named(way: str) -> str:
    """A way of the comparison by time as the paper calls it."""
    known = {"cole": "Cole", "mccool": "McCool", "ggx:2": "GGX × 2", "npf": "NPF", "nbrdf": "NBRDF"}
    return known.get(way, way)


TABLES: dict[str, Callable[[Results], str]] = {
    "tilts": tilts,
    "straightened_fits": straightened_fits,
    "equal_bytes": equal_bytes,
    "straight_bytes": straight_bytes,
    "left_out": left_out,
    "time": time_spent,
    "relit": relit,
}
