"""Compute the numbers in the text of the study of small textures, and check the comparisons in its sentences.

A number of the text is a macro of `numbers.tex`. A sentence that compares ("lower on all files") is in `claims` with
the results that it rests on, so that results which are measured again show which sentences no longer hold.
"""

import math
import statistics
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from homofact.brdf.quality import tilt, tilt_finding
from homofact.brdf.source import MEASURED_EPSILON, NOISE_FREE_EPSILON
from homofact.relighting.factored_material import MOST_REST, MOST_SHARED

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy import known_mixes
from scripts.compression.compression_protocol import PAIRS, STEEPEST_DEGREES
from scripts.compression.real_fits import (
    BOUND,
    CAR_PAINT,
    HELD_OUT,
    LABELS,
    NBRDF,
    OURS,
    PAINTS,
    RAW,
    RGL,
    RINGS,
    SAMPLES,
    SEED,
    STRAIGHT,
)
from scripts.compression.real_measurements import COUNT
from scripts.compression.real_tables import off, ratios
from scripts.papers.latex import Macros, figure, fixed, percent, words
from scripts.papers.small_results import (
    COEFFICIENTS,
    EXPERIMENTS,
    FACTORED_TERMS,
    GLOSSY,
    MESH,
    PIXELS,
    RELIT,
    SLICED,
    Results,
)
from scripts.papers.small_tables import NEAR_ALBEDO, NEAR_ENERGY, NEAR_FLOOR, SHAPES
from scripts.shared.harness import CORNELL
from scripts.speed.error_against_time import WAYS

TRAINED, HYBRID, NPF = "NBRDF, trained here", "hybrid, published", "NPF, fitted here"
_OURS = dict(zip(OURS, ("One", "Three", "Six", "Twelve"), strict=True))
_METHODS = {**_OURS, NBRDF: "Nbrdf", TRAINED: "Trained", HYBRID: "Hybrid", NPF: "Npf", BOUND: "Bound"}
_WAYS = dict(
    zip(WAYS, ("Quick", "Three", "Normal", "Every", "Cole", "McCool", "Ggx", "Npf", "Nbrdf"), strict=True)
)  # fmt: skip
FLAKES = ("irid_flake_paint1_fine", "irid_flake_paint1")


def numbers(results: Results) -> Macros:
    """All macros of the text."""
    macros = Macros()
    _conditions(macros, results)
    _tilts(macros, results)
    _search(macros, results)
    _time(macros, results)
    _relighting(macros, results)
    return macros


