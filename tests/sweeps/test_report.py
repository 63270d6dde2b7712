"""A report's figures are those of the sweep: tables, the worst, what changed; and the site is whole or not there."""

import csv
import html
import json
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from swept import COUNT, MATERIALS, make_sweep, read_of, task

from homofact.errors import BadInput
from homofact.evaluation.metric_table import REPORTED
from homofact.files import extras
from homofact.sweeps.ledger import SweepLedger
from homofact.sweeps.report import site as site_module
from homofact.sweeps.report import tables
from homofact.sweeps.report.comparison import change, compared, comparison_rows, word, worst
from homofact.sweeps.report.index_page import index_data, index_html
from homofact.sweeps.report.material_page import FitFiles
from homofact.sweeps.report.reading import read_results
from homofact.sweeps.report.site import write_site
from homofact.sweeps.summary import LIMITS, limit_figure, middle, rows_of

BY_NAME = {metric.name: metric for metric in REPORTED}
NOTHING = FitFiles(None, (), None, "")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """(sweep, its site), two labels of three materials, one label refused."""
    folder = make_sweep(tmp_path_factory.mktemp("sweep") / "swept", labels=("ours", "ggx", "bad"), refused=("bad",))
    site = folder.parent / "site"
    write_site(folder, site)
    return folder, site


def data_of(page: Path) -> dict[str, Any]:
    text = page.read_text(encoding="utf-8")
    return json.loads(text.partition('<script type="application/json" id="data">')[2].partition("</script>")[0])


def test_the_middle_of_rows_is_their_median_without_those_that_have_none() -> None:
    rows: Any = [SimpleNamespace(metrics={"mae": value}) for value in (5.0, None, 1.0, 2.0)]
    assert middle(rows, "mae") == 2.0
    assert middle(rows[1:2], "mae") is None


def test_ratios_that_should_be_one_do_not_cancel() -> None:
    rows: Any = [SimpleNamespace(metrics={"albedo_worst": value}) for value in (0.5, 1.0, 2.0, None)]
    assert middle(rows, "albedo_worst") == 2.0
    assert middle(rows[:2], "albedo_worst") == 1.5


def limited(sources: tuple[str, ...], light: float = 0.0669, highlight: float | None = None) -> Any:
    """A change of reports, after which these sources are lists of samples: with limits, without figures of light."""
    errors = {"albedo": light, "highlight": highlight, "sky": 0.0236}

    def change(report: dict[str, Any], its: Any) -> None:
        if its.source not in sources:
            return
        report["appearance"] = None
        whole = {"low": None, "high": None, "rate": 0.9, "degrees": [0, 75], "reason": "", "unmeasured": 0.0}
        report["verdict"]["bars"] = {
            "all": [
                {"quantity": name, "kind": "withdrawn" if error is None else "if the data are right", "error": error}
                | whole
                for name, error in errors.items()
            ],
            "by_angle": [],
        }
        report["verdict"]["findings"] = [
            {"name": "light", "about": "fit", "found": "too dark", "remedy": "more texels"},
            {"name": "coverage", "about": "unknown", "found": "14% of the light", "remedy": "measure more"},
        ]

    return change


def test_the_limits_of_lists_of_samples_replace_the_figures_that_they_lack(tmp_path: Path) -> None:
    folder = make_sweep(tmp_path / "s", labels=("ours",), change=limited(MATERIALS))
    assert [row.limits for row in rows_of(folder)] == [
        {"light_limit": 0.0669, "highlight_limit": math.inf, "sky_limit": 0.0236}
    ] * 3
    write_site(folder, tmp_path / "site", viewers=False)
    data = data_of(tmp_path / "site" / "index.html")
    names = ["log_mse", "mae", "light_limit", "highlight_limit", "sky_limit"]
    assert [each["name"] for each in data["metrics"]] == names
    assert [each[-3:] for each in data["fits"]] == [[0.0669, "unknown", 0.0236]] * 3
    assert data["methods"][0][-3:] == [0.0669, "unknown", 0.0236]
    (said,) = [note for note in data["notes"] if note.startswith("Columns left out")]
    assert said.startswith("Columns left out: albedo, energy, highlight, rms, lamp dB and sky dB. These compare")
    assert "a list of samples cannot be evaluated" in said
    assert any("MAE compares differences in sr⁻¹, so the brightest samples dominate" in note for note in data["notes"])
    with (tmp_path / "site" / "fits.csv").open(encoding="utf-8", newline="") as file:
        cells = next(csv.DictReader(file))
    assert [cells[name] for name in names[2:]] == ["0.0669", "inf", "0.0236"]
    assert cells["psnr_sky"] == ""
    for page in (tmp_path / "site" / "materials").iterdir():
        text = page.read_text(encoding="utf-8")
        (row,) = re.findall(r"<tbody>(.*?)</tbody>", text)
        assert re.findall(r"<td>([^<]*)</td>", row)[-3:] == ["7%", "unknown", "2.4%"]
        assert "<td>–</td>" not in row
        assert html.escape(said) in text


