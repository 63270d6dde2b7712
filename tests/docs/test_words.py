"""README, CONTRIBUTING, docs/ and the strings of the package, checked by the rules of docs/words.toml."""

import re
from pathlib import Path

import pytest

from sitemaker.prose import CODE, DOCSTRING_CODE, RULES, broken, strings

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = sorted((ROOT / "homofact").rglob("*.py"))


def found(text: str, code: re.Pattern[str] = CODE) -> list[str]:
    """Return the phrases that break a rule, as "line 3: 'bytes a material': per …"."""
    return [f"line {line}: {phrase!r}: {RULES[rule]['instead']}" for rule, line, phrase in broken(text, code)]


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


def wrong_texts(source: str) -> dict[int, list[str]]:
    """Return the phrases in the strings of a Python source that break a rule, by the first line of the string."""
    wrong = {line: found(text, DOCSTRING_CODE) for line, text in strings(source)}
    return {line: each for line, each in wrong.items() if each}


def test_all_of_a_docstring_is_read_except_its_code() -> None:
    code = '"""\n\n    Numbers:\n\n        3 bytes a texture\n\n    {}\n    """'
    assert wrong_texts(f"def f():\n    {code.format('')}\n    return {{'mended': 1}}\n") == {}
    assert list(wrong_texts(f"def f():\n    {code.format('3 bytes a texture')}\n")) == [2]
    assert list(wrong_texts('"""One.\n\nsize : int\n    3 bytes a texture.\n"""')) == [1]
    assert wrong_texts('"""One.\n\nmended : int\n    A number.\n"""') == {}


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: str(source.relative_to(ROOT)))
def test_messages_and_docstrings_follow_the_rules(source: Path) -> None:
    assert wrong_texts(source.read_text(encoding="utf-8")) == {}
