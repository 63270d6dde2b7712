"""The report opened and clicked through in a headless Chromium, from a folder and without network."""

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from browser import browser, complaints, headless, requests
from swept import MATERIALS, make_sweep, read_of

from homofact.evaluation.metric_table import REPORTED
from homofact.sweeps.report.comparison import worst
from homofact.sweeps.report.index_page import index_html
from homofact.sweeps.report.material_page import FitFiles
from homofact.sweeps.report.reading import read_results
from homofact.sweeps.report.site import write_site
from homofact.sweeps.summary import limit_figure

MANY = 5000
KEYS = {"Enter": "\ue007", "Down": "\ue015", "Up": "\ue013", "Left": "\ue012", "Right": "\ue014", "End": "\ue010",
        "Home": "\ue011", "PageDown": "\ue00f"}  # fmt: skip


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser() as driver:
        yield driver


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three materials by two methods and two seeds, compared with a sweep whose errors were twice as large."""
    place = tmp_path_factory.mktemp("sweep")

    def earlier(report: dict[str, Any], its: Any) -> None:
        report["error"]["held_out"]["log_mse"] *= 2

    now = make_sweep(place / "now", labels=("ours", "ggx", "bad"), seeds=(0, 1), refused=("bad",))
    before = make_sweep(place / "before", labels=("ours", "ggx"), seeds=(0,), change=earlier)
    write_site(now, place / "site", before)
    return place / "site"


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of thousands of fits."""
    sweep = read_of([{m.name: (7919 * k % 1000 + 1) / 500 for m in REPORTED} for k in range(MANY)], ("one", "two"))
    nothing = {fit.row.key: FitFiles(None, (), None, "") for fit in sweep.fits}
    page = tmp_path_factory.mktemp("many") / "index.html"
    page.write_text(index_html(sweep, nothing, None, ["fits.csv"]), encoding="utf-8")
    return page


@pytest.fixture
def page(chromium: Any, site: Path) -> Iterator[Any]:
    """The first page of the site; afterwards it must have been silent, and must have asked for the site alone."""
    complaints(chromium)
    requests(chromium)
    headless.resize(chromium, (1400, 900))
    headless.open_page(chromium, site / "index.html")
    yield chromium
    assert complaints(chromium) == []
    assert {each.partition("#")[0] for each in requests(chromium)} <= {
        each.as_uri() for each in site.rglob("*") if each.is_file()
    }


def all_of(driver: Any, selector: str) -> list[Any]:
    return driver.find_elements("css selector", selector)


def one(driver: Any, selector: str) -> Any:
    return driver.find_element("css selector", selector)


def column(driver: Any, title: str) -> list[str]:
    """What a column of the table of all fits says, in the rows that are there."""
    return driver.execute_script(
        "const heads = [...document.querySelectorAll('#table thead th')];"
        "const k = heads.findIndex((head) => head.textContent.startsWith(arguments[0]));"
        "return [...document.querySelectorAll('#table tbody tr[id]')].map((row) => row.children[k].textContent)",
        title,
    )


def choose(driver: Any, selector: str, value: str) -> None:
    driver.execute_script(
        "const [chosen, value] = arguments; chosen.value = value; chosen.dispatchEvent(new Event('change'))",
        one(driver, selector), value,
    )  # fmt: skip


def test_the_table_is_sorted_by_a_click_and_back_by_another(page: Any) -> None:
    assert column(page, "Seed") == ["0", "1"] * 6
    head = next(each for each in all_of(page, "#table thead button") if each.text.startswith("log MSE"))
    head.click()
    rising = [float(each) for each in column(page, "log MSE")]
    assert rising == sorted(rising)
    assert len(rising) == 12
    assert head.find_element("xpath", "..").get_attribute("aria-sort") == "ascending"
    head.click()
    assert [float(each) for each in column(page, "log MSE")] == rising[::-1]
    all_of(page, "#table thead button")[0].click()
    assert column(page, "Material") == sorted(column(page, "Material"))
    assert head.find_element("xpath", "..").get_attribute("aria-sort") is None


