"""The page of a material: every fit with its pictures, its textures, its verdict and its figures. Plain HTML."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from homofact.evaluation.wording import figure, trust_in_words
from homofact.sweeps.ledger import Aside
from homofact.sweeps.report.columns import TITLES, notes
from homofact.sweeps.report.html import finding_lists, page_html, safe
from homofact.sweeps.report.reading import ReportedFit
from homofact.sweeps.summary import Limit, limit_figure, value_of, with_values


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
    several = len({fit.row.seed for fit in fits}) > 1
    body = [
        "<main class='material'>",
        "<nav class='crumbs' aria-label='Breadcrumb'><a href='../index.html'>← All fits</a></nav>",
        _figures(fits, several),
        "<div class='fits'>",
        *(_card(fit, shown[fit.row.key], several) for fit in fits),
        "</div>",
        _aside(aside),
        "</main></body></html>",
    ]
    return page_html("{{content}}", name, f"{sweep}; SHA-256 {fits[0].material}…", content="\n".join(body))


def _figures(fits: Sequence[ReportedFit], several: bool) -> str:
    """Return the table of the fits, with a column of seeds if there are `several`."""
    names = ["Method", *(["Seed"] if several else []), "Bytes", "Textures", "Fetches", "Fit, s", "Status", "Verdict"]
    metrics = with_values([fit.row for fit in fits])
    heads = "".join(f"<th scope='col'>{safe(name)}</th>" for name in names) + "".join(
        f"<th scope='col' title='{safe(metric.words)}'>{safe(TITLES[metric.name])}</th>" for metric in metrics
    )
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
            *(
                (limit_figure if isinstance(metric, Limit) else figure)(value_of(row, metric.name))
                for metric in metrics
            ),
        ]
        link = f"<span class='name'><a href='#{row.key}'>{safe(row.label)}</a></span>"
        rows.append(f"<tr><th scope='row'>{link}</th>{''.join(f'<td>{safe(cell)}</td>' for cell in cells)}</tr>")
    return (
        "<section class='panel'><h2>All fits of this material</h2>"
        f"<div class='quiet hint'>{''.join(f'<p>{safe(note)}</p>' for note in notes([fit.row for fit in fits]))}</div>"
        "<div class='scroll' tabindex='0' role='region' aria-label='All fits of this material'>"
        f"<table class='plain'><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></section>"
    )


def _card(fit: ReportedFit, shown: FitFiles, seeds: bool) -> str:
    row = fit.row
    grade = "good" if row.trusted else "bad"
    parts = [
        f"<section class='panel fit' id='{row.key}' aria-label='{safe(row.label)}'>",
        f"<h2>{safe(row.label)}{f', seed {row.seed}' if seeds else ''}</h2>",
        "<div class='card'><div>",
        f"<p class='verdict {grade}'><b>Verdict:</b> {safe(fit.summary)}</p>",
    ]
    if shown.viewer is not None:
        parts.append(f"<p><a class='button' href='../fits/{shown.viewer}'>Open the viewer</a></p>")
    if shown.note:
        parts.append(f"<p class='quiet'>{safe(shown.note)}</p>")
    parts.append(finding_lists(fit.findings))
    if shown.textures:
        figures = "".join(
            f"<figure><img src='../fits/{file}' alt='Texture {safe(caption)}' loading='lazy' width='128' height='128'>"
            f"<figcaption>{safe(caption)}</figcaption></figure>"
            for file, caption in shown.textures
        )
        parts.append(f"<h3>Textures</h3><div class='textures'>{figures}</div>")
    given = fit.task.settings
    # With a number of bytes, the fit chooses the number and shapes of its textures.
    chosen = {"size", "textures"} if given.get("bytes") is not None else set[str]()
    settings = ", ".join(f"{name} {value}" for name, value in given.items() if value is not None and name not in chosen)
    parts.append(
        f"<details><summary>Settings</summary><p>{safe(fit.task.method)}: {safe(settings)}; {fit.task.held_out:g} of"
        f" the samples held out; homofact {safe(fit.task.version)}; result {row.key}</p></details></div>"
    )
    if shown.picture is not None:
        words = f"The source, {row.label} and their differences on spheres under three lights"
        parts.append(
            f"<a class='picture' href='../fits/{shown.picture}'>"
            f"<img src='../fits/{shown.picture}' alt='{safe(words)}' loading='lazy'></a>"
        )
    parts.append("</div></section>")
    return "".join(parts)


def _aside(aside: Sequence[Aside]) -> str:
    if not aside:
        return ""
    items = "".join(f"<li><b>{safe(entry.task.label)}</b>: {safe(entry.reason)}</li>" for entry in aside)
    return f"<section class='panel'><h2>Set aside</h2><ul>{items}</ul></section>"
