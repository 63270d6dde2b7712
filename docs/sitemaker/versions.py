"""The versions of the site that lie side by side, each in a folder of its name, and the list that pages choose from."""

import json
import re
from pathlib import Path

FILE = "versions.json"


def write_versions(folder: Path) -> list[str]:
    """Write versions.json with every folder that holds a site, the newest first, and names that are no version last."""
    names = [each.parent.name for each in folder.glob("*/objects.inv")]
    names.sort(key=_order, reverse=True)
    (folder / FILE).write_text(json.dumps(names) + "\n", encoding="utf-8")
    return names


def _order(name: str) -> tuple[bool, list[int], str]:
    numbers = re.fullmatch(r"v?(\d+(?:\.\d+)*)", name)
    return numbers is not None, [int(part) for part in numbers[1].split(".")] if numbers else [], name
