"""Settings of the documentation: ``sphinx-build -W --keep-going docs docs/_build/html``.

The built site needs no network: equations are MathML, styles, scripts and search are files of the
site, and fonts are those of the reader's computer.
"""

import gc
import sys
from pathlib import Path

from klack import __version__

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

# a page is many small objects that stay: looking for garbage among them takes a quarter of the time
gc.set_threshold(100_000)

project = "klack"
author = "The klack founders"
project_copyright = "the klack founders, BSD-3-Clause"
version = release = __version__

extensions = [
    "myst_nb",  # pages and notebooks
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    # of this folder
    "mathml",
    "repository_links",
    "shelves",
    "rooms",
    "docstrings",
    "lexers",
]
exclude_patterns = ["_build", "extensions", "**/__pycache__", "**/klack-results"]

# pages
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 3  # links such as case.md#measurement
myst_dmath_double_inline = True  # $$...$$ in the middle of a paragraph
nb_execution_mode = "off"  # notebooks carry their outputs: docs/run_notebooks.py
nb_mime_priority_overrides = [("html", "text/html", 0), ("html", "image/png", 1)]

# docstrings
napoleon_google_docstring = False
napoleon_use_param = False  # one list: name, shape and unit, meaning
napoleon_use_rtype = False
autodoc_default_options = {"exclude-members": "model_config, model_post_init"}  # of pydantic
autodoc_typehints = "signature"  # shapes and units stand in the text
suppress_warnings = ["ref.python"]  # `type` and `set` of annotations are names in klack, too
toc_object_entries = False  # thousands of names in every sidebar are no map
maximum_signature_line_length = 88
autosummary_generate = False  # tables only
add_module_names = False
python_use_unqualified_type_names = True

# site
html_theme = "furo"
html_title = f"klack {version}"
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["klack.css"]
html_search_scorer = str(Path(__file__).parent / "static" / "search_scorer.js")
html_copy_source = False
html_show_sourcelink = False
pygments_style = "friendly"
pygments_dark_style = "monokai"
