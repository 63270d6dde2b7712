"""README, CONTRIBUTING, docs/ and what the commands print, checked by the rules of docs/words.toml."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RULES = tomllib.loads((ROOT / "docs/words.toml").read_text(encoding="utf-8"))["rule"]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
# What users read on a terminal and in the reference of the commands and the library's front.
SOURCES = sorted(each for part in ("api", "cli", "settings") for each in (ROOT / "homofact" / part).rglob("*.py"))
# Code, and quoted output, have words of their own.
CODE = re.compile(r"```.*?```|`[^`\n]*`|<!--.*?-->|(?m:^    [^\n]*$)", re.DOTALL)


def found(text: str) -> list[str]:
    """What breaks a rule, as "line 3: 'bytes a material': per …"."""
    bare = CODE.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    return [
        f"line {bare.count(chr(10), 0, match.start()) + 1}: {match[0]!r}: {rule['instead']}"
        for rule in RULES
        for match in re.finditer(rule["pattern"], bare)
    ]


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule["instead"][:24])
def test_every_rule_finds_what_it_is_for(rule: dict[str, str]) -> None:
    assert re.search(rule["pattern"], rule["bad"])
    assert not re.search(rule["pattern"], rule["good"])


def test_code_is_left_alone() -> None:
    assert found("12 bytes a\nmaterial, `3 bytes a material`\n\n```\n3 bytes a texture\n```\n") == []
    # Behind code the rules hold again.
    assert found("    3 bytes a texture\n\n3 bytes a texture\n") != []
    assert found("One.\n\nIt takes 3 bytes a texture.") == [f"line 3: 'bytes a texture': {RULES[0]['instead']}"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_follow_the_rules(page: Path) -> None:
    assert found(page.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("page", sorted((ROOT / "docs/tutorials").glob("*.md")), ids=lambda page: page.stem)
def test_only_commands_of_a_tutorial_begin_like_one(page: Path) -> None:
    """A reader who copies lines that begin with "homofact WORD" copies commands."""
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"(?m)^homofact [a-z].*$", re.sub(r"(?s)```.*?```", "", text)) == []


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: str(source.relative_to(ROOT)))
def test_messages_and_docstrings_follow_the_rules(source: Path) -> None:
    tree = ast.parse(source.read_text(encoding="utf-8"))
    texts = [(each.lineno, each.value) for each in ast.walk(tree) if isinstance(each, ast.Constant)]
    wrong = {line: found(text) for line, text in texts if isinstance(text, str)}
    assert {line: each for line, each in wrong.items() if each} == {}