def test_findings_have_the_headings_of_the_command(tmp_path: Path) -> None:
    folder = make_sweep(tmp_path / "s", labels=("ours",), change=limited(MATERIALS))
    write_site(folder, tmp_path / "site", viewers=False)
    for page in (tmp_path / "site" / "materials").iterdir():
        text = page.read_text(encoding="utf-8")
        assert "<p>Of the fit:</p><ul class='findings'><li><b>light</b>: too dark" in text
        assert "<p>Not measured:</p><ul class='findings'><li><b>coverage</b>: 14% of the light" in text


def test_materials_without_figures_of_light_are_counted(made: tuple[Path, Path], tmp_path: Path) -> None:
    sweep = read_results(make_sweep(tmp_path / "s", labels=("ours",), change=limited(MATERIALS[1:])))
    data = index_data(sweep, {fit.row.key: NOTHING for fit in sweep.fits}, None, [])
    assert len(data["metrics"]) == len(REPORTED) + 3
    # A fit that was compared with its source everywhere has no limits, and a list of samples has only limits.
    assert [each is None for each in data["fits"][0][-9:]] == [False] * 6 + [True] * 3
    assert [each is None for each in data["fits"][1][-9:]] == [True] * 6 + [False] * 3
    assert data["notes"][-1].startswith("Lists of samples (2 of 3 materials) have these limits instead of albedo,")
    assert "Medians omit fits without a value." in data["median_notes"]
    known = data_of(made[1] / "index.html")
    assert [each["name"] for each in known["metrics"]] == [each.name for each in REPORTED]
    assert not any("left out" in note or "limit" in note for note in known["notes"] + known["median_notes"])


def test_an_unknown_limit_is_the_worst(tmp_path: Path) -> None:
    limit = next(each for each in LIMITS if each.name == "highlight_limit")
    changes = {MATERIALS[0]: 0.2, MATERIALS[1]: None, MATERIALS[2]: 0.1}

    def change_each(report: dict[str, Any], its: Any) -> None:
        limited(MATERIALS, highlight=changes[its.source])(report, its)

    def earlier(report: dict[str, Any], its: Any) -> None:
        limited(MATERIALS, highlight=None if its.source == MATERIALS[2] else 0.2)(report, its)

    now = read_results(make_sweep(tmp_path / "now", labels=("ours",), change=change_each))
    before = read_results(make_sweep(tmp_path / "before", labels=("ours",), change=earlier))
    assert [fit.row.source for fit in worst(now.fits, limit)] == [MATERIALS[k] for k in (1, 0, 2)]
    assert [word(limit, pair.change(limit) or 0) for pair in compared(now, before).pairs] == ["same", "worse", "better"]
    assert change(limit, math.inf, math.inf) == 0
    assert middle([fit.row for fit in now.fits], "highlight_limit") == 0.2


def test_limits_are_rounded_up_as_in_the_verdict() -> None:
    given = (None, 0.0001, 0.0291, 0.0418, 0.05, 0.0669, 0.43999, 1.0, 1.1517, 4.4006, math.inf)
    assert [limit_figure(value) for value in given] == [
        "–", "0.1%", "3%", "4.2%", "5%", "7%", "44%", "100%", "×2.2", "×5.5", "unknown"
    ]  # fmt: skip


def links(page: Path) -> list[Path]:
    """The files that a page leads to, with what it shows."""
    found = re.findall(r"(?:href|src)=[\"']([^\"'#]+)", page.read_text(encoding="utf-8"))
    return [page.parent / html.unescape(each) for each in found if not each.startswith("data:")]