def claims(results: Results) -> list[tuple[str, bool]]:
    """The comparisons that sentences of the text make, and whether the results bear them out."""
    table, names = results.search, results.search.materials(RGL)

    def middle(label: str, name: str, way: str = RAW, against: str = "own") -> float:
        return statistics.median(table.values(names, way, label, name, against))

    three, time = OURS[1], {way: _median(results, way, "error") for way in WAYS}
    seconds = {way: _median(results, way, "seconds") for way in WAYS}
    large, small = (_ratios(results, shape) for shape in reversed(SHAPES))
    separate, factored = (_relit_errors(results, terms) for terms in (None, FACTORED_TERMS))
    return [
        ("every undone tilt lowers the floor of reciprocal fits", all(b < a for a, b in _floors(results))),
        ("straightening lowers the median error of the larger fits", statistics.median(large) < 1),
        ("straightening does not lower the error of every fit", max(*large, *small) > 1),
        ("the intervals of both variants of the flake paint overlap", _overlap(results, *FLAKES)),
        ("at 3.2 KiB fewer straightened than raw files are near their floor",
         _near_floor(results, three, STRAIGHT) < _near_floor(results, three, RAW)),
        ("at 6 KiB ours has the smallest MALE of unseen samples and rings",
         _leading(results, OURS[2])),
        ("at 3.2 KiB MALE is lower than the published network's on every raw file",
         all(each < 1 for each in ratios(table, names, three, RAW))),
        ("at 1 KiB it is not lower on every raw file", any(each > 1 for each in ratios(table, names, OURS[0], RAW))),
        ("at 3.2 KiB the median PSNR under St Peter's is above the network's",
         middle(three, "PSNR, St Peter's") > middle(NBRDF, "PSNR, St Peter's")),
        ("at 1 KiB the network that is trained here has the smaller median RMS",
         middle(TRAINED, "RMS") < middle(OURS[0], "RMS")),
        ("at 3.2 KiB the median RMS is below that of the network trained here",
         middle(three, "RMS") < middle(TRAINED, "RMS")),
        ("the larger one of the car paint's worst albedo errors is ours at 3.2 KiB",
         _car(results, three, "albedo") > _car(results, TRAINED, "albedo")),
        ("both searches of known mixes take less processor time than all other methods but McCool's",
         all(max(seconds["search, quick"], seconds["search, normal"]) < seconds[way]
             for way in ("search, every mix", "cole", "ggx:2", "npf", "nbrdf"))),
        ("the normal search has a smaller Cole error than Cole's, McCool's, NPF and two GGX lobes",
         all(time["search, normal"] < time[way] for way in ("cole", "mccool", "npf", "ggx:2"))),
        ("the separate lobe has the smaller median error of glossy materials",
         statistics.median(separate) < statistics.median(factored)),
        ("a view takes longer with the separate lobe, and a new light less",
         all(results.relit(n)["views"] < results.relit(n, FACTORED_TERMS)["views"] and
             results.relit(n)["skies"] > results.relit(n, FACTORED_TERMS)["skies"] for n in GLOSSY)),
        ("every glossy material of the study has a separate lobe", all(results.relit(n)["separate"] for n in GLOSSY)),
        ("the matt material has none", not results.relit(RELIT[0])["separate"]),
    ]  # fmt: skip


def _conditions(macros: Macros, results: Results) -> None:
    macros.add("pairs", f"{COUNT:,}".replace(",", "{,}"))
    macros.add("heldOut", percent(HELD_OUT, 0))
    macros.add("seedUsed", SEED)
    macros.add("epsilonMeasured", _power(MEASURED_EPSILON))
    macros.add("epsilonModels", _power(NOISE_FREE_EPSILON))
    machines = {each["machine"] for each in results.conditions.values()}
    macros.add("machineUsed", words("; or ".join(sorted(machines))))
    for name in EXPERIMENTS:
        macros.add(f"date{name.capitalize()}", results.conditions[name]["date"])
        # Typewriter fonts would join two hyphens.
        macros.add(f"command{name.capitalize()}", words(results.conditions[name]["command"]).replace("--", "-{}-"))
        macros.add(f"note{name.capitalize()}", words(results.conditions[name]["note"]))
    for label, name in _OURS.items():
        macros.add(f"budget{name}", words(label.removeprefix("ours ")))
    for shape, name in SHAPES.items():
        macros.add(f"{name}Shape", words(shape))
    macros.add("malePairs", f"{PAIRS:,}".replace(",", "{,}"))
    macros.add("maleLimit", f"{STEEPEST_DEGREES:g}")
    macros.add("tiltPairs", f"{tilt.PAIRS:,}".replace(",", "{,}"))
    macros.add("tiltBlocks", tilt_finding.BLOCKS)
    macros.add("tiltLimit", f"{math.degrees(tilt.LIMIT):.0f}")
    macros.add("tiltSearched", f"{tilt_finding.SEARCHED:g}")
    macros.add("tiltLeast", f"{tilt_finding.LEAST:g}")
    macros.add("tiltGain", percent(tilt_finding.LEAST_GAIN, 0))
    for name, kept in zip(("One", "Two", "Three"), known_mixes.KEPT, strict=True):
        macros.add(f"mixes{name}", kept)
    macros.add("nearFloor", f"{NEAR_FLOOR:g}")
    macros.add("nearEnergy", percent(NEAR_ENERGY, 0))
    macros.add("nearAlbedo", percent(NEAR_ALBEDO, 0))


