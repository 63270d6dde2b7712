"""Count the commands and their options, and list the options that no document, configuration or script uses.

    python scripts/checks/options_used.py

An option counts as used where a page of README, CONTRIBUTING or docs, a file in configs, a script or the Makefile has
it with its dashes, or a TOML or Python setting of its name (`textures = 2`, `textures=2`). Tests do not count. An
option of several commands is one option of each.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

from homofact.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
_HELP = {"--help", "--help-all"}


def commands() -> Iterator[tuple[str, Any]]:
    """Yield (name, command), those of a group as "research terms"; hidden ones are left out."""
    group: Any = get_command(app)
    for name, command in group.commands.items():
        inner = getattr(command, "commands", None)
        for own, each in ({name: command} if inner is None else {f"{name} {k}": v for k, v in inner.items()}).items():
            if not each.hidden:
                yield own, each


def options(command: Any) -> dict[str, str]:
    """Return the options of a command, those of `--help-all` included, --name: the setting's key."""
    found = {}
    for each in command.params:
        longest = [name for name in each.opts if name.startswith("--")]
        if longest and longest[0] not in _HELP:
            found[longest[0]] = longest[0].removeprefix("--").replace("-", "_")
    return found


def texts() -> str:
    """Return all documents, configurations and scripts in one."""
    places = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "Makefile")]
    for folder, endings in (("docs", ("md",)), ("configs", ("toml",)), ("scripts", ("py", "md"))):
        places += [path for ending in endings for path in sorted((ROOT / folder).rglob(f"*.{ending}"))]
    return "\n".join(path.read_text(encoding="utf-8") for path in places if path != Path(__file__))


def main() -> None:
    """Print a row per command, the sums, and what nothing uses."""
    everything = texts()
    used = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+[a-z]", everything))
    keys = set(re.findall(r"\b([a-z_]+) ?=(?!=)", everything))
    total, names, unused = 0, set(), {}
    for name, command in commands():
        own = options(command)
        total, names = total + len(own), names | own.keys()
        print(f"{name:20} {len(own):4} options")
        for option, key in own.items():
            if option not in used and key not in keys:
                unused.setdefault(option, []).append(name)
    count = len(dict(commands()))
    print(f"{count} commands, {total} options, {len(names)} different names; {len(unused)} that nothing uses")
    for option, where in sorted(unused.items()):
        print(f"{option}: {', '.join(where)}")


if __name__ == "__main__":
    main()
