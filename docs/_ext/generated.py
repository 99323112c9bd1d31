"""The directive `.. generated:: NAME`: a part of the reference that is written by the code it is about.

Each part is a function without arguments in `reference_parts` that returns reStructuredText.
"""

from __future__ import annotations

import inspect
from dataclasses import MISSING, fields, is_dataclass
from typing import TYPE_CHECKING

import reference_parts
from docutils import nodes
from sphinx.util.docutils import SphinxDirective

if TYPE_CHECKING:
    from sphinx.application import Sphinx


class Generated(SphinxDirective):
    """Insert a part of the reference."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the nodes of the part. Sphinx reports an unknown name as an error of the page."""
        part = reference_parts.PARTS.get(self.arguments[0])
        if part is None:
            raise self.error(f"there is no part {self.arguments[0]!r}. Known: {', '.join(reference_parts.PARTS)}.")
        self.env.note_dependency(inspect.getfile(part))
        return self.parse_text_to_nodes(part(), allow_section_headings=True)


def _signature(
    app: Sphinx, what: str, name: str, value: object, options: object, signature: str | None, returns: str | None
) -> tuple[str | None, str | None] | None:
    """Show fields where a class is made by a function of any arguments, and nothing for a protocol."""
    if what != "class" or not signature or "(*args" not in signature:
        return None
    if not is_dataclass(value):
        return "", None
    shown = (f"{item.name}={item.default!r}" for item in fields(value) if item.default is not MISSING)
    return f"({', '.join(shown)})", None


def setup(app: Sphinx) -> dict[str, object]:
    """Register the directive."""
    app.add_directive("generated", Generated)
    app.connect("autodoc-process-signature", _signature)
    return {"parallel_read_safe": True}
