"""The pieces that the pages of a report share: its own head, its style, text made safe, figures with their words."""

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
    """A page of the report: its body, a template, in the head and the style of all, with its scripts and their data.

    `content` is what a body of {{content}} shows.
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
    """Return a text as HTML that shows it, in attributes too."""
    return html.escape(harmless(str(text)))


def finding_words(finding: ReportedFinding) -> str:
    """Return a finding as an item of a list."""
    remedy = f" <span class='quiet'>{safe(finding.remedy)}</span>" if finding.remedy else ""
    return f"<li><b>{safe(finding.name)}</b>, {safe(finding.about)}: {safe(finding.found)}.{remedy}</li>"
