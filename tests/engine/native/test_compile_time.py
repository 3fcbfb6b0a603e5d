"""Compiling is no part of what a run takes: with an empty cache, times of runs are those of compiled code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SIMULATED = """
sol = hs.simulate("dfcs", (0, 1), integrator="moreau", steps_per_period=300)
times = [sol.stats["wall_time"]]
"""
STEPPED = """
system = hs.chain_on_belt(3)
times = [hs.simulate(system, (0, 20)).stats["kernel_time"]]
"""
AROUND = """
import json, time
import hybridsim as hs
began = time.perf_counter()
{run}
print(json.dumps([times, time.perf_counter() - began]))
"""


@pytest.mark.slow  # everything is compiled, which takes a minute
@pytest.mark.parametrize("run", [SIMULATED, STEPPED], ids=["model", "mechanical system"])
def test_a_first_run_is_as_fast_as_those_after_it(run: str, tmp_path: Path) -> None:
    """What is run takes milliseconds, and what is compiled for it many seconds."""
    environment = {**os.environ, "HYBRIDSIM_CACHE": str(tmp_path / "cache")}
    environment.pop("HS_DEV", None)
    told = subprocess.run(
        [sys.executable, "-c", AROUND.format(run=run)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    times, whole = json.loads(told.stdout)
    assert whole > 2.0 and times
    assert max(times) < 0.1 * whole
