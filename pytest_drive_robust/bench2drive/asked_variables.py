"""Which environment variables an official agent reads: they decide how it drives."""

from __future__ import annotations

import re
from pathlib import Path

_ASKS_FOR = re.compile(r"""(?:environ(?:\.get\(|\[)|getenv\()\s*['"](\w+)['"]""")


def asked_variables(file: Path) -> frozenset[str]:
    """Return the names of those that the agent's file asks for by name; not those of the modules that it imports."""
    return frozenset(_ASKS_FOR.findall(file.read_text(encoding="utf-8", errors="replace")))
