"""The official Bench2Drive evaluator as the simulator: your checkout, your CARLA, our perturbations.

Nothing of Bench2Drive is part of this package, and no file of a checkout is changed. `inject.py` and `injection/` are
run inside the evaluator's own Python; everything else starts, watches and reads evaluators from the outside.
"""

from __future__ import annotations
