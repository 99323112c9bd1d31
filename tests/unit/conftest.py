"""pytest puts the folder of a conftest on `sys.path`: with this file the unit tests can import `result_factory`."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("unit", deadline=None)  # a busy machine is no failure
settings.load_profile("unit")
