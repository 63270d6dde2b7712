"""Make the tables of the comparison with published compressions from its entries (`compression_fits.Entry`)."""

import math
import statistics
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import METHODS, READINGS, Entry
from scripts.compression.compression_protocol import MORE_IS_BETTER, SCORES, pairs
from scripts.compression.compression_speed import median_of
from scripts.data.published_fits import PUBLISHED
from scripts.shared.harness import figure, markdown

# The order of Sztrajman et al. 2021, table 1, from the worst to the best.
PUBLISHED_ORDER = ("GGX × 1", "sgd", "abc", "npf", "nbrdf")
# Which of ours stands against a method: the one of its bytes or, of what has fewer than any of ours, the smallest.
AGAINST = {label: "ours 3.2 KiB" for label in (*PUBLISHED, *METHODS) if not label.startswith("ours")} | {
    "McCool 12 KiB": "ours 12 KiB"
}
# The criteria by which ours is to be ahead.
CRITERIA = ("MALE", "energy", "PSNR")
# Two figures are level within this share of the other's, PSNR within so many dB.
LEVEL, LEVEL_DB = 0.02, 0.1
Test = Callable[[Entry], bool]


def worse_tenth(name: str, values: Iterable[float]) -> float:
    """The value that a tenth of the materials is worse than."""
    ordered = sorted(values, reverse=name in MORE_IS_BETTER)
    return ordered[round(0.9 * (len(ordered) - 1))]


def both(name: str, those: Sequence[Entry]) -> str:
    """Median (worse tenth) of a score."""
    values = [e.scores[name] for e in those]
    return f"{figure(statistics.median(values))} ({figure(worse_tenth(name, values))})"


def materials(those: Sequence[Entry]) -> int:
    """Of how many materials they are."""
    return len({e.material for e in those})


def table(found: Sequence[Entry], test: Test) -> str:
    """Median and worse tenth over materials of what passes, a method a row."""
    rows = []
    for label in dict.fromkeys((*PUBLISHED, *METHODS)):
        for several in (1, 2):
            those = [e for e in found if e.label == label and len(e.readings) == several and test(e)]
            if not those:
                continue
            words = label + (" (mean of two proxies)" if several == 2 else "")
            seconds = [e.shown.seconds for e in those if not math.isnan(e.shown.seconds)]
            spent = figure(statistics.median(seconds)) if seconds else "–"
            nbytes = f"{statistics.median(e.shown.nbytes for e in those):.0f}"
            fetches = f"{statistics.median(e.shown.fetches for e in those):.0f}"
            columns = (both(name, those) for name in SCORES)
            rows.append((words, materials(those), nbytes, fetches, *columns, spent))
    return markdown(("method", "materials", "bytes", "fetches", *SCORES, "fit, s"), rows)


def added(found: Sequence[Entry]) -> str:
    """Each reading beside ours fitted to it, judged by the two others."""
    rows = []
    for reading in READINGS:
        own = {(e.material, e.by): e for e in found if e.label == reading}
        if not own:
            continue
        rows.append(
            (f"{reading} itself", "–", *(x for name in CRITERIA for x in (both(name, list(own.values())), "–", "–")))
        )
        for label in METHODS:
            those = [e for e in found if e.label == label and e.readings == (reading,) and e.by != reading]
            if not those:
                continue
            cells: list[str] = []
            for name in CRITERIA:
                off = [e.scores[name] - own[e.material, e.by].scores[name] for e in those]
                nearer = statistics.fmean((x > 0) if name in MORE_IS_BETTER else (x < 0) for x in off)
                cells += [both(name, those), f"{statistics.median(off):+.2g}", f"{nearer:.0%}"]
            rows.append((f"{label} of {reading}", materials(those), *cells))
    heads = [x for name in CRITERIA for x in (name, "added by the fit", "fit better in")]
    return markdown(("", "materials", *heads), rows)


def ahead(found: Sequence[Entry]) -> tuple[str, str]:
    """(a table of ours against each other method at its bytes, judge by judge; where it is not ahead, in words)."""
    rows, behind, level, count = [], [], 0, 0
    for by in READINGS:
        for label, mine in AGAINST.items():
            theirs = [
                e for e in found if e.label == label and e.by == by and by not in e.readings and len(e.readings) == 1
            ]
            # What a reading becomes is compared with that reading, and everything else pooled over both.
            seen = {label} if label in READINGS else {r for e in theirs for r in e.readings} & set(READINGS)
            ours = [
                e for e in found if e.label == mine and e.by == by and by not in e.readings and len(e.readings) == 1
            ]
            ours = [e for e in ours if not seen or e.readings[0] in seen]
            shared = {e.material for e in theirs} & {e.material for e in ours}
            theirs, ours = ([e for e in those if e.material in shared] for those in (theirs, ours))
            if not shared:
                continue
            cells = []
            for name in CRITERIA:
                for words, of in (
                    ("median", statistics.median),
                    ("worse tenth", lambda x, name=name: worse_tenth(name, x)),
                ):
                    a, b = (of([e.scores[name] for e in those]) for those in (ours, theirs))
                    first = a > b if name in MORE_IS_BETTER else a < b
                    close = abs(a - b) <= (LEVEL_DB if name == "PSNR" else LEVEL * abs(b))
                    cell, count, level = f"{figure(a)} / {figure(b)}", count + 1, level + close
                    cells.append(f"{cell} ≈" if close else cell if first else f"**{cell}**")
                    if not first and not close:
                        behind.append((by, label, name, words))
            rows.append((by, label, mine.removeprefix("ours "), len(shared), *cells))
    heads = [f"{name}, {words}" for name in CRITERIA for words in ("median", "worse tenth")]
    text = markdown(("judged by", "against", "ours", "materials", *heads), rows, 2)
    summary = (
        f"homofact is ahead in {count - len(behind) - level} of {count} figures, level in {level} and behind in"
        f' {len(behind)}. "Level" (≈) means within {LEVEL:.0%}, or within {LEVEL_DB} dB of PSNR.'
        + (f" The figures in which homofact is behind are bold. {_behind_in_words(behind)}" if behind else "")
    )
    return text, summary


