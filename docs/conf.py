"""Sphinx's settings for the site; `make docs` builds it (docs/make_site.py)."""

from pathlib import Path

from homofact.version import __version__

project = "homofact"
author = "the homofact developers"
copyright = "Apache-2.0"
version = release = __version__
root_doc = "index"
extensions = ["myst_parser", "sphinx_design", "sphinxcontrib.bibtex", "sphinx_copybutton", "sitemaker.extension"]
exclude_patterns: list[str] = []
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 90

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence", "attrs_block", "attrs_inline"]
myst_heading_anchors = 4
myst_update_mathjax = False
suppress_warnings: list[str] = []
highlight_language = "none"
smartquotes = False  # "--size" is to stay an option
html_math_renderer = "mathml"

bibtex_bibfiles = ["references.bib"]
bibtex_cite_id = "{key}"
bibtex_reference_style = "author_year"

html_theme = "furo"
html_title = "homofact"
html_static_path = [str(Path(__file__).resolve().parent / "static")]
html_css_files = ["site.css"]
html_js_files = ["versions.js"]
html_copy_source = False
html_show_sphinx = False
html_show_sourcelink = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0b5cad", "color-brand-content": "#0b5cad",
        "font-stack": "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif",
    },
    "dark_css_variables": {"color-brand-primary": "#7fb8f0", "color-brand-content": "#7fb8f0"},
    "sidebar_hide_name": False,
}  # fmt: skip
copybutton_prompt_text = "$ "
