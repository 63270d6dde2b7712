"""The common parts of a report's pages: head, style, and texts escaped for HTML."""

import html
from collections.abc import Sequence
from typing import Any

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


def finding_words(finding: ReportedFinding) -> str:
    """Return a finding as an HTML list item."""
    remedy = f" <span class='quiet'>{safe(finding.remedy)}</span>" if finding.remedy else ""
    return f"<li><b>{safe(finding.name)}</b>, {safe(finding.about)}: {safe(finding.found)}.{remedy}</li>"
