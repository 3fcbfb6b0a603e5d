"""A small sample of the study of faults of units: most are found on the right line, and nothing else is."""

from __future__ import annotations

import runpy
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_most_faults_are_found_on_the_right_line() -> None:
    study = runpy.run_path(str(ROOT / "docs" / "studies" / "units.py"))
    ends = [end for _, end in islice(study["cases"](4, 60), 60)]
    assert ends.count(study["ENDS"][0]) >= 57