def test_the_site_is_its_pages_and_every_link_leads_somewhere(made: tuple[Path, Path]) -> None:
    folder, site = made
    names = {str(each.relative_to(site)) for each in site.rglob("*") if each.is_file()}
    keys = {row.key: row for row in rows_of(folder)}
    fitted = {key for key, row in keys.items() if row.textures}
    assert {name for name in names if "/" not in name} == {
        "index.html", "site.json", "fits.csv", "fits.parquet", "aside.csv", "aside.parquet"
    }  # fmt: skip
    assert {name for name in names if name.startswith("fits/")} == (
        {f"fits/{key}.png" for key in keys}
        | {f"fits/{key}.html" for key in fitted}
        | {f"fits/{key}_texture_{k}.png" for key in fitted for k in (0, 1)}
    )
    data = data_of(site / "index.html")
    assert {f"materials/{each['page']}.html" for each in data["materials"]} == {
        name for name in names if name.startswith("materials/")
    }
    for page in (site / "materials").iterdir():
        assert links(page)
        assert all(each.is_file() for each in links(page)), page
        ids = re.findall(r"id='([0-9a-f]{32})'", page.read_text(encoding="utf-8"))
        assert ids == [each[9] for each in data["fits"] if data["materials"][each[0]]["page"] == page.stem]
    assert "://" not in (site / "index.html").read_text("utf-8").replace("http://www.w3.org/2000/svg", "")


