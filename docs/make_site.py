"""Build the documentation site: `make docs`, or `python docs/make_site.py [--out build/site] [--single]`.

The sources are put together in OUT.source, Sphinx makes pages of them with every warning an error, and every link of
the pages, to other pages, to places in them and to pictures, is followed. No network is asked for anything. Fits that
`make gallery` left in build/gallery are shown with their viewers.

With --single the guides, tutorials and evidence also become one page for print, OUT.single/index.html, without the
reference of Python and the sources. Sites of several versions in one folder (--out sites/0.2.0) get a file
versions.json with --versions, from which every page offers the others.
"""

import argparse
import os
import shutil
import sys
import time
from pathlib import Path

from sphinx.cmd.build import build_main

from sitemaker.gallery import fits, viewers
from sitemaker.links import broken_links
from sitemaker.navigation import ROOT
from sitemaker.stage import stage
from sitemaker.versions import FILE, write_versions


def main() -> int:
    """Build the site and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "site", help="folder of the site (build/site)")
    parser.add_argument("--single", action="store_true", help="also write the guides as one page for print")
    parser.add_argument("--versions", action="store_true", help="also list the versions beside OUT in versions.json")
    asked = parser.parse_args()
    out: Path = asked.out.resolve()
    begun = time.perf_counter()
    sources = out.with_name(f"{out.name}.source")
    stage(sources)
    workers = str(os.cpu_count() or 1)
    code = build_main(
        ["-b", "html", "-c", str(ROOT / "docs"), "-d", str(out.with_name(f"{out.name}.cache")),
         "-W", "--keep-going", "-q", "-j", workers, str(sources), str(out)]
    )  # fmt: skip
    if code != 0:
        return code
    for viewer, place in viewers(fits()):
        (out / place).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(viewer, out / place)
    pages, links, broken = broken_links(out, out.with_name(f"{out.name}.cache") / "links.json")
    for line in broken:
        print(line, file=sys.stderr)
    print(f"{out}: {pages} pages, {links} links, {len(broken)} broken, {time.perf_counter() - begun:.0f} s")
    if asked.single:
        page = single_page(sources, out.with_name(f"{out.name}.single"))
        print(f"{page}: {page.stat().st_size / 1e6:.1f} MB")
    if asked.versions:
        print(f"{out.parent / FILE}: {', '.join(write_versions(out.parent))}")
    return 1 if broken else 0


def single_page(sources: Path, out: Path) -> Path:
    """Build all pages but the reference of Python and the sources as one, and return its file."""
    left_out = ",".join(f"{folder}/{pattern}" for folder in ("api", "source") for pattern in ("*", "**"))
    # Links and tables of contents name pages that are left out on purpose.
    silenced = "myst.xref_missing,toc.excluded,toc.not_readable,ref.ref"
    code = build_main(
        ["-b", "singlehtml", "-c", str(ROOT / "docs"), "-d", str(out.with_name(f"{out.name}.cache")), "-q",
         "-D", f"exclude_patterns={left_out}", "-D", f"suppress_warnings={silenced}", str(sources), str(out)]
    )  # fmt: skip
    if code != 0:
        raise SystemExit(code)
    return out / "index.html"


if __name__ == "__main__":
    sys.exit(main())