def _tilts(macros: Macros, results: Results) -> None:
    rows = results.straightening
    undone = {name: row for name, row in rows.items() if row["tilt"]["undone"]}
    angles = [abs(row["tilt"]["in_plane"]["degrees"]) for row in undone.values()]
    macros.add("rglCount", len(rows))
    macros.add("tiltUndone", len(undone))
    macros.add("tiltMin", fixed(min(angles), 3))
    macros.add("tiltMax", fixed(max(angles), 3))
    floors = dict(zip(undone, _floors(results), strict=True))
    best = min(floors, key=lambda name: floors[name][1] / floors[name][0])
    macros.add("floorFall", fixed(statistics.median(after / before for before, after in floors.values()), 2))
    macros.add("bestName", words(best))
    macros.add("bestBefore", fixed(floors[best][0], 3))
    macros.add("bestAfter", fixed(floors[best][1], 3))
    macros.add("slicedName", words(SLICED))
    macros.add("slicedTilt", f"{rows[SLICED]['tilt']['in_plane']['degrees']:+.2f}")  # stands in mathematics
    for shape, name in SHAPES.items():
        found = _ratios(results, shape)
        macros.add(f"{name}Lower", sum(each < 1 for each in found))
        macros.add(f"{name}Ratio", fixed(statistics.median(found), 2))
        macros.add(f"{name}Worst", fixed(max(found), 2))
        falls = [row["fits"][shape]["raw"]["lamp"] - row["fits"][shape]["straight"]["lamp"] for row in undone.values()]
        macros.add(f"{name}LampWorse", sum(each > 0 for each in falls))
        macros.add(f"{name}LampFall", fixed(max(0.0, *falls), 1))
        kept = sum(row["fits"][shape]["straight"]["reciprocal"] for row in undone.values())
        macros.add(f"{name}Reciprocal", kept)


def _search(macros: Macros, results: Results) -> None:
    table, names = results.search, results.search.materials(RGL)
    for label, name in _METHODS.items():
        of = {key: table.values(names, RAW, label, key) for key in ("MALE", "RMS", "PSNR, St Peter's", "albedo")}
        cost = {key: table.values(names, RAW, label, key, "cost") for key in ("bytes", "operations", "fetches")}
        macros.add(f"male{name}", figure(statistics.median(of["MALE"])))
        macros.add(f"rms{name}", figure(statistics.median(of["RMS"])))
        macros.add(f"psnr{name}", fixed(statistics.median(of["PSNR, St Peter's"]), 1))
        macros.add(f"albedo{name}", percent(statistics.median(off(each) for each in of["albedo"])))
        macros.add(f"albedoWorst{name}", percent(max(off(each) for each in of["albedo"])))
        if cost["bytes"]:
            for key, short in (("bytes", "bytes"), ("operations", "ops"), ("fetches", "fetches")):
                macros.add(f"{short}{name}", f"{statistics.median(cost[key]):.0f}")
    for label, name in _OURS.items():
        for way, against, short in ((RAW, "own", "Raw"), (STRAIGHT, "raw", "Cross")):
            found = ratios(table, names, label, way, against)
            macros.add(f"ratio{short}{name}", fixed(statistics.median(found), 2))
            macros.add(f"lower{short}{name}", sum(each < 1 for each in found))
        macros.add(f"floors{name}", _near_floor(results, label, STRAIGHT))
        for key, limit in (("energy", NEAR_ENERGY), ("albedo", NEAR_ALBEDO)):
            met = [off(each) <= limit for each in table.values(names, STRAIGHT, label, key)]
            macros.add(f"{key}Met{name}", sum(met))
    for label, name in ((OURS[1], "Three"), (OURS[3], "Twelve"), (TRAINED, "Trained")):
        macros.add(f"car{name}", percent(off(_car(results, label, "albedo")), 0))


def _time(macros: Macros, results: Results) -> None:
    macros.add("timeMaterials", len(results.time))
    macros.add("timeAll", len(known_mixes.MEASURED) + len(CORNELL))
    for way, name in _WAYS.items():
        macros.add(f"seconds{name}", figure(_median(results, way, "seconds")))
        macros.add(f"cole{name}", figure(_median(results, way, "error")))


