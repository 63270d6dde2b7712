"""The common parts of a report's pages: head, style, and texts escaped for HTML."""

import html
from collections.abc import Sequence
from itertools import groupby
from typing import Any

from homofact.evaluation.verdict.finding import About
from homofact.files.words import harmless
from homofact.sweeps.report.reading import ReportedFinding
from homofact.web.assembly import assembled, part

PACKAGE = "homofact.sweeps.report"


def page_html(
    body: str,
    title: str,
    subtitle: str,
    scripts: Sequence[str] = (),
    data: dict[str, Any] | None = None,
    content: str = "",
) -> str:
    """Return a page of the report: the template `body` with the common head and style, scripts and their data.

    `content` replaces {{content}} in the body.
    """
    return assembled(
        body,
        title=title,
        subtitle=subtitle,
        styles=[part(PACKAGE, "report.css")],
        scripts=scripts,
        data=data or {},
        # Pictures are files beside the page.
        policy=" 'self' file:",
        head=part(PACKAGE, "head.html"),
        content=content,
    )


def safe(text: object) -> str:
    """Return a text escaped for HTML, also for attributes."""
    return html.escape(harmless(str(text)))


def finding_lists(findings: Sequence[ReportedFinding]) -> str:
    """Return findings as HTML lists, each under the heading that the command prints above these findings."""
    titles = {about.value: about.title for about in About}
    return "".join(
        f"<p>{safe(titles.get(about, about))}:</p><ul class='findings'>{''.join(map(_finding, some))}</ul>"
        for about, some in groupby(findings, key=lambda finding: finding.about)
    )


def _finding(finding: ReportedFinding) -> str:
    remedy = f": <span class='quiet'>{safe(finding.remedy)}</span>" if finding.remedy else ""
    return f"<li><b>{safe(finding.name)}</b>: {safe(finding.found)}{remedy}</li>"
