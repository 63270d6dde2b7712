"""Write docs/scripts.md, the index of scripts/: `python docs/make_scripts_page.py`."""

from sitemaker.navigation import DOCS
from sitemaker.scripts_page import NAME, scripts_page

if __name__ == "__main__":
    (DOCS / f"{NAME}.md").write_text(scripts_page(), encoding="utf-8")
