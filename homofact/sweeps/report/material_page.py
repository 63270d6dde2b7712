"""The page of a material: every fit with its pictures, its textures, its verdict and its figures. Plain HTML."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from homofact.evaluation.metric_table import REPORTED
from homofact.evaluation.wording import figure, trust_in_words
from homofact.sweeps.ledger import Aside
from homofact.sweeps.report.html import finding_words, page_html, safe
from homofact.sweeps.report.reading import ReportedFit


@dataclass(frozen=True)
class FitFiles:
    """The files of a fit in fits/, and a note, for example why the fit has no viewer.

    `textures` are pairs (file, caption); `note` may be empty.
    """

    picture: str | None
    textures: tuple[tuple[str, str], ...]
    viewer: str | None
    note: str


def material_html(
    name: str, fits: Sequence[ReportedFit], shown: Mapping[str, FitFiles], aside: Sequence[Aside], sweep: str
) -> str:
    """Return the page of a material; `shown` maps fits' keys to their files, `aside` lists tasks without a fit."""
    body = [
        "<main class='material'>",
        "<nav class='crumbs' aria-label='Breadcrumb'><a href='../index.html'>← All fits</a></nav>",
        _figures(fits),
        "<div class='fits'>",
        *(_card(fit, shown[fit.row.key]) for fit in fits),
        "</div>",
        _aside(aside),
        "</main></body></html>",
    ]
    return page_html("{{content}}", name, f"{sweep}; SHA-256 {fits[0].material}…", content="\n".join(body))


def _figures(fits: Sequence[ReportedFit]) -> str:
    several = len({fit.row.seed for fit in fits}) > 1
    names = ["Method", *(["Seed"] if several else []), "Bytes", "Textures", "Fetches", "Fit, s", "Status", "Verdict"]
    heads = "".join(f"<th scope='col'>{safe(name)}</th>" for name in (*names, *(m.words for m in REPORTED)))
    rows = []
    for fit in fits:
        row = fit.row
        cells = [
            *([str(row.seed)] if several else []),
            f"{row.bytes:,}",
            str(row.textures),
            str(row.fetches),
            figure(row.seconds),
            row.status,
            trust_in_words(row.trusted).replace(" ", "\u00a0"),
            *(figure(row.metrics[metric.name]) for metric in REPORTED),
        ]
        link = f"<a href='#{row.key}'>{safe(row.label)}</a>"
        rows.append(f"<tr><th scope='row'>{link}</th>{''.join(f'<td>{safe(cell)}</td>' for cell in cells)}</tr>")
    return (
        "<section class='panel'><h2>Figures</h2><div class='scroll' tabindex='0' role='region' aria-label='Figures'>"
        f"<table class='plain'><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></section>"
    )


def _card(fit: ReportedFit, shown: FitFiles) -> str:
    row = fit.row
    grade = "good" if row.trusted else "bad"
    parts = [
        f"<section class='panel fit' id='{row.key}' aria-label='{safe(row.label)}'>",
        f"<h2>{safe(row.label)}{f', seed {row.seed}' if row.seed else ''}</h2>",
        f"<p class='verdict {grade}'>Verdict: {safe(fit.summary)}</p>",
    ]
    if shown.viewer is not None:
        parts.append(f"<p><a class='button' href='../fits/{shown.viewer}'>Open the viewer</a></p>")
    if shown.note:
        parts.append(f"<p class='quiet'>{safe(shown.note)}</p>")
    if fit.findings:
        parts.append(f"<ul class='findings'>{''.join(map(finding_words, fit.findings))}</ul>")
    if shown.textures:
        figures = "".join(
            f"<figure><img src='../fits/{file}' alt='Texture {safe(caption)}' loading='lazy' width='128' height='128'>"
            f"<figcaption>{safe(caption)}</figcaption></figure>"
            for file, caption in shown.textures
        )
        parts.append(f"<h3>Textures</h3><div class='textures'>{figures}</div>")
    if shown.picture is not None:
        words = f"The source, {row.label} and their differences on spheres under three lights"
        parts.append(
            f"<a class='picture' href='../fits/{shown.picture}'>"
            f"<img src='../fits/{shown.picture}' alt='{safe(words)}' loading='lazy'></a>"
        )
    given = fit.task.settings
    # With a number of bytes, the fit chooses number and shapes of its textures.
    chosen = {"size", "textures"} if given.get("bytes") is not None else set[str]()
    settings = ", ".join(f"{name} {value}" for name, value in given.items() if value is not None and name not in chosen)
    parts.append(
        f"<details><summary>Settings</summary><p>{safe(fit.task.method)}: {safe(settings)}; {fit.task.held_out:g} of"
        f" the samples held out; homofact {safe(fit.task.version)}; result {row.key}</p></details></section>"
    )
    return "".join(parts)


def _aside(aside: Sequence[Aside]) -> str:
    if not aside:
        return ""
    items = "".join(f"<li><b>{safe(entry.task.label)}</b>: {safe(entry.reason)}</li>" for entry in aside)
    return f"<section class='panel'><h2>Set aside</h2><ul>{items}</ul></section>"
