"""The document of the atlas: what stands at its head, of cells that are made up here."""

import math
import re

import pytest

from homofact.stability.atlas import Atlas, Plan
from homofact.stability.cells import Cell, CellOutcome
from homofact.stability.document import document

PLAN = Plan(methods=("search", "mccool"), stressors=("negative", "zeros"), short=True)
CELLS = (
    Cell("search", "negative", 0, "0", CellOutcome.OK, factor=0.5, stated=0.05, true=0.04),
    Cell("search", "negative", 0.5, "0.5", CellOutcome.REFUSED, message="samples: negative"),
    Cell("mccool", "negative", 0, "0", CellOutcome.DEGRADED, factor=7.0, new=1, stated=0.05, true=0.06),
    Cell("mccool", "negative", 0.5, "0.5", CellOutcome.DEGRADED, factor=3.0),
    Cell("search", "zeros", 0.001, "0.001", CellOutcome.SILENT, factor=12.0, stated=0.5, true=None),
    Cell("search", "zeros", 0.9, "0.9", CellOutcome.DEGRADED, factor=99.0, new=1, stated=1.0, true=math.inf),
    Cell("mccool", "zeros", 0.001, "0.001", CellOutcome.NONE),
    Cell("mccool", "zeros", 0.9, "0.9", CellOutcome.NONE),
)


@pytest.fixture
def text() -> str:
    return document(Atlas(PLAN, CELLS, {}, ()), [], "pictures", "an abacus")


def test_it_begins_with_the_worst_fit_of_every_sweep(text: str) -> None:
    rows = [line.split(" | ")[1:] for line in text.splitlines() if line.startswith("| [")]
    # The larger factor; what is refused beyond it; a silent one before a larger one; a method it is not for.
    assert rows == [["0.5, then refused", "7\\* |"], ["**12 silent**", "– |"]]


def test_silent_fits_are_counted_with_their_error_bars() -> None:
    silent = Cell("search", "zeros", 0.5, "0.5", CellOutcome.SILENT, factor=20.0, stated=0.5, true=0.1)
    for cells, sentence in (
        (
            (*CELLS, silent),
            "2 fits are silently wrong; the error bar of total reflected light covers the true error of 1",
        ),
        (CELLS, "1 fit is silently wrong; the error bar of total reflected light covers the true error of 0"),
        ((*CELLS[:4], *CELLS[5:]), "No fits are silently wrong."),
    ):
        assert sentence in " ".join(document(Atlas(PLAN, cells, {}, ()), [], "pictures", "an abacus").split())


def test_the_head_s_links_lead_to_sections(text: str) -> None:
    head = text.split("**Cause.**", 1)[0]
    # As git hosts make anchors of headings.
    anchors = {re.sub(r"[^\w -]", "", line.lower()).replace(" ", "-") for line in re.findall("^## (.*)$", text, re.M)}
    links = re.findall(r"\]\(#([^)]*)\)", head)
    assert len(links) == 3
    assert set(links) <= anchors


def test_how_it_was_measured_stands_at_the_end(text: str) -> None:
    assert text.rpartition("\n## ")[2].startswith("How it is measured\n")
    assert "an abacus" in text.rpartition("\n## ")[2]


def test_every_sweep_says_how_often_the_error_bars_hold(text: str) -> None:
    told = re.findall(r"covers the true error in (\d+) of (\d+) fits(?:; (\d+) more fits state no error bar)?", text)
    # All, then the two sweeps: three bars with a true error, one held; a withdrawn one; one of nothing to hold against.
    assert told == [("1", "3", "2"), ("1", "2", "1"), ("0", "1", "1")]
