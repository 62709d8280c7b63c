"""What the site adds to Sphinx: equations as MathML, and a few lines where defaults do not fit this pack."""

import re

from docutils import nodes
from latex2mathml.converter import convert
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
    app.connect("autodoc-process-docstring", _keep_bars)
    app.connect("html-page-context", _page, priority=100)  # before the theme's own
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(self, node):
    self.body.append(f'<span class="math">{mathml(node.astext())}</span>')
    raise nodes.SkipNode


def _block(self, node):
    self.body.append(f'<div class="math" tabindex="0">{mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def _keep_bars(app, what, name, obj, options, lines):
    """Let docstrings say |x| for a magnitude, which reStructuredText takes for a substitution."""
    for number, line in enumerate(lines):
        parts = re.split(r"(``.*?``|`.*?`)", line)
        lines[number] = "".join(part if k % 2 else part.replace("|", r"\|") for k, part in enumerate(parts))


def _page(app, pagename, templatename, context, doctree):
    """Open only the branch of the sidebar in which the page stands: the whole on each of some hundred pages is long and slow."""
    whole = context.get("toctree")
    if whole:
        context["toctree"] = lambda **options: whole(**(options | {"collapse": True}))
    if pagename.startswith("_modules/"):  # has the module's name for a title, as its reference has
        context["title"] = f"Source of {context['title']}"
