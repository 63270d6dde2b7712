"""Make the tables of the page on real measurements from finished fits (`real_measurements`)."""

import statistics
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.real_fits import (
    BOUND,
    BUDGETS,
    CAR_PAINT,
    HYBRID,
    LABELS,
    NBRDF,
    NONE_PUBLISHED,
    OURS,
    PUBLISHED,
    RAW,
    RGL,
    RINGS,
    SAMPLES,
    STRAIGHT,
)
from scripts.compression.real_judging import LIGHTS
from scripts.shared.harness import figure, markdown

NONE = "–"
# The size that is held against the network's 2700 bytes, and what is asked of ours (`targets`).
AGAINST = OURS[1]
HALF, NEAR_FLOOR, ALBEDO_MEDIAN, ALBEDO_WORST, ENERGY, DECIBELS = 0.5, 1.25, 0.05, 0.10, 0.01, 40.0
_RIVALS = (BOUND, NBRDF, "NBRDF, trained here", HYBRID, "NPF, fitted here", "GGX × 2")


@dataclass(frozen=True)
class Row:
    """A finished fit: `found` has its "cost", its figures ("own"), those against the raw measurement ("raw")."""

    material: str
    group: str
    way: str
    label: str
    found: dict[str, Any]

    def value(self, name: str, against: str = "own") -> float | None:
        """A figure, None where there is none."""
        return self.found.get(against, {}).get(name)


class Table:
    """Finished fits by material, way and method."""

    def __init__(self, rows: Iterable[Row]) -> None:
        """Of any rows; what was skipped has no figures."""
        self.rows = {(row.material, row.way, row.label): row for row in rows}
        self._tilted = {row.material for row in self.rows.values() if row.way == STRAIGHT}

    def materials(self, *groups: str) -> list[str]:
        """The materials of some groups, in the order of the rows."""
        return list(dict.fromkeys(row.material for row in self.rows.values() if row.group in groups))

    def row(self, material: str, way: str, label: str) -> Row | None:
        """A fit that has figures. Where no tilt was undone, the straightened measurement is the raw one."""
        found = self.rows.get((material, way, label))
        if way == STRAIGHT and material not in self._tilted:
            found = self.rows.get((material, RAW, label))
        return None if found is None or "own" not in found.found else found

    def values(self, names: Sequence[str], way: str, label: str, name: str, against: str = "own") -> list[float]:
        """A figure of all materials that have it."""
        rows = (self.row(material, way, label) for material in names)
        return [value for row in rows if row and (value := row.value(name, against)) is not None]

    def labels(self, names: Sequence[str], way: str) -> list[str]:
        """The methods that have a fit of one of the materials; what was published is a fit of the raw ones alone."""
        here = [label for label in LABELS if way != STRAIGHT or label not in PUBLISHED]
        return [label for label in here if any(self.row(name, way, label) for name in names)]


def percent(ratio: float) -> str:
    """How far a ratio is from 1, with its sign."""
    return f"{100 * (ratio - 1):+.1f}%"


def off(ratio: float) -> float:
    """How far a ratio is from 1."""
    return abs(ratio - 1)


def cell(values: Sequence[float], words: Callable[[float], str] = figure) -> str:
    """The median of what is there."""
    return words(statistics.median(values)) if values else NONE


def shares(values: Sequence[float]) -> str:
    """Median and worst of how far ratios are from 1: "3.1% (9.8%)"."""
    away = [off(value) for value in values]
    return f"{100 * statistics.median(away):.1f}% ({100 * max(away):.1f}%)" if away else NONE


def summary(table: Table, names: Sequence[str], way: str) -> str:
    """A method a row: the median over materials of errors, light, pictures and cost."""
    lines = []
    for label in table.labels(names, way):

        def of(name: str, against: str = "own", label: str = label) -> list[float]:
            return table.values(names, way, label, name, against)

        over = [a / b for a, b in zip(of("RMS"), of("floor"), strict=True) if b > 0]
        lines.append((
            label, len(of("MALE")), cell(of("bytes", "cost"), "{:.0f}".format), cell(of("MALE")), cell(of("RMS")),
            cell(over, "{:.2f}".format), shares(of("albedo")), shares(of("energy")), shares(of("highlight")),
            *(cell(of(f"PSNR, {light}"), "{:.1f}".format) for light in LIGHTS),
            *(cell(of(name, "cost"), "{:.0f}".format) for name in ("operations", "scalar operations", "fetches")),
            cell(of("seconds", "cost")),
        ))  # fmt: skip
    heads = ("method", "materials", "bytes", "MALE", "RMS", "over floor", "albedo", "energy", "highlight")
    costs = ("operations", "scalar", "fetches", "fit, s")
    return markdown((*heads, *(f"PSNR, {light}" for light in LIGHTS), *costs), lines)


def looks(table: Table, names: Sequence[str], way: str) -> str:
    """A method a row: the median SSIM and FLIP under each light."""
    lines = [
        (label, *(cell(table.values(names, way, label, f"{kind}, {light}"), "{:.4f}".format)
                  for kind in ("SSIM", "FLIP") for light in LIGHTS))
        for label in table.labels(names, way)
    ]  # fmt: skip
    return markdown(("method", *(f"{kind}, {light}" for kind in ("SSIM", "FLIP") for light in LIGHTS)), lines)


def ratios(table: Table, names: Sequence[str], label: str, way: str, against: str = "own") -> list[float]:
    """MALE of one of ours over that of the published network, both as they are fitted: it to the raw measurement."""
    found = []
    for name in names:
        own, theirs = table.row(name, way, label), table.row(name, RAW, NBRDF)
        if own and theirs:
            value = own.value("MALE", against) if own.way == way else own.value("MALE")
            if value is not None:
                found.append(value / float(theirs.value("MALE") or 1))
    return found


