"""What the site adds to Sphinx: equations as MathML, and a few lines where defaults do not fit this pack."""

import importlib
import re
import sys

from docutils import nodes
from docutils.parsers.rst import states
from latex2mathml.converter import convert
from sphinx import addnodes
from sphinx.errors import SphinxError


class EquationError(SphinxError):
    """An equation that cannot be shown as MathML."""

    category = "Equation error"


def mathml(latex, display="inline"):
    """Return an equation as MathML, which browsers show without script or font files.

    Raises
    ------
    EquationError
        If a command of LaTeX is left over.
    """
    try:
        text = convert(latex, display=display)
    except Exception as error:  # latex2mathml has some thirty exceptions and no common base
        raise EquationError(f"{latex!r}: {error!r}") from error
    unknown = re.findall(r"\\+[a-zA-Z]*", text)
    if unknown:
        raise EquationError(f"{latex!r}: unknown to latex2mathml: {', '.join(unknown)}")
    return text


def setup(app):
    """Register with Sphinx."""
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    app.connect("env-before-read-docs", _modules)
    app.connect("doctree-read", _types)
    states.Inliner.dispatch = states.Inliner.dispatch | {"|": _bar}
    app.connect("html-page-context", _page, priority=100)  # before the theme's own
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _modules(app, env, docnames):
    """Import what the reference describes before Sphinx forks: else each of its processes imports torch and the like again."""
    for name in docnames:
        folder, _, module = name.rpartition("/")
        if folder == "api" and module.startswith("drivelib"):
            importlib.import_module(module)


def _inline(self, node):
    self.body.append(f'<span class="math">{mathml(node.astext())}</span>')
    raise nodes.SkipNode


def _block(self, node):
    self.body.append(f'<div class="math" tabindex="0">{mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def _bar(inliner, match, lineno):
    """Let text say |x| for a magnitude, which reStructuredText takes for a substitution."""
    end = match.end("start")
    return match.string[:end], [], match.string[end:], []


def _types(app, doctree):
    """Link a type or an exception in a docstring to what its own module calls so; any other word there is just a word.

    Sphinx would search the whole pack for something of that name, and there are two classes Scenario.
    """
    for node in list(doctree.findall(addnodes.pending_xref)):
        if node.get("refdomain") == "py" and node.get("refspecific"):
            named = _named(sys.modules.get(node.get("py:module")), node["reftarget"])
            if isinstance(named, type) and named.__module__.startswith("drivelib"):
                node["reftarget"] = f"{named.__module__}.{named.__qualname__}"
            else:
                node.replace_self(node.children)


def _named(module, name):
    for part in name.split("."):
        module = getattr(module, part, None)
    return module


def _page(app, pagename, templatename, context, doctree):
    """Open only the branch of the sidebar in which the page stands: the whole on each of some hundred pages is long and slow."""
    whole = context.get("toctree")
    if whole:
        context["toctree"] = lambda **options: whole(**(options | {"collapse": True}))
    if pagename.startswith("_modules/"):  # has the module's name for a title, as its reference has
        context["title"] = f"Source of {context['title']}"
