"""The atlas of failures: its stressors stress, its cells are classified by law, its table and document are whole."""

import csv
import json
import math
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch
from PIL import Image

from homofact.brdf.scattered import Scattered
from homofact.brdf.source import Source
from homofact.cli.main import main
from homofact.errors import BadInput, SolverFailure, Status
from homofact.evaluation.bar.error_bar import ErrorBars
from homofact.evaluation.compare import ComparisonRow
from homofact.factor.factorization import Factorization
from homofact.linear.solvers import SOLVERS
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.search import Search
from homofact.methods.table import METHODS
from homofact.stability.atlas import SHORT_SETTINGS, Atlas, Plan, run_atlas, write_csv
from homofact.stability.cells import (
    Cell,
    CellOutcome,
    References,
    classify,
    fit_row,
    method_for,
    run_cell,
    said_of,
)
from homofact.stability.document import document
from homofact.stability.picture import draw_atlas, draw_solvers, short_number
from homofact.stability.problem import Problem, Scale, unstressed
from homofact.stability.solver_atlas import (
    SYSTEMS,
    WELL_POSED,
    SolverCell,
    SolverOutcome,
    classify_answer,
    minimum_norm,
    run_solvers,
)
from homofact.stability.stressors import STRESSORS

SCALE = Scale(samples=600, clean=300)


@pytest.mark.parametrize(
    ("factor", "said", "new", "outcome"),
    [
        (1.0, 0, 0, CellOutcome.OK),
        (2.0, 3, 0, CellOutcome.OK),
        (1.0, 1, 1, CellOutcome.DEGRADED),
        (2.1, 0, 0, CellOutcome.DEGRADED),
        (10.0, 0, 0, CellOutcome.DEGRADED),
        (10.1, 0, 0, CellOutcome.SILENT),
        (10.1, 1, 0, CellOutcome.DEGRADED),
        (1e9, 1, 1, CellOutcome.DEGRADED),
        (math.nan, 2, 2, CellOutcome.CRASHED),
        (math.inf, 2, 2, CellOutcome.CRASHED),
    ],
)
def test_the_law_of_a_cell(factor: float, said: int, new: int, outcome: CellOutcome) -> None:
    assert classify(factor, said, new) is outcome


EMPTY = Cell("mccool", "few-samples", 1.0, "1", CellOutcome.NONE)
Fitter = Callable[[Source, Method], ComparisonRow]


def references() -> References:
    return References(unstressed(0, SCALE), SHORT_SETTINGS)


def stressed() -> Problem:
    problem = unstressed(0, SCALE)
    return problem.measuring(problem.samples.subset(300, 0))


def lying(factor: float) -> Fitter:
    """A fit whose stressed values are `factor` times too large, with a verdict that does not warn."""

    def fit(source: Source, settings: Method) -> ComparisonRow:
        row = fit_row(source, settings)
        verdict = replace(row.verdict, alarm=replace(row.verdict.alarm, score=0.0))
        if len(source.samples) < SCALE.samples:
            transform = row.factorization.transform
            assert isinstance(row.factorization, Factorization)
            wrong = replace(row.factorization, transform=replace(transform, mean=transform.mean * factor))
            row = replace(row, factorization=wrong)
        return replace(row, verdict=verdict)

    return fit


def raising(error: BaseException) -> Fitter:
    def fit(source: Source, settings: Method) -> ComparisonRow:
        raise error

    return fit


def test_a_fit_that_is_wrong_and_says_nothing_is_found() -> None:
    cell = run_cell(EMPTY, stressed, references(), lying(20.0))
    assert cell.outcome is CellOutcome.SILENT
    assert cell.factor is not None
    assert cell.error is not None
    assert cell.reference is not None
    assert cell.factor == pytest.approx(cell.error / max(cell.reference, 2.5e-3))
    assert cell.error > 5
    assert run_cell(EMPTY, stressed, references(), lying(1.0)).outcome is CellOutcome.OK
    assert run_cell(EMPTY, stressed, references(), lying(math.nan)).outcome is CellOutcome.CRASHED


