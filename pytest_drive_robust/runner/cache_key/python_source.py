"""Reads Python source as text: which modules it imports, and what of a test file counts as code."""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from contextlib import suppress
from typing import TypeGuard

_TEST_FILE = re.compile(r"test_.*\.py|.*_test\.py")
_LINE = rb"(?:\\\r?\n|[^#;\r\n])*"
"""Matches to the end of a statement, which may continue on the next line after a backslash."""
_GAP = rb"(?:[ \t\f]|\\\r?\n)"
_IMPORT = re.compile(
    rb"(?:^(?:\xef\xbb\xbf)?|[;:])[ \t\f]*(?:"
    rb"from\b" + _GAP + rb"*(?P<module>[\w.\x80-\xff]*?)" + _GAP + rb"*import\b"
    rb"[ \t]*(?P<names>\((?:[^)#]|#[^\r\n]*)*\)|" + _LINE + rb")"
    rb"|import" + _GAP + rb"+(?P<list>" + _LINE + rb"))",
    re.MULTILINE,
)
_COMMENT = re.compile(rb"#[^\r\n]*")


def imports_in(content: bytes) -> Iterator[str]:
    """Yield the dotted names that are imported: `a.b` and `a.b.c` for `from a.b import c`."""
    for match in _IMPORT.finditer(content):
        named = _COMMENT.sub(b"", match["names"] or match["list"] or b"").decode(errors="replace")
        words = re.sub(r"[()\\]", " ", named).split(",")
        names = [word.split()[0] for word in words if word.split()]
        if match["list"] is not None:
            yield from names
            continue
        module = match["module"].decode(errors="replace")
        yield module
        yield from (f"{module}{'' if module.endswith('.') else '.'}{name}" for name in names)


def what_counts(name: str, content: bytes) -> bytes:
    """Return what counts of the file `name`: a test file's content without its tests, which no code beside it needs."""
    return _without_tests(content) if _TEST_FILE.fullmatch(name) else content


@functools.lru_cache(maxsize=1024)  # an agent, its perturbations and its simulator share files
def _without_tests(content: bytes) -> bytes:
    with suppress(SyntaxError, ValueError):
        tree = ast.parse(content)
        tests = {part.name: part for part in tree.body if _is_test(part)}
        kept = [part for part in tree.body if part not in tests.values()]
        for part in kept:  # a function that other code calls is no test, whatever its name
            used = {node.id for node in ast.walk(part) if isinstance(node, ast.Name)}
            kept += [tests.pop(name) for name in sorted(used & tests.keys())]
        tree.body = [part for part in tree.body if part in kept]
        return ast.dump(tree).encode(errors="surrogatepass")
    return content


def _is_test(part: ast.stmt) -> TypeGuard[ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef]:
    """Return whether a statement defines a function named as a test, or a class with such a function."""
    if isinstance(part, ast.ClassDef):
        return part.name.startswith("Test") and any(_is_test(inner) for inner in part.body)
    return isinstance(part, (ast.FunctionDef, ast.AsyncFunctionDef)) and part.name.startswith("test")
