"""How long tests wait for what must come."""

from __future__ import annotations

PATIENCE_S = 300.0
"""On a machine however busy. Nothing is told from how long it took: what never ends here sleeps twice as long."""
