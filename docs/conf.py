"""The documentation's site: ``python -m sphinx -W --keep-going -c docs . OUT``, from the top of the repository.

OUT/index.html opens from disk. The pages are those of ``docs/``, with the committed reports that they lead to.
"""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE)]
for name, folder in (("PYTHONPATH", HERE.parent), ("JUPYTER_PATH", HERE / "website/jupyter")):
    # of the notebooks' kernel
    os.environ[name] = os.pathsep.join([str(folder), *filter(None, [os.environ.get(name)])])

logging.getLogger("traitlets").setLevel(logging.WARNING)  # it tells of each notebook

import henon_ref  # noqa: E402 - found by the path above

project = "henon_ref"
author = "The henon_ref authors"
copyright = "2026, the henon_ref authors"
version = release = henon_ref.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "website.extension"]
myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_merge_streams = True
suppress_warnings = ["myst.header"]  # sections of reports may skip a level
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say types, with shapes and units
napoleon_google_docstring = False
napoleon_use_rtype = False
root_doc = "docs/index"
include_patterns = ["docs/**.md", "reports/**.md", "cases/README.md"]
exclude_patterns = ["**/.*", "docs/website"]

html_theme = "furo"
html_title = "henon_ref"
html_math_renderer = "mathml"
html_static_path = ["website/static"]
html_css_files = ["site.css"]
html_extra_path = ["website/top", "../cases/case.schema.json"]  # beside docs/
html_copy_source = False
html_search_scorer = str(HERE / "website/search_page.js")
