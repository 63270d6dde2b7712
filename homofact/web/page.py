"""Write the page of a fit: the fit, McCool's projections fitted at the same size and ε, and the source.

    write_view(homofact.load("out/paint"), "paint.html")

Beside the pictures, the page shows the errors of both fits on the same samples. These are held out from both fits if
the fit has recorded its split.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.brdf.scattered import interpolated_samples
from homofact.brdf.source import Source
from homofact.evaluation.bar.error_bar import ErrorBar, ErrorBars
from homofact.evaluation.reopening import NotReopened, Reopened, reopen, settings_of
from homofact.evaluation.wording import figure, findings_named, trust_in_words

if TYPE_CHECKING:
    from homofact.errors import Report
    from homofact.evaluation.compare import FitWithErrors
    from homofact.factor.fitted import Fitted
    from homofact.meshes.mesh import Mesh
    from homofact.web.viewer import Facts, Layer

Stage = Callable[[str], None]
SHOWN = {"search": "Searched fit", "cole": "Cole's fit", "mccool": "McCool", "svd": "SVD", "nmf": "NMF"}


@dataclass(frozen=True)
class ViewerPage:
    """A page that was written: its `file` and `size` in bytes, the titles of its pictures, and its `record` for JSON.

    `reports` maps the titles of fits made for the page to their reports. `caution` is empty, or a warning: the page
    shows the fit alone and why, or its errors may be on training samples.
    """

    file: Path
    size: int
    titles: tuple[str, ...]
    record: dict[str, Any]
    reports: "dict[str, Report]"
    caution: str


def write_view(
    fitted: "Fitted",
    path: str | os.PathLike[str],
    source: "Reopened | Source | str | None" = None,
    *,
    near: Sequence[str | os.PathLike[str]] = (),
    report: Mapping[str, Any] | None = None,
    mesh: "Mesh | None" = None,
    stage: Stage = lambda name: None,
    new: bool = False,
    shown: "Layer | None" = None,
    baselines: "dict[Any, FitWithErrors] | None" = None,
) -> ViewerPage:
    """Write the page of a fit to `path`, one HTML file that works offline, and return its facts.

    By default, the source is the fit's own; `reopen` looks for it, also in the folders `near`. If it cannot be found,
    the page shows the fit alone and the reason. Its errors then come from `report`, the record of the fit
    (`ComparisonRow.record`), if given; the verdict always does. `stage` is called with a description of each step. If
    `new`, an existing file is an error. `shown` is the source's layer, if another page of the source has made it.
    `baselines` are the fits of McCool's projections for other pages of the source; this page adds its own. Raises
    BadInput for channels that cannot be shown, for a given `source` that cannot be read, and for a path that cannot be
    written.
    """
    from homofact.evaluation.metrics import measure
    from homofact.shading.program import name_of
    from homofact.web.layers import check_shown, fit_layer
    from homofact.web.viewer import write_viewer

    check_shown(fitted.channels)
    target, report = Path(path), report or {}
    found: Reopened | str
    try:
        found = source if isinstance(source, Reopened) else reopen(fitted, source, near)
    except NotReopened as error:
        found = str(error)
    method = str(fitted.provenance.get("method", ""))
    title = SHOWN.get(method, "Fit")
    record: dict[str, Any] = {}
    reports: dict[str, Any] = {}
    if isinstance(found, str):
        errors = _reported_errors(report)
        layers = [fit_layer(fitted, "fit", title, (*_verdict(report), *_error_facts(errors, "held_out")))]
        notes = [f"The fit alone: {found}."]
        if errors:
            notes.append("Its errors are those that were measured when it was fitted (report.json).")
        name = name_of(fitted.provenance)
        caution = f"the page shows the fit alone: {found}"
    else:
        # On the test samples of the split, and on the others, turned alike.
        errors = {part: measure(fitted, each, fitted.transform).record() for part, each in found.parts.items()}
        record["error"] = {"fit": errors}
        facts = _error_facts(errors, found.part)
        layers = [fit_layer(fitted, "fit", title, (*_verdict(report), *facts))]
        row = _mccool(fitted, found, stage, {} if baselines is None else baselines)
        if row is not None:
            record["error"]["mccool"] = {"train": row.train.record(), found.part: row.held_out.record()}
            facts = _error_facts(record["error"]["mccool"], found.part)
            layers.append(fit_layer(row.factorization, "mccool", "McCool", facts))
            reports["McCool"] = row.report
        if shown is None:
            stage("tabulating the source")
            shown = shown_source(found)
        layers.append(shown)
        assert shown.table is not None
        table = shown.table.error
        record["table"] = {"median": table.median, "percentile_95": table.percentile_95, "nodes": shown.table.size}
        notes = _conditions(fitted, found, row is not None)
        name = found.source.name
        caution = "" if found.held_out else "the fit has, or may have, seen the samples that its errors are on"
    stage("writing")
    target.parent.mkdir(parents=True, exist_ok=True)
    size = write_viewer(target, layers, title=name, subtitle=_subtitle(fitted), mesh=mesh, notes=notes, new=new)
    record = {
        "file": str(target),
        "file_bytes": size,
        "layers": [layer.key for layer in layers],
        "mesh": None if mesh is None else mesh.name,
        "source": None if isinstance(found, str) else found.source.name,
        "split_known": None if isinstance(found, str) else found.known,
        "split": None if isinstance(found, str) else found.split.record(),
        **record,
        "notes": notes,
    }
    return ViewerPage(target, size, tuple(layer.title for layer in layers), record, reports, caution)


def shown_source(source: Reopened) -> "Layer":
    """Return the source's layer, to share among pages of its fits. Raises BadInput as `source_layer` does."""
    from homofact.web.viewer import source_layer

    own = source.source
    return source_layer(own.reflectance, facts=(("Bytes", _bytes(own)),), seed=source.split.seed)


