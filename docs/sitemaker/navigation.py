"""The order of the site: every page of docs/ stands in one section, and a test says so.

`{...}` are pages that are written when the site is built.
"""

from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent


@dataclass(frozen=True)
class Section:
    """A heading of the sidebar and its pages, by name without `.md`; pages under the first one where it is `nested`."""

    title: str
    pages: tuple[str, ...]
    nested: bool = False


SECTIONS = (
    Section("Start", ("start", "which_command", "whats_new")),
    Section(
        "Learn",
        (
            "tutorials/index", "tutorials/paint", "tutorials/own_data", "tutorials/trust", "tutorials/plan",
            "tutorials/relight", "tutorials/edit", "tutorials/sweep", "tutorials/inverse_rendering",
        ),
        nested=True,
    ),
    Section(
        "Concepts",
        (
            "concepts/index", "concepts/log_transform", "concepts/projections", "concepts/inner_problem",
            "concepts/gauge", "concepts/reciprocity", "concepts/validation", "concepts/energy", "concepts/decisions",
        ),
        nested=True,
    ),
    Section(
        "Guides",
        (
            "python", "gpu", "measuring", "formats", "lighting", "results", "verdict", "artefacts", "suspicion",
            "robustness", "export", "interchange", "mitsuba", "spectral", "sampling", "planning", "relighting",
            "editing", "sweep", "report", "papers",
        ),
    ),
    Section("Gallery", ("gallery", "editing_gallery")),
    Section(
        "Evidence",
        (
            "known_mixes", "light", "people", "straightening", "measured", "thesis", "trials", "compression", "real",
            "relighting_figures", "stability", "scripts",
        ),
    ),
    Section(
        "Contribute",
        (
            "contributing/setting", "contributing/reader", "contributing/metric", "contributing/method",
            "contributing/shader-language", "contributing/plain_english",
        ),
    ),
    Section("Reference", ("glossary", "commands/index", "api/index", "references", "changes")),
)  # fmt: skip


def written_pages() -> list[str]:
    """Every page of docs/ as its name in the navigation, but for the landing page."""
    found = (path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md"))
    return sorted(name for name in found if name != "index")


def toctrees(extra: dict[str, list[str]]) -> dict[str, str]:
    """The tables of contents by the page that they are put at the end of.

    `extra` are further pages under a page: the commands under commands/index, say.
    """
    root = []
    found: dict[str, str] = {}
    for section in SECTIONS:
        shown = section.pages[:1] if section.nested else section.pages
        root.append(_toctree(section.title, shown))
        if section.nested:
            found[section.pages[0]] = _toctree("", section.pages[1:])
    found["index"] = "\n".join(root)
    return found | {page: _toctree("", tuple(under)) for page, under in extra.items()}


def _toctree(caption: str, pages: tuple[str, ...]) -> str:
    lines = ["```{toctree}", ":hidden:", *([f":caption: {caption}"] if caption else []), ""]
    return "\n".join([*lines, *(f"/{page}" for page in pages), "```", ""])
