"""Simulate fits for `calibrate.py`. For each fit, store one line with its measured features and its true errors.

A store is a file of JSON lines, one a fit; what it holds is not fitted again. What is true comes from the clean
material alone: the error of the albedo at each angle (the largest |log| over the channels), of the highlight, of the
picture under the sky, and what is explained of logarithms.
"""

import json
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from homofact.brdf.quality.suspicion.suspects import suspicions
from homofact.brdf.source import MEASURED_EPSILON, Source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput, SolverFailure
from homofact.evaluation.appearance import Appearance, appearance
from homofact.evaluation.metrics import measure
from homofact.evaluation.split import Split
from homofact.evaluation.verdict.measuring import measured_figures
from homofact.methods.method import Method
from homofact.stability.cells import NeverEvaluated
from homofact.stability.fault import CasePart
from scripts.shared.harness import progress
from scripts.verdict.drawn_cases import DrawnCase, drawn_case

_LEAST_RATIO = 1e-6


def simulated(case: DrawnCase, held_out: float = HELD_OUT) -> Iterable[dict[str, Any]]:
    """The records of a case's fits; a refused one says so."""
    samples = case.samples
    known = {
        "part": case.part.value,
        "number": case.number,
        "material": case.name,
        "layout": case.layout,
        "fault": "" if case.fault is None else case.fault.name,
        "strength": case.strength,
        "right": case.right,
        "knowable": case.fault is None or case.fault.knowable,
    }
    truth = Source(case.name, "material", samples, case.material, MEASURED_EPSILON, 0.0)
    given = Source(case.name, "measurement", samples, NeverEvaluated(samples.channels), MEASURED_EPSILON, 0.0)
    suspected: dict[str, float] | None = None
    for method in case.methods:
        own = known | {"method": method.name, "settings": _named(method)}
        try:
            split = Split.of(given, held_out, case.number)
            train, test = split.parts(given)[0], split.test_samples(given)
            made = replace(method, epsilon=MEASURED_EPSILON, seed=case.number).fit(train)
        except (BadInput, SolverFailure) as error:
            yield own | {"refused": str(error)}
            continue
        fit = made.factorization
        turned = train.rotated_at_random(case.number)
        errors = (measure(fit, turned, fit.transform), measure(fit, test, fit.transform))
        figures = measured_figures(fit, made.report, train, test, errors, case.number)
        if suspected is None:
            suspected = {each.name: each.odds for each in suspicions(train, case.number)}
        seen = appearance(fit, truth)
        assert seen is not None
        yield own | {
            "status": made.report.status.value,
            "figures": figures.record(),
            "suspected": suspected,
            "truth": truth_of(seen),
        }


def truth_of(seen: Appearance) -> dict[str, Any]:
    """What is true of a fit: errors as |log| of fit over source, and of the picture as a share."""
    worst = [max(abs(_log(ratio)) for ratio in row) for row in seen.energy.albedo_ratio]
    return {
        "albedo": worst,
        "highlight": abs(_log(seen.energy.highlight)),
        "sky": seen.off_sky,
        "light": seen.off_light,
        "explained": seen.explained,
    }


def simulate(
    wanted: Iterable[tuple[CasePart, int]], folder: Path, store: Path, seed: int = 0, held_out: float = HELD_OUT
) -> list[dict[str, Any]]:
    """Fit the cases that the store lacks, and return all records of the wanted ones, in their order."""
    kept: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for record in read_store(store):
        kept.setdefault((record["part"], record["number"]), []).append(record)
    found = []
    for part, number in wanted:
        if (part.value, number) not in kept:
            case = drawn_case(part, number, folder, seed)
            progress(f"{part.value} {number}: {case.name}, {case.fault.name if case.fault else 'clean'}")
            records = list(simulated(case, held_out))
            with open(store, "a", encoding="utf-8") as file:
                # A case at once: one that was cut short is fitted again.
                file.write("".join(json.dumps(record, ensure_ascii=False) + "\n" for record in records))
            kept[part.value, number] = records
        found += kept[part.value, number]
    return found


def read_store(store: Path) -> list[dict[str, Any]]:
    """All whole records of a store; none where there is no file."""
    if not store.is_file():
        return []
    lines = store.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]


def _log(ratio: float) -> float:
    return math.log(min(max(ratio, _LEAST_RATIO), 1 / _LEAST_RATIO)) if not math.isnan(ratio) else math.inf


def _named(method: Method) -> str:
    words = f"{method.name} {method.most_textures} × {method.size}²"
    smoothing = vars(method).get("smoothing")
    usual = vars(type(method)()).get("smoothing")
    return words if smoothing == usual else f"{words}, smoothing {smoothing:g}"