def with_bar(factor: float, error: float | None, degrees: tuple[float, float] = (0.0, 75.0)) -> Cell:
    """A cell whose fit is `factor` times too bright, with this error bar of total reflected light."""

    def fit(source: Source, settings: Method) -> ComparisonRow:
        row = lying(factor)(source, settings)
        bar = replace(row.verdict.bars.of("albedo"), error=error, degrees=degrees)
        return replace(row, verdict=replace(row.verdict, bars=ErrorBars((bar,))))

    return run_cell(EMPTY, stressed, references(), fit)


def test_a_fit_is_judged_if_no_clean_sample_is_at_the_angles_of_its_error_bar() -> None:
    cell = with_bar(1.0, 0.1, (89.999, 90.0))
    assert cell.outcome is CellOutcome.OK
    assert cell.error is not None
    assert cell.true is None


@pytest.mark.slow
def test_an_error_bar_is_held_against_the_clean_light() -> None:
    bright = with_bar(20.0, 25.0)
    assert bright.true is not None
    assert 10 < bright.true < 25
    # Too dark by a factor is an error of that factor too; what chance may do is taken off.
    dark = with_bar(0.05, 25.0)
    assert dark.true is not None
    assert dark.true > 2
    assert (bright.held, with_bar(20.0, 5.0).held, with_bar(20.0, None).held) == (True, False, None)
    # Where no incidence is in the range there is nothing to hold it against.
    assert with_bar(20.0, 5.0, (89.9, 90.0)).held is None


def test_a_warning_makes_a_wrong_fit_a_degraded_one() -> None:
    def warning(source: Source, settings: Method) -> ComparisonRow:
        row = lying(20.0)(source, settings)
        stressed = len(source.samples) < SCALE.samples
        return replace(row, report=replace(row.report, status=Status.FALLBACK)) if stressed else row

    cell = run_cell(EMPTY, stressed, references(), warning)
    assert (cell.outcome, cell.new) == (CellOutcome.DEGRADED, 1)
    assert "singular" in cell.said[0]
    # A note is no warning, nor is a spent budget.
    row = fit_row(*problem_of(unstressed(0, SCALE)))
    noted = replace(row, report=replace(row.report, status=Status.BUDGET, notes=("the time was up",)))
    assert said_of(noted) == said_of(row)


def problem_of(problem: Problem) -> tuple[Source, Method]:
    # A stress has no source to evaluate, only samples.
    source = Source("atlas", problem.kind, problem.samples, Scattered(problem.samples), 1e-2, 0.0)
    return source, McCool(size=8, epsilon=1e-2, copies=2)


@pytest.mark.parametrize(
    ("error", "outcome"),
    [
        (BadInput("samples: one line"), CellOutcome.REFUSED),
        (SolverFailure("cholesky: not finite"), CellOutcome.REFUSED),
        (ValueError("svd did\nnot converge"), CellOutcome.CRASHED),
        (IndexError("out of range"), CellOutcome.CRASHED),
    ],
)
def test_what_a_fit_raises_is_a_refusal_or_a_crash(error: Exception, outcome: CellOutcome) -> None:
    cell = run_cell(EMPTY, stressed, references(), raising(error))
    assert cell.outcome is outcome
    assert cell.message == f"{type(error).__name__}: {' '.join(str(error).split())}"
    assert cell.factor is None


def test_an_interrupt_passes_through() -> None:
    with pytest.raises(KeyboardInterrupt):
        run_cell(EMPTY, stressed, references(), raising(KeyboardInterrupt()))


