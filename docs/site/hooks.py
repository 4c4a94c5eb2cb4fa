"""What the site adds to the pages: the docstring of each effect in its section, and cross-references in place of roles."""

import re
from typing import Any

import gtpin

SECTION = re.compile(r'^## <a id="(\w+)"></a>.*$', re.MULTILINE)
DOCSTRING = """

::: {path}
    options:
      members: []
      show_bases: false
      show_root_heading: false
      show_root_toc_entry: false
      merge_init_into_class: false
"""
ROLE = re.compile(r":(?:class|func|meth|attr|mod|data|exc):<code>~?([\w.]+)</code>")
"""A role of reStructuredText, as Markdown leaves it."""


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """On the page of the effects: the docstring of its class under the heading of each effect."""
    if page.file.src_uri != "effects.md":
        return markdown
    paths = {effect.id: f"{type(effect).__module__}.{type(effect).__qualname__}" for effect in gtpin.catalogue()}
    return SECTION.sub(lambda found: found[0] + DOCSTRING.format(path=paths[found[1]]), markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Roles as links to what they name, where it is on the site, else as code."""
    return ROLE.sub(_link, html)


def _link(found: re.Match[str]) -> str:
    path = found[1]
    return f'<autoref identifier="{path}" optional><code>{path.rsplit(".", 1)[-1]}</code></autoref>'