def test_names_are_whole_and_limits_are_those_of_the_verdict(chromium: Any, tmp_path: Path) -> None:
    given = [0.0001, 0.0291, 0.0418, 0.05, 0.0501, 0.0669, 0.1, 0.43999, 1.0, 1.1517, 4.4006, 9.0, math.inf]
    sweep = read_of([{"log_mse": 0.1, "mae": 0.1} for _ in given], ("a rather long method, 12288 B", "b, 6144 B"))
    fits = tuple(
        replace(fit, row=replace(fit.row, limits={"highlight_limit": value}))
        for fit, value in zip(sweep.fits, given, strict=True)
    )
    sweep = replace(sweep, fits=fits)
    file = tmp_path / "index.html"
    file.write_text(
        index_html(sweep, {fit.row.key: FitFiles(None, (), None, "") for fit in fits}, None, []), encoding="utf-8"
    )
    headless.resize(chromium, (1000, 900))
    headless.open_page(chromium, file)
    assert column(chromium, "highlight within") == [limit_figure(value) for value in given]
    cut = chromium.execute_script(
        "return [...document.querySelectorAll('#table tbody td')].filter((cell) => cell.scrollWidth > cell.clientWidth)"
        ".map((cell) => cell.textContent)"
    )
    assert cut == []
    heads = [each.text for each in all_of(chromium, "#table thead th")]
    assert "albedo" not in heads
    assert "Columns left out: albedo" in one(chromium, "#notes").text
    choose(chromium, "#metric", "highlight_limit")
    assert one(chromium, "#worst em").text == "unknown"
    # An unknown limit has no place in a chart.
    assert len(dots(chromium, "bytes")) == len(given) - 1
    assert "1 of 13 fits" in one(chromium, "#bytes-plot .reading").text
    assert complaints(chromium) == []


@pytest.mark.slow
def test_what_is_looked_for_and_which_methods_are_on_narrow_the_table(page: Any) -> None:
    one(page, "#find").send_keys("red PAINT")
    assert set(column(page, "Material")) == {"red paint.npz"}
    assert one(page, "#found").text == "4 of 12 fits"
    all_of(page, "#methods button")[1].click()
    assert set(column(page, "Method")) == {"ours"}
    assert one(page, "#found").text == "2 of 12 fits"
    assert all_of(page, "#methods button")[1].get_attribute("aria-pressed") == "false"
    assert len(dots(page, "bytes")) == 6
    all_of(page, "#methods button")[1].click()
    assert len(dots(page, "bytes")) == 12


def dots(driver: Any, plot: str) -> list[tuple[str, float, float, float]]:
    """(key, the axis's figure, across, up) of every dot, in pixels of the window."""
    return driver.execute_script(
        "const plot = window.homofact.plots[arguments[0]], box = plot.svg.getBoundingClientRect();"
        "const scale = box.width / plot.width;"
        "return plot.dots.map(({fit, left, top}) => [fit.key, fit[arguments[0]], box.left + scale * left,"
        " box.top + scale * top])",
        plot,
    )


@pytest.mark.slow
@pytest.mark.parametrize("plot", ["bytes", "seconds"])
def test_a_dot_is_where_its_figures_are_and_opens_its_material_s_page(plot: str, page: Any, site: Path) -> None:
    fits = {fit.row.key: fit for fit in read_results(site.parent / "now").fits}
    found = dots(page, plot)
    assert {key for key, *_ in found} == set(fits)
    for one_key, one_value, left, top in found:
        assert one_value == pytest.approx(getattr(fits[one_key].row, plot), rel=1e-5)
        for other_key, other_value, other_left, other_top in found:
            more = (fits[one_key].row.metrics["log_mse"] or 0) - (fits[other_key].row.metrics["log_mse"] or 0)
            assert more <= 0 or top < other_top
            assert one_value <= other_value or left > other_left
    key, _, left, top = found[-1]
    mouse = pytest.importorskip("selenium.webdriver.common.actions.action_builder").ActionBuilder(page)
    mouse.pointer_action.move_to_location(round(left) + 3, round(top) - 3).click()
    mouse.perform()
    assert page.current_url.endswith(f"/materials/{fits[key].material}.html#{key}")
    assert page.execute_script("return document.querySelector('.fit:target').id") == key
    one(page, ".crumbs a").click()
    assert page.current_url.endswith("/index.html")


@pytest.mark.slow
def test_a_finger_opens_a_dot_s_page(page: Any) -> None:
    page.execute_script("window.scrollTo(0, 0)")
    key, _, left, top = dots(page, "seconds")[0]
    page.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": left, "y": top}]})
    page.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    arrived(page, f"#{key}")


