"""Sphinx's configuration of the site: `sphinx-build -W -n docs build/site`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from pytest_drive_robust import __version__

project = "pytest-drive-robust"
author = "the authors of pytest-drive-robust"
copyright = author
version = release = __version__

extensions = ["myst_parser", "sphinx_design", "sphinx.ext.autodoc", "generated", "pages_for_models"]
exclude_patterns = ["_ext", "extra", "pictures"]
nitpicky = True
smartquotes = False  # --drive-agent has two hyphens
default_role = "code"  # docstrings write `name`, and mean the name as it is typed

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
myst_links_external_new_tab = False

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
nitpick_ignore_regex = [
    # types that signatures name: those of others, which cannot be looked up offline, and what users never hold
    ("py:.*", r"(?!pytest_drive_robust\b).*"),
    ("py:.*", r"pytest_drive_robust\.(?!testing\.|errors\.|results\.)\w+\.\w+.*"),
]
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"

html_theme = "furo"
html_title = "pytest-drive-robust"
html_static_path = ["_static"]
html_extra_path = ["extra"]  # the sample report, as it is
html_css_files = ["site.css"]
html_show_sourcelink = True  # the text of a page, which llms.txt links to
about = (
    "pytest for end-to-end driving policies: drives an agent in closed loop under deployment failures and turns every "
    "broken robustness requirement into a failing test."
)
