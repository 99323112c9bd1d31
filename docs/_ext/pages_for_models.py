"""Writes `llms.txt` beside the site: every page with its first paragraph and the address of its text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from docutils import nodes

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment


def llms_text(env: BuildEnvironment, about: str) -> str:
    """Return the file: the title, what it is, and a line for each page in the order of the contents."""
    lines = [f"# {env.config.project}", "", f"> {about}", "", "## Pages", ""]
    for page in _in_order(env):
        title = env.titles[page].astext()
        source = f"_sources/{page}{Path(env.doc2path(page)).suffix}.txt"
        first = next(iter(env.get_doctree(page).findall(nodes.paragraph)), None)
        told = "" if first is None else " ".join(first.astext().split())
        lines.append(f"- [{title}]({source}): {told}".rstrip(": "))
    return "\n".join(lines) + "\n"


def _in_order(env: BuildEnvironment) -> list[str]:
    """Return the pages as the contents list them, from the root on."""
    found: list[str] = []

    def visit(page: str) -> None:
        if page not in found:
            found.append(page)
            for child in env.toctree_includes.get(page, ()):
                visit(child)

    visit(env.config.root_doc)
    return found


def _write(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        (Path(app.outdir) / "llms.txt").write_text(llms_text(app.env, app.config.about), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, object]:
    """Write the file when the site is built; `about` is what the project is, in a sentence."""
    app.add_config_value("about", "", "html")
    app.connect("build-finished", _write)
    return {"parallel_read_safe": True}