def arrived(driver: Any, ending: str) -> None:
    """Wait until the page's address ends so."""
    for _ in range(200):
        if driver.current_url.endswith(ending):
            return
        time.sleep(0.02)
    raise AssertionError(driver.current_url)


@pytest.mark.slow
def test_the_metric_is_chosen_for_charts_worst_and_changes(page: Any, site: Path) -> None:
    fits = read_results(site.parent / "now").fits
    for metric in REPORTED:
        choose(page, "#metric", metric.name)
        names = [each.get_attribute("href").partition("#")[2] for each in all_of(page, "#worst a")]
        assert names == [fit.row.key for fit in worst(fits, metric)]
        assert metric.words in one(page, "#bytes-plot svg").get_attribute("aria-label")
        assert one(page, "#comparison-changes h3").text.startswith(metric.words)
    choose(page, "#metric", "log_mse")
    choose(page, "#worst-of", "2")
    of_ggx = [fit for fit in fits if fit.row.label == "ggx"]
    names = [each.get_attribute("href").partition("#")[2] for each in all_of(page, "#worst a")]
    assert names == [fit.row.key for fit in worst(of_ggx, REPORTED[0])]


def best_shown(page: Any) -> list[tuple[str, str]]:
    """(key of the fit, its figure) of each row of the best."""
    rows = all_of(page, "#best tbody tr")
    cells = [row.find_elements("css selector", "th a, td") for row in rows]
    return [(link.get_attribute("href").partition("#")[2], own[1].text) for link, *own in cells]


@pytest.mark.slow
def test_the_best_fit_of_each_material_is_of_the_metric_and_the_methods_shown(page: Any, site: Path) -> None:
    fits = read_results(site.parent / "now").fits

    def best(metric: Any, labels: set[str]) -> list[str]:
        found: dict[str, Any] = {}
        for fit in (fit for fit in fits if fit.row.label in labels):
            value = fit.row.metrics[metric.name]
            rank = (metric.badness(value), fit.row.bytes)
            if fit.material not in found or rank < found[fit.material][0]:
                found[fit.material] = rank, fit.row.key
        return [key for _, key in found.values()]

    for metric in REPORTED:
        choose(page, "#metric", metric.name)
        assert [key for key, _ in best_shown(page)] == best(metric, {"ours", "ggx"})
    choose(page, "#metric", "log_mse")
    assert [figure for _, figure in best_shown(page)] == ["0.001", "0.007", "0.013"]
    all_of(page, "#methods button")[0].click()
    assert [key for key, _ in best_shown(page)] == best(REPORTED[0], {"ggx"})
    assert not one(page, "#epsilons").is_displayed()


@pytest.mark.slow
def test_fits_of_several_epsilons_are_told_apart(chromium: Any, many: Path) -> None:
    headless.open_page(chromium, many)
    choose(chromium, "#metric", "log_mse")
    assert one(chromium, "#epsilons").is_displayed()
    assert "ε" in [each.text for each in all_of(chromium, "#table thead th")]
    choose(chromium, "#metric", "mae")
    assert not one(chromium, "#epsilons").is_displayed()


@pytest.mark.slow
def test_what_changed_is_counted_and_listed(page: Any) -> None:
    words = one(page, "#comparison-words").text
    assert "6 fits of the same source, method and seed are in both, 6 are new, 0 are gone" in words
    rows = [each.text for each in all_of(page, "#comparison-counts tbody tr")]
    # 0.001 (1, 3, 7, 9, 13, 15) now, twice of 0.001 (1, 2, 3, 4, 5, 6) before.
    assert rows[0] == "log MSE, held out 2 0 4"
    assert rows[1] == "MAE, held out, sr⁻¹ 0 6 0"
    said = [each.text for each in all_of(page, "#comparison-changes tbody td:last-child")]
    assert sorted(said) == ["better"] * 2 + ["worse"] * 4


@pytest.mark.slow
def test_what_was_set_aside_is_named_with_its_reason(page: Any) -> None:
    rows = all_of(page, "#aside-table tbody tr")
    assert len(rows) == 6
    assert all("a test <i>wants</i> it" in each.text for each in rows)
    assert "<b>odd<i>" in one(page, "#aside-table").text
    files = [each.text for each in all_of(page, "#files a")]
    assert [each for each in files if each.endswith(".csv")] == ["fits.csv", "aside.csv", "comparison.csv"]


