"""The pieces that the pages of a report share: its own head, its style, text made safe, figures with their words."""

import html

from homofact.files.words import harmless
from homofact.sweeps.report.reading import ReportedFinding
from homofact.web.assembly import part

PACKAGE = "homofact.sweeps.report"


def head() -> str:
    """The head of every page, to be filled by `web.assembly.assembled`."""
    return part(PACKAGE, "head.html")


def style() -> str:
    """The style of every page."""
    return part(PACKAGE, "report.css")


def safe(text: object) -> str:
    """A text as HTML that shows it, in attributes too."""
    return html.escape(harmless(str(text)))


def finding_words(finding: ReportedFinding) -> str:
    """A finding as an item of a list."""
    remedy = f" <span class='quiet'>{safe(finding.remedy)}</span>" if finding.remedy else ""
    return f"<li><b>{safe(finding.name)}</b>, {safe(finding.grade)}: {safe(finding.found)}.{remedy}</li>"
