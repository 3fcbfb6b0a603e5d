"""Files with parts that are wrong in random ways are refused with a place, and none runs code."""

from __future__ import annotations

from fuzz.judge import sandbox
from fuzz.parts import parts_case


def test_random_files_with_parts_are_refused_with_a_place_or_load_again() -> None:
    with sandbox() as folder:
        found = [parts_case(3, number, folder) for number in range(150)]
    assert not [(number, finding) for number, finding in enumerate(found) if finding.faults]
    assert {finding.end for finding in found} == {"refused", "loaded"}
