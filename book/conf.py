"""Sphinx configuration. The source folder is put together by ``book/build.py``."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # the extensions that are the book's own

project = "Meshes as Measures"
author = "The Meshes as Measures authors"
copyright = "2026, the authors. Text CC BY 4.0, code MIT"
language = "en"

extensions = [
    "api_extension",
    "commands_extension",
    "gallery_extension",
    "links_extension",
    "myst_nb",
    "numbers_extension",
    "quiz_extension",
    "reader_extension",
    "shown_extension",
    "symbols_extension",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_proof",
    "sphinx_togglebutton",
    "sphinxcontrib.bibtex",
]

nb_execution_mode = "off"
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "smartquotes"]
myst_heading_anchors = 3
nb_custom_formats = {".ipynb": "reader_extension.read_chapter"}
nb_code_prompt_show = "Show code"
nb_code_prompt_hide = "Hide code"
nb_merge_streams = True

# Chapters are numbered as their files are (numbers_extension); what stands in one counts within it: Figure 20.3.
numfig = True
numfig_format = {"figure": "Figure %s", "table": "Table %s", "section": "Section %s"}
numfig_secnum_depth = 1
html_domain_indices = False

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "alpha"

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
toc_object_entries_show_parents = "hide"
python_maximum_signature_line_length = 88
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_param = False
napoleon_use_ivar = True

# One JavaScript file and its fonts, copied from a Python package by book/build.py: nothing comes from a network.
mathjax_path = "mathjax/tex-chtml.js"
mathjax3_config = {
    "options": {"enableMenu": False},
    "tex": {"macros": {"SW": r"\mathrm{SW}", "W": r"\mathrm{W}", "CD": r"\mathrm{CD}", "R": r"\mathbb{R}"}},
}

html_theme = "sphinx_book_theme"
html_title = "Meshes as Measures"
html_static_path = ["_static"]
html_css_files = ["book.css", "tables.css"]
html_js_files = ["table_layouts.js", "tables.js"]
html_secnumber_suffix = "\u2002"
# Summaries would be fetched from the pages, which a browser forbids on file://.
html_show_search_summary = False
html_copy_source = True
html_sourcelink_suffix = ""
html_theme_options = {
    "use_download_button": True,
    "use_fullscreen_button": False,
    "use_repository_button": False,
    "navbar_persistent": [],
    "show_toc_level": 2,
    "toc_title": "On this page",
}
# The address of the repository, the one setting that links to it, and to Binder and Colab, depend on. Without it the
# pages have no such links.
REPOSITORY = os.environ.get("MESHOT_REPOSITORY", "")
if REPOSITORY:
    html_theme_options |= {
        "repository_url": REPOSITORY,
        "repository_branch": "main",
        "repository_provider": "gitlab" if "gitlab" in REPOSITORY else "github",
        "path_to_docs": "notebooks",
        "use_repository_button": True,
        "launch_buttons": {"binderhub_url": "https://mybinder.org", "colab_url": "https://colab.research.google.com"},
    }
# The address at which the rendered book is published, without a slash at its end. Notebooks link to it where it is set.
PUBLISHED = os.environ.get("MESHOT_PUBLISHED", "").rstrip("/")
html_context = {"default_mode": "auto"}
suppress_warnings = ["myst.domains"]
