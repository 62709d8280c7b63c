"""Text for the site's pages: templates, escaping for MyST Markdown, links of the repository turned into links of the site."""

import re
from functools import cache
from pathlib import Path

import jinja2

from drivelib.pack import architecture

TEMPLATES = Path(__file__).parent / "site_templates"


@cache
def environment():
    """Return the environment of the page templates; an unknown name in a template is an error."""
    loaded = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    loaded.filters |= {"md": escaped, "cell": cell, "slug": slug, "api_page": api_page}
    return loaded


def page(template, **values):
    """Return a page as text from the template of that name."""
    return environment().get_template(template).render(**values)


def escaped(text):
    """Return plain text as MyST Markdown that shows it as it is; what stands in backticks stays code."""
    parts = re.split(r"(`[^`]+`)", " ".join(text.split()))
    return "".join(part if number % 2 else re.sub(r"([\\`*_{}\[\]<>#$|~^@])", r"\\\1", part) for number, part in enumerate(parts))


def cell(text):
    """Return plain text for a cell of a Markdown table."""
    return re.sub(r"(?<!\\)\|", r"\\|", escaped(text))


def slug(text):
    """Return a text as the name of a CSS class: "reproduced, corrected" becomes "reproduced-corrected"."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def relinked(text, depth):
    """Return Markdown with links into the repository turned into links of the site.

    Parameters
    ----------
    text : str
    depth : int
        How many folders below the site's root the page stands.
    """
    up = "../" * depth

    def link(found):
        label, target = found.groups()
        name = re.sub(r"^(\.\./)+", "", target)
        if module := re.fullmatch(r"drivelib/([\w/]+)\.py", name):
            return f"[{label}]({up}{api_page(module[1])}.md)"
        if ledger := re.fullmatch(r"drivelib/papers/(\w+)\.toml", name):
            return f"[{label}]({up}papers/{ledger[1]}.md)"
        if re.fullmatch(r"(\w+/)*\w+\.ipynb", name) or re.match(r"[a-z]+:|#", name):
            return found[0]
        return label  # a file of the repository that has no page here
    return re.sub(r"\[([^\]]*)\]\(([^()\s]+)\)", link, text)


def api_page(name):
    """Return the page of a file of drivelib: ``api/drivelib.pack.site`` for ``pack/site``."""
    return f"api/{architecture.module(name)}"
