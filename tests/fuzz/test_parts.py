"""Files with parts that are wrong in random ways are refused with a place, and none runs code."""

from __future__ import annotations

import random
from pathlib import Path

from fuzz.parts import fault_of


def test_random_files_with_parts_are_refused_with_a_place_or_load_again(tmp_path: Path) -> None:
    faults = {k: fault for k in range(150) if (fault := fault_of(random.Random(k), tmp_path))}
    assert not faults
