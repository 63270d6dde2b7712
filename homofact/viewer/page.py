"""What `homofact view` and an export to HTML have in common: a fit and its source become one page.

The page shows the fit, McCool's projections fitted at the same size and ε, and the source, with the errors of both
fits on the same samples beside the pictures: those that neither has seen, where the fit's own split is known.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.evaluate.reopening import Reopened, parts, settings_of
from homofact.evaluate.wording import figure

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.errors import Report
    from homofact.evaluate.compare import Row
    from homofact.evaluate.metrics import SixErrors
    from homofact.factor.fitted import Fitted
    from homofact.viewer.mesh import Mesh
    from homofact.viewer.viewer import Facts

Stage = Callable[[str], None]
SHOWN = {"search": "Searched fit", "cole": "Cole's fit", "mccool": "McCool", "svd": "SVD", "nmf": "NMF"}


@dataclass(frozen=True)
class Page:
    """A page that was written: its `file` and `size` in bytes, the titles of its pictures, and its `record` for JSON.

    `reports` are how the fits ended that were made for the page, by title.
    """

    file: Path
    size: int
    titles: tuple[str, ...]
    record: dict[str, Any]
    reports: "dict[str, Report]"


def write_view(
    target: Path,
    fitted: "Fitted",
    source: "Reopened | str",
    *,
    report: dict[str, Any] | None = None,
    mesh: "Mesh | None" = None,
    stage: Stage = lambda name: None,
) -> Page:
    """Write the page of a fit to `target`; what is in it.

    `source` is what `cli.reopening.reopen` gave: the source, or words on why there is none, which the page repeats. Its
    errors and its verdict are then those of `report`, the result's own report.json, where it is given. `stage` is told
    what is being done. Raises BadInput for channels that cannot be shown, a source that cannot be, and a place that
    cannot be written.
    """
    from homofact.shading.program import name_of
    from homofact.viewer.layers import check_shown, fit_layer
    from homofact.viewer.viewer import source_layer, write_viewer

    check_shown(fitted.channels)
    report = report or {}
    method = str(fitted.provenance.get("method", ""))
    title = SHOWN.get(method, "Fit")
    record: dict[str, Any] = {}
    reports: dict[str, Any] = {}
    if isinstance(source, str):
        errors = _reported_errors(report)
        layers = [fit_layer(fitted, "fit", title, (*_verdict(report), *_error_facts(errors, "held out")))]
        notes = [f"The fit alone: {source}.", *_reported_note(errors)]
        name = name_of(fitted.provenance)
    else:
        measured = _measure(fitted, source)
        record["error"] = {"fit": {part: six.record() for part, six in measured.items()}}
        facts = _error_facts(record["error"]["fit"], _part(source))
        layers = [fit_layer(fitted, "fit", title, (*_verdict(report), *facts))]
        row = _mccool(fitted, source, stage)
        if row is not None:
            record["error"]["mccool"] = {"train": row.train.record(), "held_out": row.held_out.record()}
            facts = _error_facts(record["error"]["mccool"], _part(source))
            layers.append(fit_layer(row.factorization, "mccool", "McCool", (*_verdict(row.record()), *facts)))
            reports["McCool"] = row.report
        stage("tabulating the source")
        shown = source_layer(source.source.reflectance, facts=_own_facts(source.source), seed=source.seed)
        layers.append(shown)
        assert shown.table is not None
        table = shown.table.error
        record["table"] = {"median": table.median, "percentile_95": table.percentile_95, "nodes": shown.table.size}
        notes = _conditions(fitted, source, row is not None)
        name = source.source.name
    stage("writing")
    target.parent.mkdir(parents=True, exist_ok=True)
    size = write_viewer(target, layers, title=name, subtitle=_subtitle(fitted), mesh=mesh, notes=notes)
    record = {
        "file": str(target),
        "file_bytes": size,
        "layers": [layer.key for layer in layers],
        "mesh": None if mesh is None else mesh.name,
        "source": None if isinstance(source, str) else source.source.name,
        "split_known": None if isinstance(source, str) else source.known,
        **record,
        "notes": notes,
    }
    return Page(target, size, tuple(layer.title for layer in layers), record, reports)


def read_report(folder: Path) -> dict[str, Any]:
    """The report.json of a result's folder; empty where there is none that can be read."""
    from homofact.export.result import REPORT

    try:
        found = json.loads((folder / REPORT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _measure(fitted: "Fitted", source: Reopened) -> "dict[str, SixErrors]":
    """Errors on what the split leaves out, and on the rest as the fit's method is given it."""
    from homofact.evaluate.metrics import measure

    return {part: measure(fitted, each, fitted.transform) for part, each in parts(fitted, source).items()}


def _mccool(fitted: "Fitted", source: Reopened, stage: Stage) -> "Row | None":
    """McCool's projections on the same split, of the same size and ε; None where the fit is that itself."""
    from homofact.evaluate.compare import fit_and_measure
    from homofact.methods.table import mccool_like

    settings = settings_of(fitted)
    baseline = mccool_like(settings)
    if baseline == settings:
        return None
    stage("McCool's projections")
    return fit_and_measure(source.source, baseline, source.held_out, subset=source.subset)


def _own_facts(source: "Source") -> "Facts":
    """What the source itself takes, beside what its fits do."""
    return (("Bytes", "analytic" if source.kind == "material" else f"{source.reflectance.nbytes:,}"),)


def _part(source: Reopened) -> str:
    return "held out" if source.known else "of the source"


def _error_facts(errors: dict[str, Any], part: str) -> "Facts":
    """Rows of a card: the Cole error on both parts, and two that are easier to imagine."""
    held, train = errors.get("held_out", {}), errors.get("train", {})
    rows = (
        (f"Log MSE, {part}", held.get("log_mse")),
        ("Log MSE, training", train.get("log_mse") if part == "held out" else None),
        (f"Log MAE, {part}", held.get("log_mae")),
        (f"MAE in sr⁻¹, {part}", held.get("mae")),
    )
    return tuple((name, figure(value)) for name, value in rows if isinstance(value, int | float))


def _verdict(report: dict[str, Any]) -> "Facts":
    """The verdict in a few words, where the report has one."""
    verdict = report.get("verdict")
    if not isinstance(verdict, dict) or not isinstance(verdict.get("trusted"), bool):
        return ()
    if verdict["trusted"]:
        return (("Verdict", "no fault found"),)
    found = verdict.get("findings")
    names = [str(each.get("name")) for each in found if isinstance(each, dict)] if isinstance(found, list) else []
    return (("Verdict", f"faults: {', '.join(names)}" if names else "not to be trusted"),)


def _reported_errors(report: dict[str, Any]) -> dict[str, Any]:
    errors = report.get("error")
    errors = errors if isinstance(errors, dict) else {}
    return {part: each for part, each in errors.items() if isinstance(each, dict)}


def _reported_note(errors: dict[str, Any]) -> list[str]:
    return ["Its errors are those that were measured when it was fitted (report.json)."] if errors else []


def _conditions(fitted: "Fitted", source: Reopened, compared: bool) -> list[str]:
    """Under which conditions the numbers beside the pictures hold."""
    samples = source.source.samples
    count = round(source.held_out * len(samples))
    turned = ", turned at random" if samples.isotropic else ""
    both = "Both fits have" if compared else "The fit has"
    seen = f"{both} the same A and have not seen them." if compared else "It has not seen them."
    if not source.known:
        seen = (
            "The fit's A is not the mean of the others: it may be made from some of these, or from another source."
            + (" McCool's has not seen them." if compared else "")
        )
    return [
        f"Errors are on {count:,} of {len(samples):,} samples (seed {source.seed}){turned}. {seen} Logarithms are"
        f" of (f + εA)/A, with ε = {fitted.transform.epsilon:g} and A the mean of the training samples."
    ]


def _subtitle(fitted: "Fitted") -> str:
    facts = fitted.provenance
    made = f"homofact {facts['homofact_version']}" if "homofact_version" in facts else "homofact"
    channels = "" if len(fitted.channels) == 3 else f", {fitted.channels[0]} shown as grey"
    return f"{made}, method {facts.get('method', 'unknown')}, seed {facts.get('seed', 'unknown')}{channels}"
