"""Runs code in a process in which nothing is compiled."""

from __future__ import annotations

import os
import sys

import fresh


def uncompiled(code: str) -> str:
    """What the code prints there; it imports what tests can."""
    paths = os.pathsep.join(p for p in sys.path if p)
    done = fresh.run(code, environment={**os.environ, "HYBRIDSIM_JIT": "0", "PYTHONPATH": paths})
    assert done.returncode == 0, done.stderr
    return done.stdout