def _behind_in_words(behind: Sequence[tuple[str, str, str, str]]) -> str:
    """A sentence per judge on the figures (judge, method, criterion, "median" or "worse tenth") that are behind."""
    sentences = []
    for by in dict.fromkeys(row[0] for row in behind):
        parts = []
        for label in dict.fromkeys(row[1] for row in behind if row[0] == by):
            criteria: dict[str, list[str]] = {}
            for *_, name, words in (row for row in behind if row[:2] == (by, label)):
                criteria.setdefault(name, []).append(words)
            parts.append(f"behind {label} in {_listed([f'{n} ({_listed(words)})' for n, words in criteria.items()])}")
        *first, last = parts
        sentences.append(f"Judged by {by}, it is {', '.join(first)}{', and ' if first else ''}{last}.")
    return " ".join(sentences)


def _listed(items: Sequence[str]) -> str:
    *first, last = items
    return f"{', '.join(first)} and {last}" if first else last


def order(found: Sequence[Entry]) -> str:
    """Whether the published order comes out: the mean of each score, judged by what is not itself."""
    rows = []
    for label in PUBLISHED_ORDER:
        those = [e for e in found if e.label == label and len(e.readings) == 1 and e.by not in e.readings]
        if those:
            rows.append(
                (label, materials(those), *(figure(statistics.fmean(e.scores[n] for e in those)) for n in SCORES))
            )
    return markdown(("worst first, as published", "materials", *SCORES), rows)


ZONES = ((0, 5), (5, 15), (15, 40), (40, 90))


def zones(found: Sequence[Entry], truth: Callable[[str], torch.Tensor], by: str) -> str:
    """By the half vector's angle: median over materials of mean |log f̂/f|, and the share that is over twice f, or
    under a half."""
    wi, wo = pairs()
    theta = torch.rad2deg(torch.acos(((wi + wo)[:, 2] / (wi + wo).norm(dim=1)).clamp(-1, 1)))
    rows = []
    for label in PUBLISHED_ORDER:
        those = [e for e in found if e.label == label and len(e.readings) == 1 and e.by == by and by not in e.readings]
        if not those:
            continue
        cells = []
        for low, high in ZONES:
            inside = (theta >= low) & (theta < high)
            ratios = [
                (e.shown.values[inside].clamp_min(1e-6) / truth(e.material)[inside].clamp_min(1e-6)).log()
                for e in those
            ]
            off = statistics.median(float(r.abs().mean()) for r in ratios)
            wide = statistics.fmean(float((r.abs() > math.log(2)).double().mean()) for r in ratios)
            cells.append(f"{figure(off)} ({wide:.0%})")
        rows.append((label, *cells))
    return markdown(("", *(f"θh {low} to {high}°" for low, high in ZONES)), rows)


def speeds(rows: Sequence[dict[str, str]]) -> str:
    """Millions of evaluations a second, a method a row."""
    lines = []
    for label in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == label]
        rates = [float(row["millions a second"]) for row in own]
        nbytes = statistics.median(float(row["bytes"]) for row in own)
        network = median_of(list(rows), "nbrdf")
        times = "–" if not network else figure(statistics.median(rates) / network)
        lines.append((label, own[0]["compiler"], f"{nbytes:.0f}", figure(statistics.median(rates)),
                      f"{figure(min(rates))} to {figure(max(rates))}", times))  # fmt: skip
    return markdown(("method", "compiler", "bytes", "M/s", "by material", "times nbrdf"), lines, 2)


def seeds(rows: Sequence[dict[str, str]]) -> str:
    """Ours by seed: the mean over seeds with the sample standard deviation, on the reading and by the others."""
    lines = []
    for material, label in dict.fromkeys((row["material"], row["method"]) for row in rows):
        own = [row for row in rows if (row["material"], row["method"]) == (material, label)]
        cells = []
        for name in ("MALE", "energy", "PSNR", "MALE of others", "PSNR of others"):
            values = [float(row[name]) for row in own]
            cells.append(f"{figure(statistics.fmean(values))} ± {statistics.stdev(values):.2g}")
        lines.append((material, label, len(own), *cells))
    heads = ("MALE", "energy", "PSNR", "MALE by others", "PSNR by others")
    return markdown(("material", "method", "seeds", *heads), lines, 2)
