"""The pages of the gallery's fits: of what `scripts/pictures/site_gallery.py` left in build/gallery, none without."""

import html
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homofact.evaluation.wording import trust_in_words
from sitemaker.navigation import ROOT

FITS = ROOT / "build" / "gallery"
INDEX = "gallery_fits/index"
VIEWER = "view.html"


@dataclass(frozen=True)
class Fit:
    """One fit: its folder, and what `gallery.json` there says of it."""

    folder: Path
    record: dict[str, Any]

    @property
    def page(self) -> str:
        """The page's name."""
        return f"gallery_fits/{self.folder.name}"

    @property
    def pictures(self) -> list[Path]:
        """What the page shows, by name: comparison, sphere, textures."""
        return sorted(path for path in self.folder.glob("*.png"))


def fits(folder: Path = FITS) -> list[Fit]:
    """The fits that are there, in the order of the script."""
    found = [
        Fit(path.parent, json.loads(path.read_text(encoding="utf-8"))) for path in sorted(folder.glob("*/gallery.json"))
    ]
    return sorted(found, key=lambda fit: fit.record["order"])


def gallery_pages(found: list[Fit]) -> dict[str, str]:
    """A page a fit and their index; none of no fits."""
    return {INDEX: _index(found), **{fit.page: _page(fit) for fit in found}} if found else {}


def viewers(found: list[Fit]) -> Iterator[tuple[Path, str]]:
    """Each fit's viewer, and where it stands in the site."""
    for fit in found:
        yield fit.folder / VIEWER, f"{fit.page}/{VIEWER}"


def _index(found: list[Fit]) -> str:
    lines = [
        "# Fits to turn and light",
        "",
        "The default fit of three 32² textures of each material, made by `python scripts/pictures/site_gallery.py`.",
        "Every page has the verdict, the textures and a viewer, one HTML file that works without a network.",
        "",
    ]
    for group in dict.fromkeys(fit.record["group"] for fit in found):
        lines += [f"## {group}", "", "::::{grid} 2 2 3 3", ":gutter: 3", ""]
        for fit in found:
            if fit.record["group"] == group:
                name = fit.folder.name
                lines += [f":::{{grid-item-card}} {name}", f":img-top: {name}/sphere.png", f":link: {name}",
                          ":link-type: doc", f":img-alt: {name} under a sky", ""]  # fmt: skip
                lines += [_verdict(fit.record["report"]), ":::", ""]
        lines += ["::::", ""]
    return "\n".join(lines)


def _verdict(report: dict[str, Any]) -> str:
    return trust_in_words(report["verdict"]["trusted"], report["verdict"]["summary"])


def _page(fit: Fit) -> str:
    name, report = fit.folder.name, fit.record["report"]
    verdict, held = report["verdict"], report["error"]["held_out"]
    lines = [
        f"# {name}",
        "",
        f"{fit.record['what'][:1].upper()}{fit.record['what'][1:]}.",
        "",
        f"![{name} under a sky]({name}/sphere.png)",
        "",
        f'<p><a class="viewer" href="{html.escape(name)}/{VIEWER}">Open the viewer: turn it, light it</a></p>',
        "",
        "## Verdict",
        "",
        f"{_verdict(report)[:1].upper()}{_verdict(report)[1:]}.",
        "",
        *(f"- `{each['name']}`: {each['found']}: {each['remedy']}" for each in verdict["findings"]),
        "",
        "| | |",
        "| --- | ---: |",
        f"| textures | {report['textures']}, {report['bytes']:,} bytes, {report['fetches']} fetches |",
        f"| Cole error, held out | {held['log_mse']:.3g} (ε = {report['epsilon']:g}) |",
    ]
    seen = report.get("appearance")
    if seen is not None:
        lines.append(f"| sphere under a sky | {seen['psnr_sky']:.1f} dB |")
    lines += [
        "",
        "## Textures",
        "",
        "Logarithms of the factors, for the eye; texels that no measurement reaches are hatched.",
        "",
    ]
    textures = [each for each in fit.pictures if each.stem.startswith("texture")]
    lines += [
        " ".join(f'![{each.stem}]({name}/{each.name}){{width="31%"}}' for each in textures),
        "",
        "## Beside the source",
        "",
        f"![{name}: source, fit, McCool's projections]({name}/compare.png)",
        "",
        "## Make it",
        "",
        "```",
        f"homofact factorize {fit.record['made']['source']} --textures 3 --size 32 \\",
        f"    --effort {fit.record['made']['effort']} --out {name}",
        f"homofact view {name}",
        f"homofact export {name} --out {name}-engine",
        "```",
        "",
    ]
    return "\n".join(lines)
