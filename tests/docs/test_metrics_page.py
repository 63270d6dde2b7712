"""The page for papers lists every metric once, with its unit and which values are good."""

import re

from homofact.evaluation.metric_table import METRICS
from sitemaker.navigation import ROOT


def test_every_metric_stands_in_the_table_of_the_page() -> None:
    text = (ROOT / "docs" / "papers.md").read_text(encoding="utf-8")
    section = text.partition("## All metrics")[2].partition("\n\nFor a database")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if "| `" in line]
    found = {name: (row[2], row[3]) for row in rows for name in re.findall(r"`(\w+)`", row[0])}
    assert list(found) != []
    assert set(found) == set(METRICS)
    assert len(found) == sum(row[0].count("`") // 2 for row in rows)
    for name, (unit, good) in found.items():
        own = METRICS[name]
        assert unit.removesuffix(" (PSNR)") in (own.unit, "dB"), name
        assert good == ("1" if own.good == "one" else own.good), name
