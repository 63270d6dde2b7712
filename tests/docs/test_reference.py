"""The pages of the Python interface: what they have of docstrings, signatures, fields and names."""

import ast
import re
from collections.abc import Iterator

import pytest

pytest.importorskip("pybtex", reason="the site's tools are not installed: pip install 'homofact[docs]'")

import homofact
from homofact.brdf.source_names import DEFAULT_COUNT, HELD_OUT
from homofact.sections import COMPARED
from sitemaker.docstrings import NOTHING, Section, blocks, linked, markdown, parsed
from sitemaker.members import listed
from sitemaker.modules import reference_modules
from sitemaker.names import CONSTANT, class_of, definition_of, described, scope_of
from sitemaker.navigation import DOCS, ROOT, written_pages
from sitemaker.reference import reference_pages
from sitemaker.signatures import arguments
from sitemaker.sources import first_sentence

HOMES = {name: f"homofact.{home}.{name}" for name, home in homofact._HOMES.items()}


def signature(path: str) -> str:
    function = definition_of(path)
    assert isinstance(function, ast.FunctionDef)
    return arguments(function, scope_of(path.rpartition(".")[0]), 0)


def fields(path: str, section: Section | None = None) -> str:
    node = class_of(path)
    assert node is not None
    return listed(node, scope_of(path.rpartition(".")[0]), section)


def test_defaults_are_values() -> None:
    compare = signature("homofact.api.comparing.compare")
    assert f"held_out: float={HELD_OUT}," in compare
    assert f"={COMPARED}," in compare
    assert f"count: int={DEFAULT_COUNT}," in signature("homofact.api.reading.read")
    assert "effort: str | float='quick'," in signature("homofact.api.planning.plan")
    assert "textures: Sequence[int]=(1, 2, 3)," in signature("homofact.api.charting.chart")
    # What is no constant of homofact's stays as it is written.
    assert "limit: float=math.pi / 2," in signature("homofact.brdf.symmetry.find_symmetry")
    assert f"- `count` (`int`). Default: `{DEFAULT_COUNT}`." in fields("homofact.brdf.source.Opening")


def test_types_are_spelled_out() -> None:
    plan = signature("homofact.api.planning.plan")
    assert "(scene: str | os.PathLike[str] | homofact.planning.scene.Scene, to:" in plan
    assert "progress: Callable[[homofact.api.progress.ProgressStep], object] | None=None)" in plan
    assert "'" not in signature("homofact.api.comparing.named_methods")
    metric = fields("homofact.evaluation.metric_table.Metric")
    assert "- `computed_from` (`Literal['pairs', 'light', 'picture']`)" in metric


def test_settings_have_the_help_and_the_default_of_their_declaration() -> None:
    assert "- `size` (`int`): Texels per side of a texture. Default: `16`." in fields("homofact.methods.mccool.McCool")
    nmf = fields("homofact.methods.nmf.Nmf")
    assert "- `textures` (`int`): Number of terms. Default: `2`." in nmf
    assert "One of `'in-out'`, `'half-diff'`. Default: `'half-diff'`." in nmf
    assert "Default: `None` (depends on the source)." in nmf


def test_a_key_without_a_default_is_required() -> None:
    sweep = fields("homofact.sweeps.sweep_file.SweepTable")
    assert "- `sources` (`tuple[str, ...]`): Files, or material:NAME; * ? and [ab] match. Required." in sweep
    assert "- `share` (`float`): Part of the picture. Required." in fields("homofact.planning.scene.SceneMaterial")


def test_fields_of_private_classes_are_listed_in_their_place() -> None:
    material = fields("homofact.planning.scene.SceneMaterial")
    assert material.index("- `source` (`str`)") < material.index("- `share`")
    table = fields("homofact.planning.scene.PlanSceneTable")
    assert "- `material` (`tuple[table, ...]`)\n  - `source` (`str`)\n  - `share`" in table
    assert "- `BUDGET`: `'budget'`" in fields("homofact.errors.Status")
    assert "- `coverage` (`Tensor`)" in fields("homofact.rendering.sphere.SphereImage")


