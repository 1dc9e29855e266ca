"""Settings of Sphinx. Build with: sphinx-build -W --keep-going -n -b html docs docs/_build/html"""

import sys
from pathlib import Path

import mitsuba_taxel

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "mitsuba_taxel"
author = "the authors of mitsuba_taxel"
version = release = mitsuba_taxel.__version__
language = "en"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "command_reference",
    "short_references",
    "mathml",
    "plugin_reference",
    "results_reference",
]
# Names that docstrings refer to, and that the reference does not contain.
nitpick_ignore_regex = [
    ("py:func", r"(mitsuba_taxel\.pads\.imported\.regions\.)?(tagged|prepare)"),
    ("py:data", r"mitsuba_taxel\.mechanics\.continuation\.load_segment\.\w+|TET_EDGES|FACE_EDGES|ENDS"),
    ("py:meth", r"Location\.interpolate|PointLocator\.locate"),
    ("py:class", r"LawFit|StressCurve|CurveNoise|RelaxationFit"),
    ("py:class", r"Relief|Load|RigidBodies|ndarray|(pandas\.)?DataFrame|Unseen"),
    ("py:class", r"\d+|(\d )?[A-Z]|corners|width|height|inputs|terms|taxels|forces|quantities"),  # shapes of arrays
    ("py:class", r"(mitsuba_taxel\.mechanics\.continuation\.state\.)?(Comparison|PathRate)|FirstContact|Estimate"),
]
exclude_patterns = ["_build", "_extensions"]
default_role = "code"

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
napoleon_google_docstring = False
napoleon_attr_annotations = False
napoleon_use_param = False
napoleon_use_rtype = False
toc_object_entries = False  # hundreds of names, copied for the navigation of each page: a quarter of the time

html_theme = "furo"
html_title = "mitsuba_taxel"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
pygments_style = "friendly"
pygments_dark_style = "native"
