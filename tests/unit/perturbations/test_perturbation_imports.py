from __future__ import annotations

import os
import subprocess
import sys


def test_perturbations_and_their_sentences_load_nothing_heavy() -> None:
    code = (
        "import sys, pytest_drive_robust.perturbations as p;"
        "s = p.Setting.parse('200 ms latency and occlusion 0.5 (fill=blur) and 1 s burst frame drop'); str(s);"
        "p.Setting.from_env({'ROBUSTNESS_ENABLE': '1'});"
        "heavy = {'numpy', 'cv2', 'torch', 'scipy', 'numba', 'gymnasium', 'highway_env', 'rich', 'pytest'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True, text=True)
    assert done.stdout.strip() == "[]"
