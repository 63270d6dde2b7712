"""Translate advice of the library into command-line options: `robust=True` becomes --robust."""

import ast
import re

from homofact.errors import Advice

# An `Advice` as text: "`robust=True`", "`convert(undo='cosine-o')`".
_ADVICE = re.compile(r"`(?:(\w+)\()?(\w+)=('[^']*'|[^`()]+)\)?`")
_ARGUMENTS = {"convert": "IN OUT"}
# A function of the library, perhaps with what it is given: "`homofact.edit`", "`homofact.fit('a.brdf')`".
_FUNCTION = re.compile(r"`homofact\.(\w+)(?:\(('[^`]*'|\"[^`]*\")\))?`")
_COMMANDS = {"fit": "factorize", "terms": "research terms"}


def option(advice: Advice) -> str:
    """Return the option and value for an advised setting, with the whole command if it is another command."""
    flag = advice.setting.replace("_", "-")
    if isinstance(advice.value, bool):
        words = f"--{flag}" if advice.value else f"--no-{flag}"
    else:
        words = f"--{flag} {advice.value}"
    return f"homofact {advice.of} {_ARGUMENTS.get(advice.of, '...')} {words}" if advice.of else words


def _command(function: str, given: str | None) -> str:
    words = f"homofact {_COMMANDS.get(function, function)}"
    if given is None:
        return words
    return f"{words} {ast.literal_eval(given)}" + (" --out FOLDER" if function == "fit" else "")


def with_options(text: str) -> str:
    """Replace the advice in a text of the library by options and commands."""
    text = _FUNCTION.sub(lambda match: _command(match[1], match[2]), text)
    return _ADVICE.sub(lambda match: option(Advice(match[2], ast.literal_eval(match[3]), match[1] or "")), text)
