"""What stands beside the package says what the package is: citation, continuous integration, hooks, pages."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from homofact.version import __version__

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
ROOT = Path(__file__).resolve().parents[2]


def read(name: str) -> Any:
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def test_the_citation_is_of_this_version_and_whole() -> None:
    found = read("CITATION.cff")
    # Required by the Citation File Format 1.2.0, of the file and of every reference.
    assert {"cff-version", "message", "title", "authors"} <= found.keys()
    assert (found["cff-version"], found["version"], found["type"]) == ("1.2.0", __version__, "software")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert found["license"] == project["license"]
    for each in (found, *found["references"]):
        assert each["title"]
        for author in each["authors"]:
            assert author.keys() <= {"name", "family-names", "given-names"}
            assert ("name" in author) != ("family-names" in author)
    for reference in found["references"]:
        assert reference["type"] in {"thesis", "conference-paper"}
        bibliography = (ROOT / "docs" / "references.bib").read_text(encoding="utf-8")
        assert re.sub(r"\W+", " ", reference["title"]).lower() in re.sub(r"[{}\W]+", " ", bibliography).lower()


def test_continuous_integration_runs_targets_that_exist_on_every_python() -> None:
    workflow = read(".github/workflows/ci.yml")
    jobs = workflow["jobs"]
    assert jobs["test"]["strategy"]["matrix"]["python"] == ["3.11", "3.12", "3.13"]
    asked = {
        target
        for job in jobs.values()
        for step in job["steps"]
        if step.get("run", "").startswith("make ")
        for target in step["run"].removeprefix("make ").split()
    }
    assert asked == {"test", "wheel", "gallery", "docs", "nightly"}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^(\w+):", makefile, re.MULTILINE))
    # The site is a page maker's: its target comes with it.
    assert asked - {"docs"} <= targets


def test_hooks_run_the_projects_own_tools_without_a_network() -> None:
    (repository,) = read(".pre-commit-config.yaml")["repos"]
    assert repository["repo"] == "local"
    assert {hook["id"] for hook in repository["hooks"]} == {"ruff-check", "ruff-format", "pyright"}
    assert all(hook["language"] == "system" and ".venv/bin/" in hook["entry"] for hook in repository["hooks"])


PAGES = (
    "CONTRIBUTING.md",
    *(f"docs/contributing/{name}.md" for name in ("reader", "metric", "method", "shader-language")),
)


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_for_contributors_names_is_there(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([\w./-]+)\)", text):
        assert ((ROOT / page).parent / link).exists(), link
    named = re.findall(r"`((?:[\w-]+/)+[\w.-]*|[\w-]+\.(?:py|md|toml))`", text)
    assert named
    for name in named:
        if "NAME" in name or "FORMAT" in name:
            continue
        places = (ROOT, ROOT / "homofact", ROOT / "homofact" / "brdf", ROOT / "homofact" / "methods")
        assert any((place / name).exists() for place in places), name
    calls = re.findall(r"`([A-Z_]{4,})`", text)
    sources = "\n".join(each.read_text(encoding="utf-8") for each in (ROOT / "homofact").rglob("*.py"))
    tests = "\n".join(each.read_text(encoding="utf-8") for each in (ROOT / "tests").rglob("*.py"))
    for name in calls:
        assert re.search(rf"^{name}\b", sources + tests, re.MULTILINE), name
