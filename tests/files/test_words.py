"""Words from elsewhere: what is shown of them, and that nothing of it acts."""

import json

import pytest
from hostile import FORBIDDEN, NAMES

from homofact.files.words import harmless, harmless_words, in_markdown


def test_what_can_be_seen_stays_and_the_rest_shows_its_number() -> None:
    assert harmless("ε = 1e-3, 日本, 12\u202fnm, R/G") == "ε = 1e-3, 日本, 12\u202fnm, R/G"
    assert harmless("a\x1b\u202e\udcff\n") == "a\\u001b\\u202e\\udcff\\u000a"
    assert harmless("a\nb", keep="\n") == "a\nb"
    assert harmless_words({"a\0": ["\u202e", 1, None, ("b\nc",)]}) == {"a\\u0000": ["\\u202e", 1, None, ["b\nc"]]}


@pytest.mark.parametrize("name", NAMES)
def test_no_forbidden_character_is_left(name: str) -> None:
    assert not set(harmless(name)) & set(FORBIDDEN + "\n\r")
    assert not set(in_markdown(name)) & set(FORBIDDEN + "\n|<>[]*`\\")


@pytest.mark.parametrize("name", NAMES)
def test_in_a_json_text_the_escapes_are_the_characters(name: str) -> None:
    assert json.loads(harmless(json.dumps(name, ensure_ascii=False))) == name


def test_markdown_shows_what_it_was_given() -> None:
    assert in_markdown("&lt;b&gt; a_b |c|\n d") == "&amp;lt;b&amp;gt; a_b &#124;c&#124; d"
    assert in_markdown("_a_ __b__ c_") == "&#95;a&#95; &#95;&#95;b&#95;&#95; c&#95;"
