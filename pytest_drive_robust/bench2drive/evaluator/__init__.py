"""The official Bench2Drive evaluator as the simulator: your checkout, your CARLA, our perturbations.

This package contains nothing of Bench2Drive and changes no file of a checkout. `inject.py` and `injection/` run inside
the evaluator's own Python; all other modules start, watch and read evaluators from the outside.
"""

from __future__ import annotations
