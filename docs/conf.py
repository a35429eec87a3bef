"""How Sphinx builds the site: `make docs`. It generates the Python API from docstrings.

It also generates the tables of commands and of metrics; pages hold all other tables.
"""

import sys
import tomllib
from pathlib import Path

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS / "_ext"), str(DOCS.parent)]  # the extension, and the list of what is public

project = "swarmwire"
release = version = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
author = copyright = "the swarmwire authors"  # noqa: A001 - the name that Sphinx reads
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design", "docstrings", "built_tables"]
exclude_patterns = ["_build", "_ext"]

html_theme = "furo"
html_title = f"swarmwire {release}"
html_static_path = ["_static"]
html_favicon = "_static/favicon.svg"
html_show_sphinx = False
html_copy_source = False

copybutton_prompt_text = "$ "  # of a console block only its commands are copied, without output

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
myst_disable_syntax = ["html_inline"]  # help texts say <seed> and mean it
smartquotes = False  # --set and "none" stay as they are typed

default_role = "code"  # docstrings write `name`, as Markdown does
autodoc_class_signature = "separated"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "undoc-members": True, "exclude-members": "__init__, __new__"}
autodoc_preserve_defaults = True

nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!swarmwire\b).*"),  # other projects' names are not looked up: a build should not need the network
    ("py:class", r"swarmwire\..*\.[A-Z]"),  # type variables
]