def test_a_method_is_given_only_settings_that_it_uses() -> None:
    problem = STRESSORS["coincident"].stress(3, 0, SCALE)
    found = {name: method_for(name, problem, SHORT_SETTINGS) for name in METHODS}
    assert isinstance(found["mccool"], McCool)
    assert found["mccool"].projections == ("wi", "h", "h", "h")
    assert isinstance(found["search"], Search)
    assert (found["search"].textures, found["search"].projections) == (3, ("theta_h-theta_d",) * 3)
    assert found["cole"] is None
    for method in found.values():
        if method is not None:
            kept = (set(SHORT_SETTINGS) - {"textures"}) & {f.name for f in fields(method)}
            assert {name: getattr(method, name) for name in kept} == {name: SHORT_SETTINGS[name] for name in kept}


@pytest.mark.parametrize("name", METHODS)
def test_unstressed_fits_are_worth_stressing(name: str) -> None:
    """The factors would mean nothing over a fit that is no fit: it must beat the mean by far."""
    judged = references().common(name)
    spread = unstressed(0, SCALE).clean.values.log().var(0).mean()
    assert judged.error < 0.6 * float(spread)


SOME = ("few-samples", "negative", "smoothing", "outliers")


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return run_atlas(Plan(("mccool", "svd"), SOME, short=True))


@pytest.fixture(scope="module")
def solves() -> list[SolverCell]:
    return run_solvers(0, short=True)


def test_some_cells_of_the_atlas(atlas: Atlas) -> None:
    found = {(c.stressor, c.method, c.strength): c for c in atlas.cells}
    assert len(found) == len(atlas.cells) == 2 * len(SOME) * 2
    assert found["few-samples", "mccool", 1500].outcome is CellOutcome.OK
    assert found["negative", "mccool", 0.5].message.startswith("BadInput: samples: values at row")
    assert found["smoothing", "svd", 1e8].outcome is CellOutcome.NONE
    flat = found["smoothing", "mccool", 1e8]
    assert flat.factor is not None
    assert flat.factor > 2
    outliers = found["outliers", "mccool", 0.5]
    assert outliers.factor is not None
    assert outliers.factor > 10
    assert outliers.said
    assert not {CellOutcome.SILENT, CellOutcome.CRASHED} & {cell.outcome for cell in atlas.cells}
    assert sum(atlas.counts().values()) == len(atlas.cells)


