"""Build the documentation site: `make docs`, or `python docs/make_site.py [--out build/site]`.

The sources are put together in OUT.source, Sphinx makes pages of them with every warning an error, and every link of
the pages, to other pages, to places in them and to pictures, is followed. No network is asked for anything. Fits that
`make gallery` left in build/gallery are shown with their viewers.
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


def main() -> int:
    """Build the site and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "site", help="folder of the site (build/site)")
    out: Path = parser.parse_args().out.resolve()
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
    pages, links, broken = broken_links(out)
    for line in broken:
        print(line, file=sys.stderr)
    print(f"{out}: {pages} pages, {links} links, {len(broken)} broken, {time.perf_counter() - begun:.0f} s")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
