"""Fragment shaders timed in one page: the page's values are Python's, and its table has every way."""

import importlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser, headless, requests, skip_without_browser
from shading_cases import CASES

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.containers.formats import FORMATS
from homofact.exporting.exported import exported
from homofact.geometry.directions import draw_uniform
from homofact.geometry.expression import Let, call, variable
from homofact.geometry.interpret import interpret, value_of
from homofact.geometry.torch_functions import TORCH
from homofact.shading.program import Program

Script = Callable[[str], ModuleType]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Script:
    # The browser of the tests and that of the script are one file: let its errors be caught as they are.
    monkeypatch.setitem(sys.modules, "headless", headless)
    for name in ("shader_throughput", "shader_ways"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return lambda name: importlib.import_module(f"scripts.{name}")


def run(program: Program, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
    """The program's values (N, C) in the type of the directions."""
    values: dict[str, list[Any]] = {"wi": list(wi.T), "wo": list(wo.T)}
    values = interpret(program.statements, values, TORCH)
    return torch.stack(value_of(program.result, values, TORCH), -1)


LOBES = (GgxLobe((0.4, 0.5, 0.6), 0.02, 0.04), GgxLobe((0.1, 0.2, 3.0), 0.4, 0.5))


@pytest.mark.parametrize("lobes", [LOBES[:1], LOBES[1:], LOBES], ids=["narrow", "wide", "both"])
def test_the_ggx_program_is_the_model(script: Script, lobes: tuple[GgxLobe, ...]) -> None:
    model = GgxBrdf((0.3, 0.2, 0.1), lobes)
    program = script("speed.ggx_program").ggx_program(model)
    wi, wo = draw_uniform(2000, torch.Generator().manual_seed(1))
    mirrored = wi * torch.tensor([-1.0, -1, 1], dtype=torch.float64)
    near = torch.nn.functional.normalize(mirrored + 0.02 * wo, dim=1)
    for seen in (wo, mirrored, near, wi):
        expected = model.evaluate(wi, seen)
        assert torch.allclose(run(program, wi, seen), expected, rtol=1e-9, atol=0)
        # Single precision holds at the peak of a narrow lobe too.
        single = run(program, wi.float(), seen.float()).double()
        assert float(((single - expected) / expected).abs().max()) < 1e-3
    flat = torch.tensor([[1.0, 0, 0]], dtype=torch.float64)
    assert torch.allclose(run(program, flat, -flat), model.evaluate(flat, -flat), rtol=1e-9)
    assert not run(program, wi, -wo).any()


def test_directions_are_unit_above_the_horizon_and_all_different(script: Script) -> None:
    module = script("speed.shader_ways")
    wi, wo = module.directions(4000)
    for w in (wi, wo):
        assert torch.allclose(w.norm(dim=1), torch.ones(4000, dtype=torch.float64))
        assert float(w[:, 2].min()) > 0
        assert float(w.mean(0)[:2].abs().max()) < 0.05
        assert 0.45 < float(w[:, 2].mean()) < 0.55
        assert len(torch.unique(w, dim=0)) == 4000
    assert float(np.corrcoef(wi[:, 0], wo[:, 0])[0, 1]) < 0.05
    assert not torch.equal(module.directions(4000, 1)[0], wi)
    assert torch.equal(module.directions(10)[0], wi[:10])


def network(seed: int) -> NeuralBrdf:
    generator = torch.Generator().manual_seed(seed)
    w0, w1, w2 = (torch.randn(shape, generator=generator, dtype=torch.float64) * 0.4 for shape in LAYERS)
    b0, b1, b2 = (torch.randn(shape[1], generator=generator, dtype=torch.float64) * 0.4 for shape in LAYERS)
    return NeuralBrdf((w0, w1, w2), (b0, b1, b2))


class Louder:
    """A reflectance one hundredth above another: what a wrong shader looks like from Python."""

    def __init__(self, inner: Any) -> None:
        self.inner = inner

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        return self.inner.evaluate(wi, wo) * 1.01


@pytest.fixture
def ways(script: Script) -> list[Any]:
    """Ways of every kind, on random numbers.

    "wrong" is GGX with values in Python that are not its own, "nan" a shader without values.
    """
    module = script("speed.shader_ways")
    sums = Program((), variable("wi", 3) + variable("wo", 3), (), ("R", "G", "B"), ())
    made = [module.Way("empty", "nothing", sums, (), module.Sum(), None, None)]
    for name, form in (("five of all kinds", "exr"), ("warped half-diff", "ktx2"), ("fixed h", "png8")):
        made.append(module.of_textures(f"textures-{form}", f"<b>{name}</b>", exported(CASES[name], FORMATS[form]), 0.1))
    net, model = network(0), GgxBrdf((0.3, 0.2, 0.1), LOBES)
    made.append(
        module.Way("network", "network", script("speed.network_program").network_program(net), (), net, 0.2, net.nbytes)
    )
    program = script("speed.ggx_program").ggx_program(model)
    made += [
        module.Way(key, key, program, (), what, 0.3, 52) for key, what in (("ggx", model), ("wrong", Louder(model)))
    ]
    nan = Program((), variable("wi", 3) * call("sqrt", variable("wi", 3).z * -1), (), ("R", "G", "B"), ())
    return [*made, module.Way("nan", "nan", nan, (), module.Sum(), None, None)]


# Milliseconds by the page's clock and by the GPU's: of the network alone 20, of GGX 5 by median and by the GPU 4.
TIMES = """
  const of = (clock, gpu) => clock.map((ms) => ({ clock: ms, gpu }));
  const ways = [["empty", 0], ["ggx", 0.5], ["network", 0.5]].map(([key, difference]) => (
    { key, name: key, bytes: null, fetches: 0, operations: 1, error: null, difference, allowed: 0.1 }));
  return table(ways, { pairs: 1000, times: { empty: of([10, 20, 10], 2), ggx: of([15, 27, 13], 6),
    network: of([30, 40, 30], 12) } });
"""


@pytest.mark.slow
def test_the_page_s_values_are_python_s_and_a_wrong_shader_shows(
    script: Script, ways: list[Any], tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    page.write_text(script("speed.shader_throughput").page_of(ways, "t</script>", "about", 0.002, 16, 3, 0.1), "utf-8")
    with browser() as driver:
        headless.open_page(driver, page)
        driver.execute_async_script(
            "const done = arguments[0];"
            "(function wait() { homofact.results || homofact.trouble ? done() : setTimeout(wait, 20); })();"
        )
        assert driver.execute_script("return homofact.trouble") is None
        found = driver.execute_script("return homofact.results")
        asked = [url for url in requests(driver) if not url.startswith("file:")]
        headings = driver.execute_script("return [...document.querySelectorAll('tbody th')].map((e) => e.textContent)")
        made = driver.execute_script(TIMES)
        title, bad = driver.execute_script(
            "return [document.querySelector('h1').textContent, document.querySelectorAll('.bad').length]"
        )
    assert asked == []
    assert (title, headings, bad) == ("t</script>", [way.name for way in ways], 2)
    rows = {row["key"]: row for row in found["rows"]}
    assert {key for key, row in rows.items() if not row["agrees"]} == {"wrong", "nan"}
    assert rows["wrong"]["cells"][-1].endswith("(DIFFERS)")
    assert 0.009 < rows["wrong"]["difference"] < 0.011
    assert rows["nan"]["cells"][-1] == "– (DIFFERS)"
    for key in ("empty", "network", "ggx"):
        assert rows[key]["difference"] < 1e-3, key
    for key in ("textures-exr", "textures-ktx2", "textures-png8"):
        # A sampler's own steps aside, which software does not have.
        assert rows[key]["difference"] < 2e-2, key
    # 16² fragments of 1000 pairs are 256,000 evaluations.
    empty, ggx, net = made["rows"]
    assert [empty["net"], empty["times"], net["times"]] == [None, None, 1]
    assert [empty["gross"], ggx["gross"], net["gross"]] == pytest.approx([25.6, 256 / 15, 256 / 30])
    assert [ggx["net"], ggx["gpu"], ggx["times"]] == pytest.approx([51.2, 64, 4])
    assert [net["net"], net["gpu"], net["spread"]] == pytest.approx([12.8, 25.6, 0])
    assert ggx["spread"] == pytest.approx(50 * (6 - 4) / 5)
    assert [each["agrees"] for each in (empty, ggx)] == [True, False]


@pytest.mark.slow
def test_what_does_not_compile_is_named(script: Script, ways: list[Any], tmp_path: Path) -> None:
    skip_without_browser()
    module, page = script("speed.shader_throughput"), tmp_path / "page.html"
    keyword = Program((Let("flat", variable("wi", 3)),), variable("flat", 3), (), ("R", "G", "B"), ())
    broken = script("speed.shader_ways").Way("ggx", "the broken one", keyword, (), ways[0].reflectance, None, None)
    page.write_text(module.page_of([ways[0], broken], "t", "a", 0.002, 16, 1, 0.1), "utf-8")
    with pytest.raises(module.BadInput, match=r"page\.html: the broken one: the shader does not compile") as caught:
        module.shown(page, 60)
    assert str(caught.value).isprintable()


@pytest.mark.slow
def test_a_table_of_wrong_values_is_not_written(
    script: Script, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("speed.shader_throughput"), tmp_path / "table.md"
    rows = [{"cells": ["ours", "1"], "agrees": True}, {"cells": ["GGX", "5", ".3 (DIFFERS)"], "agrees": False}]
    monkeypatch.setattr(module, "shown", lambda page: ({"rows": rows}, "a browser"))
    assert module.main(["material:lafortune-clay", "--short", "--run", "--out", str(out)]) == 2
    streams = capsys.readouterr()
    expected = "GGX: found values that differ from Python's by .3 (DIFFERS), expected them to agree\n"
    assert (streams.out, streams.err, out.exists()) == ("", expected, False)


@pytest.mark.slow
def test_the_table_has_all_ways(script: Script, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    skip_without_browser()
    module, out = script("speed.shader_throughput"), tmp_path / "table.md"
    assert module.main(["material:lafortune-clay", "--short", "--run", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert text in capsys.readouterr().out
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    header, rows = lines[0], {cells[0]: cells for cells in lines[2:]}
    assert list(rows) == [
        "empty: the directions alone", "two textures, RGBA16F", "McCool's two textures, RGBA16F", "two textures, RGBA8",
        "McCool's two textures, RGBA8", "NBRDF network", "GGX, one lobe",
    ]  # fmt: skip
    column = {name: header.index(name) for name in header}
    fetches = [int(cells[column["fetches"]]) for cells in rows.values()]
    assert fetches[1] in (2, 3, 4)
    assert fetches == [0, fetches[1], 3, fetches[1], 3, 0, 0]
    assert [cells[column["bytes"]] for cells in rows.values()] == ["–", "4096", "4080", "2048", "2040", "2700", "32"]
    assert rows["NBRDF network"][column["times the network"]] in ("1", "–")
    for cells in rows.values():
        assert float(cells[column["M/s, directions included"]]) > 0
        assert "DIFFERS" not in cells[-1]
    for words in ("SwiftShader", "32 × 32 fragments", "Chromium", "smoke test", "ε = "):
        assert words in text


@pytest.mark.slow
def test_without_run_a_page_is_written(script: Script, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    arguments = ["material:lafortune-clay", "--short", "--formats", "exr", "--page", str(page)]
    assert script("speed.shader_throughput").main(arguments) == 0
    text = page.read_text(encoding="utf-8")
    assert f"{page}: {len(text.encode()):,} bytes, 5 ways" in capsys.readouterr().out
    data = json.loads(text.partition('id="data">')[2].partition("</script>")[0])
    assert [texture["format"] for way in data["ways"] for texture in way["textures"]] == ["RGBA32F"] * 4
    assert "http" not in text.replace("http-equiv", "")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--formats", "ktx2,bc6h"], "--formats: found 'bc6h', expected some of exr"),
        (["--side", "8", "--run"], "--side: found 8, expected 16 to 4096"),
        (["--rounds", "0", "--run"], "--rounds: found 0, expected 1 to 1000"),
        (["--out", "x.md"], "--out: there is no table without --run"),
        (["material:none"], "none"),
    ],
)
def test_what_cannot_be_meant_is_one_line(
    script: Script, arguments: list[str], told: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert script("speed.shader_throughput").main([*arguments, "--short"]) == 2
    streams = capsys.readouterr()
    assert told in streams.err
    assert (streams.out, streams.err.count("\n"), list(tmp_path.iterdir())) == ("", 1, [])


def test_without_a_browser_there_is_nothing_to_run(
    script: Script, ways: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = script("speed.shader_throughput")
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(module.BadInput, match="no chromium on the PATH, expected Debian's chromium"):
        module.shown(tmp_path / "page.html")
