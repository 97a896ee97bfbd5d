"""How the site is built from these pages: `make docs`."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_site"))

project = "motorctl"
extensions = [
    *("myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"),
    *("mathml", "navigation", "plain_attributes"),  # in _site/
]
exclude_patterns = ["_site", "drivers/example"]

# Markdown as the repository's pages have it, with links to headings as GitHub makes them.
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
highlight_language = "none"  # what a terminal shows, where a block names no language

# The Python API, from its docstrings.
default_role = "code"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
napoleon_google_docstring = False
napoleon_use_rtype = False

# Everything that a page shows lies beside it: no fonts, scripts or pictures from elsewhere.
html_theme = "furo"
html_title = "motorctl"
html_math_renderer = "mathml"
html_static_path = ["_site/static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
html_permalinks_icon = "#"
