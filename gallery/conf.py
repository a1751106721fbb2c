"""Configuration of the site: sphinx-build -W -b html gallery gallery/_build/html (no network needed)."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # helpers of the examples

import matplotlib.pyplot as plt

import fractalcontact

plt.style.use("fractalcontact.plotting.report")

project = "fractalcontact"
author = "The fractalcontact developers"
copyright = author
version = release = fractalcontact.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "site_parts",
]
templates_path = ["_templates"]
exclude_patterns = ["_build", "examples", "README.*"]

# sphinx-gallery copies the examples from the source folder of the site to a folder below it
suppress_warnings = ["sphinx_gallery.duplicate_filename"]

autosummary_generate = True
autosummary_ignore_module_all = False
autosummary_imported_members = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

SECTIONS = ("tutorials", "rough_surfaces", "contacts", "crack_joints", "contact_sets")

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "auto_examples",
    "filename_pattern": r"[\\/]plot_",
    "ignore_pattern": r"(conf|site_parts|__init__)\.py$",
    "within_subsection_order": "FileNameSortKey",
    "subsection_order": [*(f"examples/{name}" for name in SECTIONS), "*"],
    "nested_sections": False,
    "reset_modules": (),
    "abort_on_example_error": True,
    "only_warn_on_example_error": False,
    "download_all_examples": False,
    "show_signature": False,
    "capture_repr": (),  # what a drawing call returns says nothing to a reader
    "remove_config_comments": True,
    "min_reported_time": 1,
}

PAGES = (
    "index",
    "install",
    "first_scan",
    "coming_from",
    "tutorials",
    "scene_reference",
    "command_line",
    "measured_surfaces",
    "contributing",
    "changelog",
    "citation",
    "howto",
    "faq",
    "getting_help",
    "validation",
    "estimator_accuracy",
    "speed",
    "scene_files",
    "paper_1998",
    "data_model",
    "conventions",
    "glossary",
    "architecture",
    "theory",
    "theory_*",
)
html_theme = "pydata_sphinx_theme"
html_title = f"fractalcontact {version}"
html_show_sourcelink = False
html_sidebars = {page: [] for page in PAGES}
html_theme_options = {
    "show_prev_next": False,
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
}