def lower(values: Sequence[float]) -> str:
    """Median ratio, and on how many materials it is below 1."""
    if not values:
        return NONE
    return f"{statistics.median(values):.2f}, lower on {sum(value < 1 for value in values)} of {len(values)}"


def equal_bytes(table: Table, names: Sequence[str], way: str) -> str:
    """MALE, a material a row: rivals, ours at every size, and ours at 3.2 KiB over the published network."""
    labels = [label for label in (*_RIVALS, *OURS) if label in table.labels(names, RAW)]
    lines = []
    for name in names:
        cells = []
        for label in labels:
            row = table.row(name, way if label in (*OURS, BOUND) else RAW, label)
            cells.append(NONE if row is None else figure(float(row.value("MALE") or 0)))
        lines.append((name, *cells, cell(ratios(table, [name], AGAINST, way), "{:.2f}".format)))
    medians = (cell(table.values(names, way if label in (*OURS, BOUND) else RAW, label, "MALE")) for label in labels)
    lines.append(("**median**", *medians, lower(ratios(table, names, AGAINST, way))))
    return markdown(("MALE", *labels, f"{AGAINST} / {NBRDF}"), lines)


def albedo(table: Table, names: Sequence[str], way: str) -> str:
    """The worst albedo, a material a row, with its angle and channel."""
    labels = [label for label in (NBRDF, *OURS) if label in table.labels(names, RAW)]

    def ways(label: str) -> str:
        return way if label in OURS else RAW

    lines = []
    for name in names:
        rows = [table.row(name, ways(label), label) for label in labels]
        lines.append((
            name,
            *(NONE if row is None else f"{percent(float(row.value('albedo') or 0))} ({row.value('albedo at')})"
              for row in rows),
        ))  # fmt: skip
    lines.append(
        ("**median (worst)**", *(shares(table.values(names, ways(label), label, "albedo")) for label in labels))
    )
    return markdown(("worst albedo", *labels), lines)


def targets(table: Table, names: Sequence[str]) -> str:
    """Our targets and the results of each size, on straightened measurements where there is one."""

    def of(name: str, label: str) -> list[float]:
        return table.values(names, STRAIGHT, label, name)

    def count(values: Sequence[bool]) -> str:
        return f"{sum(values)} of {len(values)}" if values else NONE

    def floors(label: str) -> list[bool]:
        return [a <= NEAR_FLOOR * b for a, b in zip(of("RMS", label), of("floor", label), strict=True)]

    lines: list[tuple[str, Callable[[str], str]]] = [
        (f"MALE over published NBRDF's, both fitted to and judged on raw files: median ≤ {HALF}, lower on all",
         lambda label: lower(ratios(table, names, label, RAW))),
        ("the same, ours fitted to and judged on straightened files",
         lambda label: lower(ratios(table, names, label, STRAIGHT))),
        ("the same, ours fitted to straightened, judged on raw files",
         lambda label: lower(ratios(table, names, label, STRAIGHT, "raw"))),
        (f"RMS within {NEAR_FLOOR} of its floor", lambda label: count(floors(label))),
        (f"worst albedo within {ALBEDO_MEDIAN:.0%} (median), {ALBEDO_WORST:.0%} (worst)",
         lambda label: shares(of("albedo", label))),
        (f"energy within {ENERGY:.0%}", lambda label: count([off(x) <= ENERGY for x in of("energy", label)])),
        *((f"PSNR under {sky} ≥ {DECIBELS:.0f} dB",
           lambda label, sky=sky: count([x >= DECIBELS for x in of(f"PSNR, {sky}", label)]))
          for sky in ("St Peter's", "Grace")),
    ]  # fmt: skip
    return markdown(("target", *BUDGETS), [(words, *(found(label) for label in OURS)) for words, found in lines])


def at_samples(table: Table, names: Sequence[str]) -> str:
    """MALE and RMS of scattered samples that were left out: a method a row."""
    columns = [
        (name, way) for name in names for way in (SAMPLES, RINGS) if any(table.row(name, way, each) for each in LABELS)
    ]
    lines = []
    for label in LABELS:
        rows = [table.row(name, way, label) for name, way in columns]
        if any(rows):
            cells = (
                NONE
                if row is None
                else f"{figure(float(row.value('MALE') or 0))}; {figure(float(row.value('RMS') or 0))}"
                for row in rows
            )
            nbytes = next(row.value("bytes", "cost") for row in rows if row)
            lines.append((label, f"{nbytes or 0:.0f}", *cells))
    return markdown(("MALE; RMS", "bytes", *(f"{name}, {way}" for name, way in columns)), lines)


def missing(table: Table) -> list[str]:
    """Which methods have no fit, and why, a reason a line."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for row in table.rows.values():
        if "skipped" in row.found and row.found["skipped"] != NONE_PUBLISHED:
            names = reasons.setdefault((row.label, row.found["skipped"]), [])
            if row.material not in names:
                names.append(row.material)
    absent = [label for label in LABELS if label not in {row.label for row in table.rows.values()}]
    reasons |= {(", ".join(absent), "not fitted yet"): ["all materials"]} if absent else {}
    return [f"- {label}, {', '.join(names)}: {why}." for (label, why), names in reasons.items()]


def groups(table: Table) -> tuple[list[str], list[str]]:
    """(the RGL materials, the car paint) that have rows."""
    return table.materials(RGL), table.materials(CAR_PAINT)
