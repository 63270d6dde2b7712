"""Write the page of a scene: the parts that relighting and editing share, in the styles of viewer and scenes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from homofact.evaluation.wording import figure
from homofact.files.atomic import write_bytes
from homofact.web.assembly import assembled, part

SCRIPTS = ("data.js", "elements.js", "vectors.js", "files.js", "tones.js", "webgl.js", "divider.js")
STYLES = ("page.css", "scene.css")
# Rows of a table by section.
Numbers = Mapping[str, Mapping[str, str | int | float]]


def write_scene_page(
    target: Path,
    package: str,
    scripts: Sequence[str],
    data: Mapping[str, Any],
    numbers: Numbers,
    *,
    title: str,
    subtitle: str = "",
    shared: Sequence[str] = (),
    styles: Sequence[str] = (),
    policy: str = "",
    new: bool = False,
) -> int:
    """Write a package's page.html with its scripts and styles atomically, and return its size in bytes.

    `shared` names additional scripts of homofact.web. Raises BadInput for a path that cannot be written.
    """
    tables = [[section, [[name, _shown(value)] for name, value in rows.items()]] for section, rows in numbers.items()]
    page = assembled(
        part(package, "page.html"),
        title=title,
        subtitle=subtitle,
        styles=[*(part("homofact.web", name) for name in STYLES), *(part(package, name) for name in styles)],
        scripts=[
            *(part("homofact.web", name) for name in (*SCRIPTS, *shared)),
            *(part(package, name) for name in scripts),
        ],
        data={**data, "numbers": tables},
        policy=policy,
    ).encode()
    write_bytes(target, page, new=new)
    return len(page)


def _shown(value: str | int | float) -> str:
    return value if isinstance(value, str) else f"{value:,}" if isinstance(value, int) else figure(float(value))


def percent(share: float) -> str:
    """Return a share in percent with three significant digits."""
    return f"{figure(100 * share)}%"
