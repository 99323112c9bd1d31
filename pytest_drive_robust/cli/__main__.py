"""`python -m pytest_drive_robust.cli`: the command `drive-robust` where its script is not on the path."""

from __future__ import annotations

import sys

from pytest_drive_robust.cli.main import main

sys.exit(main())
