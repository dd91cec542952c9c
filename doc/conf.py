"""The book: what `make docs` tells Sphinx. Why these tools: decisions/0017-the-book.md."""

import sys
from importlib import metadata
from pathlib import Path

import numba
import plotly

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "extensions"))
# Compiled functions hide their signature and source; here they are read, never run.
numba.config.DISABLE_JIT = True

project = "sdimu-calibration"
author = "the sdimu-calibration maintainers"
copyright = "the sdimu-calibration maintainers, licence Apache-2.0"  # noqa: A001 (the name is Sphinx's)
release = metadata.version("sdimu-calibration")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinxcontrib.bibtex",
    "mathml",
    "generated_pages",
]
exclude_patterns = ["_build", "extensions"]
nitpicky = True
# Types in docstrings are prose ("ndarray, shape (3,)"), not references; a function that is named must be there.
nitpick_ignore_regex = [("py:(?!func|mod).*", r".*")]


myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "smartquotes"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

numfig = True
numfig_secnum_depth = 1
math_eqref_format = "({number})"

bibtex_bibfiles = ["bibliography.bib"]
bibtex_default_style = "plain"
bibtex_reference_style = "author_year"

autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

html_theme = "furo"
html_title = "sdimu-calibration"
html_math_renderer = "mathml"
# The figures of the notebooks need it: no network when the book is read.
html_static_path = ["style", str(Path(plotly.__file__).parent / "package_data" / "plotly.min.js")]
html_css_files = ["book.css"]
html_show_sphinx = False
html_copy_source = False