def test_the_tables_are_the_figures_in_full(made: tuple[Path, Path]) -> None:
    folder, site = made
    rows = rows_of(folder)
    with (site / "fits.csv").open(encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    assert [each["key"] for each in found] == [row.key for row in rows]
    for row, each in zip(rows, found, strict=True):
        for name, value in row.cells().items():
            assert each[name] == ("" if value is None else str(value)), name
        assert json.loads(each["settings"])["seed"] == row.seed
        assert json.loads(each["opening"])["count"] == COUNT
    assert [row.metrics["log_mse"] for row in rows] == [0.001 * k for k in (1, 2, 4, 5, 7, 8)]
    with (site / "aside.csv").open(encoding="utf-8", newline="") as file:
        aside = list(csv.DictReader(file))
    assert sorted(each["source"] for each in aside) == sorted(MATERIALS)
    assert all("a test <i>wants</i> it" in each["reason"] for each in aside)


def test_parquet_holds_what_the_csv_does(made: tuple[Path, Path]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    folder, site = made
    table = parquet.read_table(site / "fits.parquet").to_pylist()
    assert table == [each for each in tables.fit_rows(read_results(folder).fits)]
    assert table[0]["log_mse"] == 0.001
    assert type(table[0]["bytes"]) is int
    assert type(table[0]["trusted"]) is bool


def test_without_pyarrow_there_is_csv_and_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from homofact.cli.main import main

    monkeypatch.setattr(extras, "installed", lambda module: module != "pyarrow")
    folder = make_sweep(tmp_path / "s", labels=("ggx",))
    assert main(["report", str(folder), "--out", str(tmp_path / "site"), "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == "homofact: no Parquet: pyarrow is not installed, expected it (pip install 'homofact[report]')\n"
    assert json.loads(out)["fits"] == 3
    assert not list((tmp_path / "site").glob("*.parquet"))
    assert "parquet" not in json.dumps(data_of(tmp_path / "site" / "index.html"))


def test_a_material_s_page_says_all_of_its_fits(made: tuple[Path, Path]) -> None:
    folder, site = made
    for page, fits in read_results(folder).materials().items():
        text = (site / "materials" / f"{page}.html").read_text(encoding="utf-8")
        for fit in fits:
            card = text.partition(f"id='{fit.row.key}'")[2].partition("</section>")[0]
            assert html.escape(fit.summary) in card
            assert ("Open the viewer" in card) == bool(fit.row.textures)
            assert all(html.escape(each.found) in card for each in fit.findings)
        assert "Set aside" in text
        assert "&lt;i&gt;wants&lt;/i&gt;" in text
    odd = next(each for each in (site / "materials").iterdir() if "&lt;b&gt;odd" in each.read_text(encoding="utf-8"))
    assert "<b>odd" not in odd.read_text(encoding="utf-8")


def test_the_source_s_place_is_on_no_page(made: tuple[Path, Path]) -> None:
    """A published page need not tell where on whose machine the measurements were."""
    for page in made[1].rglob("*.html"):
        assert "folder/red" not in page.read_text(encoding="utf-8")


def test_files_of_one_name_are_told_apart(tmp_path: Path) -> None:
    sweep = read_results(make_sweep(tmp_path / "s", ("a/x.npz", "b/x.npz", "c/a/y.npz", "d/a/y.npz"), ("ggx",)))
    names = list(sweep.names().values())
    assert names[:2] == ["a/x.npz", "b/x.npz"]
    assert [re.sub("[0-9a-f]{8}$", "", name) for name in names[2:]] == ["y.npz ", "y.npz "]
    assert len(set(names)) == 4


def test_the_worst_are_the_worst_by_what_is_good_for_each_metric() -> None:
    given = [
        {"log_mse": 0.1, "highlight": 1.2, "psnr_sky": 40.0},
        {"log_mse": 0.3, "highlight": 0.5, "psnr_sky": 20.0},
        {"log_mse": 0.2, "highlight": 1.0, "psnr_sky": 30.0},
        {"log_mse": None, "highlight": 1.9, "psnr_sky": None},
    ]
    fits = read_of(given).fits
    order = {name: [fit.row.seed for fit in worst(fits, metric)] for name, metric in BY_NAME.items()}
    # 0.5 is a factor 2 off, 1.9 less.
    assert order["log_mse"] == [1, 2, 0]
    assert order["highlight"] == [1, 3, 0, 2]
    assert order["psnr_sky"] == [1, 2, 0]
    assert order["rms_cosine"] == []
    many = read_of([{"log_mse": k / 7} for k in range(30)]).fits
    assert [fit.row.seed for fit in worst(many, BY_NAME["log_mse"])] == list(range(29, 19, -1))


@pytest.mark.parametrize(
    ("name", "before", "now", "step", "said"),
    [
        ("log_mse", 0.2, 0.1, -0.5, "better"),
        ("log_mse", 0.1, 0.2, 0.5, "worse"),
        ("log_mse", 0.1, 0.1009, 0.0009 / 0.1009, "same"),
        ("log_mse", 0.0, 0.0, 0.0, "same"),
        ("highlight", 1.25, 0.9, 1 / 0.9 - 1.25, "better"),
        ("highlight", 1.0, 0.8, 0.25, "worse"),
        ("highlight", 1.0, 1.009, 0.009, "same"),
        ("highlight", 1.0, 0.0, 1e6 - 1, "worse"),
        ("highlight", 0.0, 0.0, 0.0, "same"),
        ("psnr_sky", 30.0, 31.0, -1.0, "better"),
        ("psnr_sky", 30.0, 29.95, 0.05, "same"),
        ("psnr_sky", 30.0, 29.8, 0.2, "worse"),
    ],
)
def test_a_change_is_for_the_worse_where_the_figure_is(
    name: str, before: float, now: float, step: float, said: str
) -> None:
    assert change(BY_NAME[name], before, now) == pytest.approx(step)
    assert word(BY_NAME[name], change(BY_NAME[name], before, now)) == said


def test_two_sweeps_are_compared_fit_by_fit(tmp_path: Path) -> None:
    def earlier(report: dict[str, Any], its: Any) -> None:
        report["error"]["held_out"]["log_mse"] *= 2 if its.label == "ours" else 0.5

    now = make_sweep(tmp_path / "now", labels=("ours", "ggx", "new"))
    before = make_sweep(tmp_path / "before", (*MATERIALS[:2], "gone.npz"), change=earlier, version="0.1.0", name="old")
    found = compared(read_results(now), read_results(before))
    assert (len(found.pairs), found.only_now, found.only_before) == (4, 5, 2)
    # 0.001, 0.002, 0.004, 0.005 now; twice or half of 0.001, 0.002, 0.003, 0.004 before.
    assert [word(BY_NAME["log_mse"], each.change(BY_NAME["log_mse"]) or 0) for each in found.pairs] == [
        "better", "worse", "better", "worse"
    ]  # fmt: skip
    assert found.counts(BY_NAME["log_mse"]) == {"better": 2, "same": 0, "worse": 2}
    assert found.counts(BY_NAME["mae"]) == {"better": 0, "same": 4, "worse": 0}
    rows = [row for row in comparison_rows(found) if row["metric"] == "log_mse"]
    assert [(row["before"], row["now"]) for row in rows] == [
        (0.002, 0.001),
        (0.001, 0.002),
        (0.006, 0.004),
        (0.002, 0.005),
    ]
    assert {(row["version_before"], row["version_now"]) for row in rows} == {("0.1.0", found.pairs[0].now.task.version)}
    site = write_site(now, tmp_path / "site", before)
    data = data_of(tmp_path / "site" / "index.html")
    # The largest change first.
    assert [each[3] for each in data["comparison"]["changes"]["log_mse"]] == ["worse", "better", "worse", "better"]
    assert site.record["against"]["counts"]["log_mse"] == {"better": 2, "same": 0, "worse": 2}
    with (tmp_path / "site" / "comparison.csv").open(encoding="utf-8", newline="") as file:
        assert next(csv.DictReader(file))["now"] == "0.001"


def test_equal_sweeps_make_equal_sites(made: tuple[Path, Path], tmp_path: Path) -> None:
    folder, site = made
    write_site(folder, tmp_path / "again")
    for each in site.rglob("*"):
        other = tmp_path / "again" / each.relative_to(site)
        assert other.is_dir() if each.is_dir() else other.read_bytes() == each.read_bytes(), each


def test_a_report_is_replaced_by_force_alone_and_what_is_its_owner_s_stays(tmp_path: Path) -> None:
    folder, site = make_sweep(tmp_path / "s", labels=("ours", "ggx")), tmp_path / "site"
    write_site(folder, site, viewers=False)
    assert not list(site.glob("fits/*.html"))
    with pytest.raises(BadInput, match="found an existing report, expected a new folder or `force=True`"):
        write_site(folder, site)
    (site / "notes.txt").write_text("mine")
    (site / "fits" / "notes.txt").write_text("mine too")
    make_sweep(tmp_path / "fewer", MATERIALS[:1], ("ggx",))
    write_site(tmp_path / "fewer", site, force=True)
    assert (site / "notes.txt").read_text() == "mine"
    assert (site / "fits" / "notes.txt").read_text() == "mine too"
    assert len(list((site / "materials").iterdir())) == 1
    assert len(list(site.glob("fits/*.png"))) == 1
    assert sorted(each.name for each in tmp_path.iterdir()) == ["fewer", "s", "site"]


def test_a_site_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, site = make_sweep(tmp_path / "s", labels=("ggx",)), tmp_path / "site"
    write_site(folder, site)
    before = {each: each.read_bytes() for each in site.rglob("*") if each.is_file()}

    def fail(*_: Any) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(site_module, "index_html", fail)
    for place in (site, tmp_path / "other"):
        with pytest.raises(KeyboardInterrupt):
            write_site(folder, place, force=True)
    assert {each: each.read_bytes() for each in site.rglob("*") if each.is_file()} == before
    assert sorted(each.name for each in tmp_path.iterdir()) == ["s", "site"]


def test_what_is_still_to_do_is_said(tmp_path: Path) -> None:
    folder = make_sweep(tmp_path / "s", labels=("ggx", "bad"), refused=("bad",))
    ledger = SweepLedger(folder)
    ledger.begin("a test", [*ledger.asked(), task("later.npz", "ggx")])
    # A worker died of it once: it is tried again.
    ledger.set_aside(task("later.npz", "ggx"), "died", 1)
    sweep = read_results(folder)
    assert (len(sweep.fits), len(sweep.aside), sweep.left) == (3, 3, 1)
    assert index_data(sweep, {fit.row.key: NOTHING for fit in sweep.fits}, None, [])["left"] == 1


def test_thousands_of_fits_are_a_page_of_some_hundred_bytes_each() -> None:
    sweep = read_of([{metric.name: 0.1234567 * (k + 1) for metric in REPORTED} for k in range(3000)], ("a", "b"))
    page = index_html(sweep, {fit.row.key: NOTHING for fit in sweep.fits}, None, ["fits.csv"])
    assert len(page) < 40_000 + 200 * 3000