def test_fields_are_described_once() -> None:
    text = "Attributes\n----------\nhigh, low : float\n    Limits.\nat : where the other field is."
    (section,) = parsed(text)[1]
    node = ast.parse(
        "@dataclass\nclass A:\n    high: float = 1.0\n    low: float = 0.0\n    at: int = 0\n    b: str = ''"
    )
    assert isinstance(node.body[0], ast.ClassDef)
    assert listed(node.body[0], NOTHING, section).split("\n") == [
        "**Attributes**",
        "",
        "- `high`, `low` (float): Limits. Default of `high`: `1.0`. Default of `low`: `0.0`.",
        "- `at` (`int`): where the other field is. Default: `0`.",
        "- `b` (`str`). Default: `''`.",
    ]


def test_docstrings_become_markdown() -> None:
    text = "N samples.\n\nAttributes\n----------\nwi, wo : (N, 3),\n    unit.\nvalues : sr⁻¹.\n\nTakes *args of `*x`."
    assert markdown(text) == (
        "N samples.\n\n**Attributes**\n\n- `wi`, `wo`: (N, 3),\n  unit.\n- `values`: sr⁻¹.\n\nTakes \\*args of `*x`."
    )
    assert markdown("Other lines with\n# are comments.") == "Other lines with\n\\# are comments."


def test_types_of_entries_are_told_from_their_words() -> None:
    long = "what is evaluated and saved: one of the many kinds of fits that this package has, or a"
    text = f"Parameters\n----------\nto : path\n    The folder.\nfit : {long}\n    model.\n**settings\n    Others."
    assert markdown(text).split("\n")[2:] == [
        "- `to` (path): The folder.",
        f"- `fit`: {long}",
        "  model.",
        "- `**settings`: Others.",
    ]


def test_code_becomes_blocks_of_its_language() -> None:
    assert blocks("Read:\n\n    fit = load(*x)\n\n    fit.save()\n\nIt *was*.", NOTHING) == (
        "Read:\n\n```python\nfit = load(*x)\n\nfit.save()\n```\n\nIt \\*was*."
    )
    # A formatter moves code to the margin where a docstring has nothing else after its first line.
    assert blocks('[[material]]  # one\nsource = "*"', NOTHING) == '```toml\n[[material]]  # one\nsource = "*"\n```'
    assert blocks("run(a, b)", NOTHING) == "```python\nrun(a, b)\n```"
    assert blocks("a.json     one\nb.json     two", NOTHING) == "```text\na.json     one\nb.json     two\n```"
    assert blocks("    cov y = σ² H⁻¹,", NOTHING) == "```text\ncov y = σ² H⁻¹,\n```"
    assert blocks("So:\n>>> 1 + 1\n2", NOTHING) == "So:\n\n```pycon\n>>> 1 + 1\n2\n```"
    for prose in ("Whole.", "Word", "0.", "", "One, two", "- a list\n  of it"):
        assert blocks(prose, NOTHING) == prose


@pytest.mark.parametrize(
    "sentence",
    [
        "The files of MERL (Matusik et al. 2003), with a layout.",
        "The transform (McCool 2001; thesis eq. 1.9, 1.10).",
        "Errors, e.g. of sums, i.e. of terms, as in fig. 3 (cf. eq. 2).",
        "One.",
    ],
)
def test_a_sentence_goes_on_after_an_abbreviation(sentence: str) -> None:
    assert first_sentence(f"{sentence.replace(' ', chr(10), 1)} Another one.\n\nMore.") == sentence


def test_names_in_code_lead_to_their_pages() -> None:
    scope = scope_of("homofact.api.result")
    assert linked("a `Finding` of `homofact.fit`", scope) == (
        "a {py:obj}`Finding <homofact.evaluation.verdict.finding.Finding>` of"
        " {py:obj}`homofact.fit <homofact.api.fitting.fit>`"
    )
    assert linked("`evaluation.energy`", scope) == "[`evaluation.energy`](/api/homofact.evaluation.energy.md)"
    assert linked("`fit`, `theta`, `report.json`, `Path`", scope) == "`fit`, `theta`, `report.json`, `Path`"


def test_constants_are_shown_with_their_values() -> None:
    from homofact.brdf import scattered

    scope = scope_of("homofact.brdf.scattered")
    told = linked("up to `GLOBAL_LIMIT`, `_MOST_BRIGHTER` times, `N`", scope)
    assert told == f"up to `GLOBAL_LIMIT = {scattered.GLOBAL_LIMIT}`, `{scattered._MOST_BRIGHTER}` times, `N`"