def _relighting(macros: Macros, results: Results) -> None:
    macros.add("relitPixels", PIXELS)
    macros.add("relitKept", COEFFICIENTS)
    macros.add("relitMesh", words(MESH))
    macros.add("relitTerms", FACTORED_TERMS)
    macros.add("mostShared", MOST_SHARED)
    macros.add("mostRest", MOST_REST)
    for terms, name in ((None, "Separate"), (FACTORED_TERMS, "Factored")):
        errors = _relit_errors(results, terms)
        rows = [results.relit(each, terms) for each in GLOSSY]
        macros.add(f"relit{name}Median", percent(statistics.median(errors)))
        macros.add(f"relit{name}Worst", percent(max(errors)))
        macros.add(f"relit{name}Store", f"{statistics.median(row['MB'] for row in rows):.0f}")
        macros.add(f"relit{name}Seconds", figure(statistics.median(row["CPU seconds"] for row in rows)))
    for key, name in (("views", "View"), ("skies", "Sky")):
        slower = [results.relit(each, FACTORED_TERMS)[key] / results.relit(each)[key] for each in GLOSSY]
        macros.add(f"relit{name}Ratio", f"{float(f'{statistics.median(slower):.2g}'):g}")
    macros.add("relitRestTerms", max(results.relit(each)["terms"] for each in GLOSSY))
    matt = results.relit(RELIT[0])["errors"]
    macros.add("mattWorst", percent(max(matt.values())))
    macros.add("mattSky", words(max(matt, key=lambda sky: matt[sky])))


def _floors(results: Results) -> list[tuple[float, float]]:
    """The floor of reciprocal fits before and after, of files with an undone tilt."""
    firsts = (
        next(iter(row["fits"].values()))["straight"] for row in results.straightening.values() if row["tilt"]["undone"]
    )
    return [(each["raw floor"], each["floor"]) for each in firsts]


def _ratios(results: Results, shape: str) -> list[float]:
    """Error of the fit to the straightened measurement over that of the fit to the raw one, of undone tilts."""
    found: list[Mapping[str, Any]] = [
        row["fits"][shape] for row in results.straightening.values() if row["tilt"]["undone"]
    ]
    return [each["straight"]["straight"] / each["raw"]["straight"] for each in found]


def _overlap(results: Results, first: str, second: str) -> bool:
    """Whether the intervals of two files' tilts have an angle in common."""
    (low, high), (least, most) = (
        results.straightening[name]["tilt"]["in_plane"]["interval"] for name in (first, second)
    )
    return low <= most and least <= high


def _near_floor(results: Results, label: str, way: str) -> int:
    """On how many RGL files a method's RMS is within `NEAR_FLOOR` of its floor."""
    table, names = results.search, results.search.materials(RGL)
    pairs = zip(*(table.values(names, way, label, key) for key in ("RMS", "floor")), strict=True)
    return sum(error <= NEAR_FLOOR * floor for error, floor in pairs)


def _leading(results: Results, label: str) -> bool:
    """Whether a method has the least MALE on Cornell's paints, of left-out samples and of left-out rings."""
    table, found = results.search, []
    for name in table.materials(PAINTS):
        for way in (SAMPLES, RINGS):
            others = [table.values([name], way, each, "MALE") for each in LABELS if each not in OURS]
            (own,) = table.values([name], way, label, "MALE")
            found.append(all(own < value for values in others for value in values))
    return all(found)


def _median(results: Results, way: str, key: str) -> float:
    return statistics.median(each[way][key] for each in results.time.values())


def _car(results: Results, label: str, name: str) -> float:
    return _value(results, results.search.materials(CAR_PAINT), RAW, label, name)


def _value(results: Results, names: Sequence[str], way: str, label: str, name: str) -> float:
    (value,) = results.search.values(names, way, label, name)
    return value


def _relit_errors(results: Results, terms: int | None) -> list[float]:
    return [error for name in GLOSSY for error in results.relit(name, terms)["errors"].values()]


def _power(value: float) -> str:
    """A power of ten as mathematics."""
    return rf"\ensuremath{{10^{{{round(math.log10(value))}}}}}"