def test_the_csv_holds_every_cell(atlas: Atlas, tmp_path: Path) -> None:
    write_csv(tmp_path / "atlas.csv", atlas.cells)
    with open(tmp_path / "atlas.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(atlas.cells)
    assert list(rows[0]) == [each.name for each in fields(Cell)]
    for row, cell in zip(rows, atlas.cells, strict=True):
        assert (row["method"], row["stressor"], row["outcome"]) == (cell.method, cell.stressor, cell.outcome.value)
        assert (float(row["factor"]) if row["factor"] else None) == cell.factor


def test_the_document_mentions_every_stressor_and_every_number(atlas: Atlas, solves: list[SolverCell]) -> None:
    text = document(atlas, solves, "pictures", "an abacus")
    for name in SOME:
        each = STRESSORS[name]
        for part in (f"`{name}`", each.description, each.mechanism, f"**Remedy.** {each.remedy}"):
            assert part in text
    for cell in atlas.cells:
        assert cell.factor is None or f"{cell.factor:.2g}" in text or f"{cell.factor:.1e}" in text
    for cell in solves:
        assert f"| {cell.system} |" in text
    assert "an abacus" in text
    assert "homofact refuses the data: “samples: values at row" in text


def test_the_committed_document_is_of_these_stressors() -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "stability.md"
    text = " ".join(page.read_text(encoding="utf-8").split())
    for each in STRESSORS.values():
        assert f"`{each.name}`" in text, f"{each.name} is missing: make stability"
        assert each.mechanism in text, f"{each.name} has changed: make stability"
    for system in SYSTEMS:
        assert f"| {system.name} |" in text, f"{system.name} is missing: make stability"


def test_pictures_are_drawn(atlas: Atlas, solves: list[SolverCell], tmp_path: Path) -> None:
    draw_atlas(tmp_path / "a.png", atlas, atlas.plan.settings)
    draw_solvers(tmp_path / "s.png", solves)
    for name in ("a.png", "s.png"):
        with Image.open(tmp_path / name) as image:
            assert min(image.size) > 300
            assert len(image.convert("RGB").getcolors(1 << 24) or ()) > 10


@pytest.mark.parametrize(
    ("value", "text"), [(1e-9, "<.1"), (0.25, "0.2"), (2.34, "2.3"), (12.4, "12"), (640, "640"), (2e4, "1e4")]
)
def test_a_factor_fits_its_cell(value: float, text: str) -> None:
    assert short_number(value) == text


def test_the_minimum_norm_answer_is_a_minimum_and_exact() -> None:
    problem = SYSTEMS[0].make(0)
    texels, condition, rank = minimum_norm(problem)
    rows, targets = problem.rows()
    gradient = rows.T @ (targets - rows @ texels[problem.kept].numpy())
    assert abs(gradient).max() < 1e-9
    matrix = (rows.T @ rows).toarray()
    values = torch.linalg.eigvalsh(torch.from_numpy(matrix))
    assert condition == pytest.approx(float(values[-1] / values[0]), rel=1e-6)
    assert rank == int(problem.kept.sum())


@pytest.mark.parametrize(
    ("difference", "well_posed", "status", "answer"),
    [
        (1e-9, True, Status.CONVERGED, SolverOutcome.AGREES),
        (1e-7, True, Status.CONVERGED, SolverOutcome.SILENT),
        (1e-7, False, Status.CONVERGED, SolverOutcome.AGREES),
        (1e-2, False, Status.DIRECT, SolverOutcome.SILENT),
        (1e-2, False, Status.FALLBACK, SolverOutcome.SAYS_SO),
        (1e-2, False, Status.BUDGET, SolverOutcome.SAYS_SO),
    ],
)
def test_the_law_of_an_answer(difference: float, well_posed: bool, status: Status, answer: SolverOutcome) -> None:
    assert classify_answer(difference, well_posed, status) is answer


def test_systems_are_well_and_ill_posed() -> None:
    conditions = [minimum_norm(system.make(0))[1] for system in SYSTEMS[::6]]
    assert min(conditions) < WELL_POSED < max(conditions)


def test_no_solver_is_silently_wrong(solves: list[SolverCell]) -> None:
    """On well-posed systems all agree to 1e-8; on the others each gives the minimum norm, or says that it does not."""
    assert {cell.solver for cell in solves} == set(SOLVERS)
    assert [c for c in solves if c.answer in (SolverOutcome.SILENT, SolverOutcome.CRASHED)] == []


@pytest.mark.slow
def test_the_command_writes_everything(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, page = tmp_path / "atlas", tmp_path / "docs" / "stability.md"
    arguments = ["--short", "--methods", "mccool", "--stressors", "negative,zeros", "--document", str(page), "--json"]
    assert main(["research", "stability", "--out", str(out), *arguments]) == 0
    captured = capsys.readouterr()
    answer = json.loads(captured.out)
    assert answer["fits"]["refused"] == 1
    assert sorted(path.name for path in out.iterdir()) == ["atlas.csv", "atlas.png", "solvers.csv", "solvers.png"]
    text = page.read_text(encoding="utf-8")
    assert "](../atlas/atlas.png)" in text
    assert "`zeros`" in text


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--methods", "mccool"], "out: none given"),
        (["--out", "x", "--methods", "gauss"], "method: found 'gauss'"),
        (["--out", "x", "--stressors", "rust"], "stressors: found 'rust', expected some of few-samples"),
        (["--out", "x", "--stressors", ","], "stressors: found none"),
        (["--out", "x", "--document", "a.txt"], "expected .md"),
    ],
)
def test_bad_arguments_are_refused(
    arguments: list[str], expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["research", "stability", *arguments]) == 2
    assert expected in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
