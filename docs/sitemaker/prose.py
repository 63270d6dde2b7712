"""The rules of docs/words.toml: which phrases of a page, or of the strings of a Python source, break one."""

import ast
import inspect
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

RULES: Sequence[Mapping[str, str]] = tomllib.loads(
    (Path(__file__).resolve().parents[1] / "words.toml").read_text(encoding="utf-8")
)["rule"]
# The rules do not apply to code and quoted output.
CODE = re.compile(r"```.*?```|`[^`\n]*`|<!--.*?-->|(?m:^    [^\n]*$)", re.DOTALL)
# In a docstring only an indented block after a blank line is code: the description of a parameter is indented too.
DOCSTRING_CODE = re.compile(
    r"```.*?```|`[^`\n]*`|(?:\A|\n\n)(?: {4}[^\n]*(?:\n\n?|\Z))+|(?m:^ *\w+(?:, \w+)* : )", re.DOTALL
)


def broken(text: str, code: re.Pattern[str] = CODE) -> Iterator[tuple[int, int, str]]:
    """Yield (number of the rule, line, phrase) for each phrase that breaks a rule outside code."""
    bare = code.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    for number, rule in enumerate(RULES):
        for match in re.finditer(rule["pattern"], bare):
            yield number, bare.count("\n", 0, match.start()) + 1, match[0]


def strings(source: str) -> Iterator[tuple[int, str]]:
    """Yield (line, text) for each string of a Python source with a space in it; one without is a name, not a text."""
    for each in ast.walk(ast.parse(source)):
        if isinstance(each, ast.Constant) and isinstance(each.value, str):
            text = inspect.cleandoc(each.value)
            if re.search(r"\s", text):
                yield each.lineno, text