def test_what_is_returned_is_a_link() -> None:
    scope = scope_of("homofact.api.charting")
    text = "Draw.\n\nReturns\n-------\nChartResult\n    Every run.\n\nRaises\n------\nBadInput\n    For a fault."
    assert markdown(text, scope).split("\n")[4:9:4] == [
        "- {pytype}`homofact.api.charting.ChartResult`: Every run.",
        "- {pytype}`homofact.errors.BadInput`: For a fault.",
    ]
    loose = "Read.\n\nReturns\n-------\nThe fit, with\nits report."
    assert markdown(loose, scope, "{pytype}`a.Fit`").endswith(
        "**Returns**\n\n{pytype}`a.Fit`: The fit, with\nits report."
    )


@pytest.mark.parametrize("name", sorted({*homofact.__all__} - {"__version__"}))
def test_every_name_of_the_package_has_a_page(name: str) -> None:
    """A name without one: add its module to sitemaker.modules.MODULES."""
    assert HOMES[name] in described()


def returned_classes(path: str) -> Iterator[str]:
    """The classes of homofact in the types that a function, or the public methods of a class, return."""
    node, scope = definition_of(path), scope_of(path.rpartition(".")[0])
    assert node is not None
    functions = [node] if isinstance(node, ast.FunctionDef) else node.body
    for each in functions:
        if isinstance(each, ast.FunctionDef) and not each.name.startswith("_") and each.returns is not None:
            words = re.findall(r"[A-Z]\w+", ast.unparse(each.returns))
            yield from (scope.names[word] for word in words if class_of(scope.names.get(word, "")) is not None)


@pytest.mark.parametrize("path", sorted(HOMES.values()))
def test_every_class_that_the_package_returns_has_a_page(path: str) -> None:
    assert {*returned_classes(path)} <= described()


def test_returned_classes_are_found() -> None:
    assert "homofact.evaluation.bar.error_bar.ErrorBar" in {*returned_classes(HOMES["Fit"])}
    assert {*returned_classes(HOMES["relight"])} == {
        "homofact.relighting.result.RelightResult",
        "homofact.relighting.relit_mesh.RelitMesh",
    }


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    block = "# T\n\n```python\nimport homofact\nhomofact.fit(x, homofact.McCool(size=8))\n```\n"
    written = {name: (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in written_pages()}
    return reference_pages({"tutorials/t": block, "a": block.replace("# T", "# A"), "b": "# B"} | written)


@pytest.mark.slow
def test_the_reference_has_what_is_public_and_who_uses_it(pages: dict[str, str]) -> None:
    for module in reference_modules():
        assert f"](/{module.page}.md)" in pages["api/index"]
        assert (ROOT / module.path).is_file()
    mccool = pages["api/homofact.methods.mccool"]
    assert "[T](/tutorials/t.md)" in mccool
    assert "[A](/a.md)" in mccool
    assert "[T]" not in pages["api/homofact.methods.svd"]
    assert "{py:method} fit(samples:" in pages["api/homofact.methods.method"]
    assert "{py:function} read(source: Any, *, channels: str='rgb'" in pages["api/homofact.api.reading"]
    for name, home in HOMES.items():
        assert f"{{py:obj}}`homofact.{name} <{home}>`" in pages["api/homofact"]
    assert "{py:obj}`homofact.runtime.load <homofact.api.loading.load>`" in pages["api/homofact.runtime"]
    assert "{pytype}`homofact.evaluation.bar.error_bar.ErrorBar`: The error bar." in pages["api/homofact.api.result"]


@pytest.mark.slow
def test_every_function_is_described_once(pages: dict[str, str]) -> None:
    """Two descriptions of one name are a warning of the site's builder, which ends the build."""
    for page, text in pages.items():
        names = re.findall(r"^:+\{py:(?:function|class)\} (\w+)", text, re.MULTILINE)
        assert len(names) == len(set(names)), page


@pytest.mark.slow
def test_no_page_shows_what_only_a_programmer_of_homofact_knows(pages: dict[str, str]) -> None:
    """No object's place in memory, no constant's name for a default, no private class for a type."""
    for page, text in pages.items():
        assert " object at 0x" not in text, page
        assert "``" not in re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE), page
        signatures = "\n".join(re.findall(r"^:+\{py:.*|^:type:.*|^ *- .*", text, re.MULTILINE))
        assert re.findall(r"(?<![\w`'])_[A-Za-z]\w+(?=[\]|,`])", signatures) == [], page
        defaults = re.findall(r"(?:Default: `|[\w\]']=)([\w.]+)", signatures)
        assert [each for each in defaults if CONSTANT.fullmatch(each.rpartition(".")[2])] == [], page