@pytest.mark.slow
def test_the_keys_walk_the_table_and_the_chart(page: Any) -> None:
    table = one(page, "#table")
    page.execute_script("arguments[0].focus()", table)
    for key in ("Down", "Down", "Up", "Down"):
        table.send_keys(KEYS[key])
    chosen = all_of(page, "#table tr.chosen")
    assert [each.get_attribute("id") for each in chosen] == ["row-1"]
    assert table.get_attribute("aria-activedescendant") == "row-1"
    plot = one(page, "#seconds-plot svg")
    plot.send_keys(KEYS["Home"])
    first = one(page, "#seconds-plot .reading").text
    plot.send_keys(KEYS["Right"])
    assert one(page, "#seconds-plot .reading").text != first
    plot.send_keys(KEYS["Left"])
    assert one(page, "#seconds-plot .reading").text == first
    table.send_keys(KEYS["Enter"])
    assert "/materials/" in page.current_url


@pytest.mark.slow
def test_a_material_s_page_shows_its_pictures_and_opens_its_viewer(page: Any, site: Path) -> None:
    all_of(page, "#table tbody a")[0].click()
    assert len(all_of(page, ".fit")) == 4
    page.execute_script("for (const each of document.images) each.loading = 'eager'")
    sizes = page.execute_async_script(
        "const done = arguments[0];"
        "Promise.all([...document.images].map((image) => image.decode())).then("
        "() => done([...document.images].map((image) => image.naturalWidth)), (error) => done(String(error)))"
    )
    # Two fits with two textures and a picture, two models with a picture.
    assert sorted(sizes) == [8] * 4 + [258] * 4
    all_of(page, "a.button")[0].click()
    headless.first_frame(page)
    assert page.execute_script("return window.homofact.layers") == ["fit", "source"]  # the fit is McCool's


@pytest.mark.slow
@pytest.mark.parametrize("width", [420, 1400])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_fit_their_window_and_follow_its_colours(width: int, scheme: str, page: Any, site: Path) -> None:
    page.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    )
    headless.resize(page, (width, 900))
    for each in (site / "index.html", sorted((site / "materials").iterdir())[0]):
        page.get(each.as_uri())
        wide, grey = page.execute_script(
            "return [document.documentElement.scrollWidth,"
            " getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)]"
        )
        assert wide == width
        assert (min(grey) > 200) == (scheme == "light")
        assert (max(grey) < 60) == (scheme == "dark")


@pytest.mark.slow
def test_of_thousands_of_fits_only_those_in_sight_are_there(chromium: Any, many: Path) -> None:
    complaints(chromium)
    headless.resize(chromium, (1400, 900))
    headless.open_page(chromium, many)
    rows = "#table tbody tr[id]"
    assert len(all_of(chromium, rows)) < 60
    assert len(dots(chromium, "bytes")) == MANY
    # The best fit of each material has a row that is always there.
    assert len(all_of(chromium, "body *:not(#best *)")) < 1500
    table = one(chromium, "#table")
    table.send_keys(KEYS["End"])
    assert [each.get_attribute("id") for each in all_of(chromium, "#table tr.chosen")] == [f"row-{MANY - 1}"]
    assert column(chromium, "Seed")[-1] == str(MANY - 1)
    assert len(all_of(chromium, rows)) < 60
    chromium.execute_script("arguments[0].scrollTop = 30 * 2500; ", table)
    chromium.execute_async_script("const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done))")
    seen = [int(each.get_attribute("id")[4:]) for each in all_of(chromium, rows)]
    assert seen == list(range(seen[0], seen[0] + len(seen)))
    assert seen[0] <= 2500 <= seen[-1] - 15
    head = next(each for each in all_of(chromium, "#table thead button") if each.text.startswith("energy"))
    head.click()
    values = [float(each) for each in column(chromium, "energy")]
    assert values == sorted(values)
    assert values[0] == 0.002
    assert complaints(chromium) == []


@pytest.mark.slow
def test_markup_in_names_stays_text(page: Any) -> None:
    names = set(column(page, "Material"))
    assert names == {"phong-10", "red paint.npz", '<b>odd<i> & "name".npz'}
    assert len(MATERIALS) == len(names)
    assert all_of(page, "#table b") == []