def _bytes(source: Source) -> str:
    """Return the size of the source, to compare with the bytes of its fits, which are those of their textures.

    The size of samples counts angles and values as float32, not the structure that interpolates them.
    """
    if source.kind == "material":
        return "analytic"
    samples = interpolated_samples(source.reflectance)
    if samples is None:
        return f"{source.reflectance.nbytes:,} (as stored)"
    # θi, θo and Δφ, or both azimuths.
    numbers = (3 if samples.isotropic else 4) + len(source.reflectance.channels)
    return f"{4 * numbers * len(samples):,} (samples as float32)"


def _mccool(
    fitted: "Fitted", source: Reopened, stage: Stage, made: "dict[Any, FitWithErrors]"
) -> "FitWithErrors | None":
    """Fit McCool's projections on the same split, at the same size and ε; None if the fit is this fit already."""
    from homofact.evaluation.compare import fit_baseline
    from homofact.methods.table import mccool_like

    settings = settings_of(fitted)
    baseline = mccool_like(settings)
    if baseline == settings:
        return None
    if baseline not in made:
        stage("McCool's projections")
        made[baseline] = fit_baseline(source.source, source.split, baseline)
    return made[baseline]


def _error_facts(errors: Mapping[str, Any], part: str) -> "Facts":
    """Return rows of a card: the Cole error on both parts, and log MAE and MAE."""
    tested, train = errors.get(part, {}), errors.get("train", {})
    words = {"held_out": "held out", "source": "of the source"}[part]
    rows = (
        (f"Log MSE, {words}", tested.get("log_mse")),
        ("Log MSE, training", train.get("log_mse") if part == "held_out" else None),
        (f"Log MAE, {words}", tested.get("log_mae")),
        (f"MAE in sr⁻¹, {words}", tested.get("mae")),
    )
    return tuple((name, figure(value)) for name, value in rows if isinstance(value, int | float))


def _verdict(report: Mapping[str, Any]) -> "Facts":
    """Return the verdict's sentence, names of findings, and error bars by angle, if the report contains them."""
    verdict = report.get("verdict")
    if not isinstance(verdict, dict) or not isinstance(verdict.get("trusted"), bool):
        return ()
    found = verdict.get("findings")
    listed = [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []
    # Reports of earlier versions have no sentence.
    names = [str(each.get("name")) for each in listed]
    said = verdict.get("summary")
    words = trust_in_words(verdict["trusted"], said if isinstance(said, str) else "")
    bars = ErrorBars.of_record(verdict.get("bars"))
    stated = bars is not None and any(bar.error is not None for bar in bars.by_angle)
    angles = tuple(map(_at_angle, bars.by_angle)) if bars and stated else ()
    light = (("Total reflected light, source over fit", ", ".join(angles)),) if angles else ()
    return (("Verdict", words + findings_named(names)), *light)


def _at_angle(bar: ErrorBar) -> str:
    beyond = f" ({bar.unmeasured:.0%} of it in directions without measurements)" if bar.rests_on_extrapolation else ""
    return f"{bar.degrees[0]:.0f}°: {bar.between()}{beyond}"


def _reported_errors(report: Mapping[str, Any]) -> dict[str, Any]:
    errors = report.get("error")
    errors = errors if isinstance(errors, dict) else {}
    return {part: each for part, each in errors.items() if isinstance(each, dict)}


def _conditions(fitted: "Fitted", source: Reopened, compared: bool) -> list[str]:
    """Return a note on how the errors beside the pictures were measured."""
    samples, split = source.source.samples, source.split
    turned = ", turned at random" if samples.isotropic else ""
    count = round(split.held_out * len(samples)) or len(samples)
    both = "Both fits have" if compared else "The fit has"
    same = ", the same for both fits" if compared else ""
    if source.held_out:
        seen = f"{both} not seen these samples."
    elif source.known:
        seen = f"Nothing was held out: {'both fits were' if compared else 'the fit was'} made from these samples."
    else:
        seen = "The fit did not record its training samples, or it was made from other samples." + (
            " McCool's has not seen them." if compared else ""
        )
    return [
        f"Errors are on {count:,} of {len(samples):,} samples (seed {split.seed}){turned}. {seen} Logarithms are"
        f" of (f + εA)/A, with ε = {fitted.transform.epsilon:g} and A the mean of the training samples{same}."
    ]


def _subtitle(fitted: "Fitted") -> str:
    facts = fitted.provenance
    made = f"homofact {facts['homofact_version']}" if "homofact_version" in facts else "homofact"
    channels = "" if len(fitted.channels) == 3 else f", {fitted.channels[0]} shown as grey"
    return f"{made}, method {facts.get('method', 'unknown')}, seed {facts.get('seed', 'unknown')}{channels}"
