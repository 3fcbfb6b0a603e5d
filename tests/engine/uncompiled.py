"""Runs code in a process in which nothing is compiled."""

from __future__ import annotations

import os
import subprocess
import sys


def uncompiled(code: str) -> str:
    """What the code prints there; it imports what tests can."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"HYBRIDSIM_JIT": "0", "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
