"""The code that runs inside the evaluator, in its Python: the setting, the payloads and the two seams.

Imports point one way: `plan`; `payloads`, `commands`; `injector`; `seams`, which `inject.py` starts. Every module here,
and all that it imports of the package, is Python 3.7 with the standard library and numpy.
"""

from __future__ import annotations
