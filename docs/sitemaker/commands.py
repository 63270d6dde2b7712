"""The pages of the commands, from the declarations that `--help` is printed from.

Everyday options stand first, under the headings of the help; what only `--help-all` shows stands under a fold.
"""

import re
from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import Any

from typer.main import get_command

from sitemaker.sources import links_to

# Where an option names no word of its own for its value.
_VALUE = {"int": "N", "float": "NUMBER", "str": "TEXT", "Path": "PATH", "bool": ""}


def command_pages(pages: Mapping[str, str]) -> dict[str, str]:
    """A page for each command, and their index; `pages` by name are searched for examples of each."""
    from homofact.cli.main import app

    group: Any = get_command(app)
    commands = _with_inner(group.commands)
    found = {f"commands/{_slug(name)}": _page(name, command, pages) for name, command in commands.items()}
    return found | {"commands/index": _index(commands)}


def _with_inner(commands: Mapping[str, Any]) -> dict[str, Any]:
    """The commands by name, with those of a group instead of the group: "research terms"."""
    found: dict[str, Any] = {}
    for name, command in commands.items():
        inner = getattr(command, "commands", None)
        found |= {name: command} if inner is None else {f"{name} {each}": inner[each] for each in inner}
    return found


def _slug(name: str) -> str:
    return name.replace(" ", "-")


def runs_of(text: str) -> set[str]:
    """The commands of homofact that a page runs, in its blocks and in code within its lines."""
    return set(re.findall(r"(?:^\s*|`|\$ )(?:\.venv/bin/)?homofact ((?:research )?[a-z]+)\b", text, re.MULTILINE))


def _index(commands: Mapping[str, Any]) -> str:
    lines = [
        "# Commands",
        "",
        "Each page describes a command in the words of `homofact COMMAND --help`. The options that most runs need come",
        "first. The options for research, which `--help-all` prints, are under a fold. A command with `--config` also",
        "reads its options from a TOML file. `--json` prints one JSON object to stdout. A command exits with code 0 if",
        "it succeeds, with 2 and one line on stderr for bad input or usage, and with 130 after Ctrl-C.",
        "",
    ]  # fmt: skip
    for panel, group in groupby(commands.items(), lambda item: item[1].rich_help_panel):
        lines += [f"## {panel}", "", "| command | what it does |", "| --- | --- |"]
        lines += [f"| [`homofact {name}`](/commands/{_slug(name)}.md) | {_first(command)} |" for name, command in group]
        lines.append("")
    return "\n".join(lines)


def _first(command: Any) -> str:
    return str(command.help).split("\n\n")[0].replace("\n", " ").replace("|", "\\|")


def _page(name: str, command: Any, pages: Mapping[str, str]) -> str:
    arguments = [each for each in command.params if not each.opts[0].startswith("-")]
    options = [each for each in command.params if each.opts[0].startswith("-")]
    usage = " ".join([f"homofact {name}", "[OPTIONS]", *(_usage(each) for each in arguments)])
    lines = [f"# homofact {name}", "", escaped(command.help), "", "```text", usage, "```", ""]
    lines += [f"```{{program}} homofact {name}\n```", ""]
    if arguments:
        lines += ["## Arguments", ""]
        lines += [f"`{each.metavar or each.name.upper()}`\n: {escaped(each.help)}\n" for each in arguments]
    everyday = [each for each in options if not each.hidden]
    research = [each for each in options if each.hidden]
    lines += ["## Options", "", *_under_panels(everyday, "###")]
    if research:
        lines += [
            f"::::::{{dropdown}} Options of research ({len(research)})",
            "",
            *_under_panels(research, ""),
            "::::::",
            "",
        ]
    naming = [page for page, text in sorted(pages.items()) if name in runs_of(text) and page != "changes"]
    if naming:
        lines += ["## Where it is used", "", f"{links_to(naming, pages)}.", ""]
    return "\n".join(lines)


def _under_panels(options: Iterable[Any], level: str) -> Iterable[str]:
    """The options by the headings of the help; last those without one, which most commands have alike."""
    by_panel: dict[str, list[Any]] = {}
    for each in options:
        by_panel.setdefault(each.rich_help_panel or "", []).append(each)
    for panel in sorted(by_panel, key=lambda panel: panel == ""):
        heading = panel or ("In general" if len(by_panel) > 1 else "")
        if heading:
            yield f"{level} {heading}\n" if level else f"**{heading}**\n"
        yield from (_option(each) for each in by_panel[panel])


def _option(each: Any) -> str:
    value = "" if each.is_flag else (each.metavar or _VALUE.get(_kind(each), "VALUE"))
    words = [*sorted(each.opts, key=len, reverse=True), *each.secondary_opts]
    told = ", ".join(f"{word} {value}".rstrip() for word in words)
    default = _default(each)
    return f":::{{option}} {told}\n\n{escaped(each.help)}{default}\n:::\n"


def _default(each: Any) -> str:
    """A default that the help's own words do not say."""
    if not each.show_default or each.is_flag or each.default in (None, "", ()):
        return ""
    return f" Default: {each.default}."


def _kind(each: Any) -> str:
    kind = each.type_descriptor.annotation
    return str(getattr(kind, "__name__", ""))


def _usage(each: Any) -> str:
    word = each.metavar or each.name.upper()
    return word if each.required else f"[{word}]"


def escaped(text: str) -> str:
    """Help as Markdown: signs of emphasis and of tags as they stand."""
    return re.sub(r"([*<_])", r"\\\1", text)
