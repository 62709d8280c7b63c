"""The site: one static folder made of the notebooks, the ledgers and the docstrings (``python -m drivelib site``).

Sphinx builds it, because what the site needs comes with it and is kept by others: an API reference from docstrings that
links to itself, a search that works from ``file://`` without a server, pages that read notebooks as committed (myst-nb),
light, dark and phone layout (furo), and a build that fails on a broken link. Equations become MathML, which browsers show
by themselves, so that no script for mathematics has to be shipped.
"""

import gc
import io
import os
import re
import shutil
from pathlib import Path

from rich.console import Console

from drivelib import __version__, paths
from drivelib.pack import difference, review, runner, site_notebooks, site_pages
from drivelib.record import write_atomically

STATIC = Path(__file__).parent / "site_static"
CONFIGURATION = {
    "project": "Drive papers, replicated",
    "release": __version__,
    "extensions": ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "drivelib.pack.site_sphinx"],
    "language": "en",
    "default_role": "py:obj",
    "exclude_patterns": ["files"],
    "nb_execution_mode": "off",
    "nb_render_markdown_format": "myst",
    "nb_code_prompt_show": "Show the code",
    "nb_code_prompt_hide": "Hide the code",
    "myst_heading_anchors": 2,
    "myst_enable_extensions": ["attrs_inline", "colon_fence", "deflist", "dollarmath", "fieldlist"],
    # Pages outside Sphinx's knowledge: the difference page, and the table of claims with a filter set.
    "myst_url_schemes": {"http": None, "https": None, "page": "{{path}}", "filtered": "{{path}}#{{fragment}}"},
    "autodoc_typehints": "none",
    "autodoc_use_type_comments": False,
    "html_math_renderer": "mathml",
    "html_theme": "furo",
    "html_title": "Drive papers, replicated",
    "html_static_path": [str(STATIC)],
    "html_css_files": ["site.css"],
    "html_js_files": ["filter.js"],
    "html_copy_source": False,
    "html_domain_indices": False,  # the layers list the modules
    "html_show_copyright": False,  # LICENSE says it: code BSD-3-Clause, text and figures CC BY 4.0
    "html_show_search_summary": False,  # summaries are fetched, which no browser allows from file://
}


def site(options):
    """Build the site, say where it is; exit status 1 and the warnings when there were any."""
    console = Console()
    # This process ends with the build: looking for garbage among millions of nodes takes a third of it and finds nothing to speak of.
    gc.disable()
    target = Path(options.out) if options.out else paths.build("site")
    warnings = build(target, paths.build("site-cache"), jobs=options.jobs)
    for line in warnings:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print(f"{len(warnings)} warnings, {target / 'index.html'}", highlight=False, soft_wrap=True)
    return 1 if warnings else 0


def build(target, cache, jobs=None):
    """Build the site into ``target``; return Sphinx's warnings as lines, which are as bad as errors.

    ``cache`` keeps sources and what was read of them: a second build reads only what has changed.
    """
    from sphinx.application import Sphinx
    from sphinx.util.docutils import docutils_namespace, patch_docutils

    source, extra = cache / "source", cache / "extra"
    _synchronise(source, _sources(extra))
    said = io.StringIO()
    configuration = CONFIGURATION | {"html_extra_path": [str(extra)] if extra.exists() else []}
    with patch_docutils(), docutils_namespace():
        app = Sphinx(
            srcdir=source, confdir=None, outdir=Path(target).resolve(), doctreedir=cache / "doctrees", buildername="html",
            confoverrides=configuration, status=None, warning=said, parallel=jobs or os.cpu_count() or 1,
        )  # fmt: skip
        app.build()
    warnings = re.sub(r"\x1b\[[0-9;]*m", "", said.getvalue()).splitlines()
    if warnings:  # what was read is not read again, and would not be warned of again
        shutil.rmtree(cache / "doctrees")
    return warnings


def _sources(extra):
    """Return ``{path: bytes, or path of a file to copy}`` of all that Sphinx reads."""
    problem, found = _difference_page(extra)
    sources = dict(site_pages.all_pages(problem, found))
    for path in site_notebooks.found().values():
        sources[f"files/{path.relative_to(paths.root()).as_posix()}"] = path
    for path in sorted((paths.root() / "figures").rglob("*.*")):
        if path.suffix in (".svg", ".png", ".csv"):
            sources[f"files/{path.relative_to(paths.root()).as_posix()}"] = path
    return sources


def _difference_page(extra):
    """Write the difference page against what git holds; return (why not, or nothing; the differences)."""
    shutil.rmtree(extra, ignore_errors=True)
    accepted = extra.with_name("accepted")
    shutil.rmtree(accepted, ignore_errors=True)
    accepted.mkdir(parents=True)
    try:
        return "", difference.write_page(review.accepted(accepted), paths.root(), list(runner.items()), [], extra / "difference")
    except ValueError as error:
        return str(error), []


def _synchronise(folder, sources):
    """Make a folder hold these files and no others; what has not changed keeps its date, by which Sphinx goes."""
    for path in [path for path in folder.rglob("*") if path.is_file()]:
        if path.relative_to(folder).as_posix() not in sources:
            path.unlink()
    for name, content in sources.items():
        content = content.read_bytes() if isinstance(content, Path) else content
        path = folder / name
        if not path.exists() or path.read_bytes() != content:
            write_atomically(path, content)
