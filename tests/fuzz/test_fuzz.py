"""A few mutated model files and command lines; `docs/studies/fuzz.py` runs ten thousand of each."""

from __future__ import annotations

import pytest

from fuzz.judge import file_case, line_case, observed, sandbox
from fuzz.nasty import CANARY
from hybridsim.expr import parse


def test_mutated_files() -> None:
    with sandbox() as folder:
        for number in range(60):
            finding = file_case(3, number, folder)
            assert not finding.faults, (number, finding)


def test_mutated_command_lines() -> None:
    with sandbox() as folder:
        for number in range(80):
            finding = line_case(3, number, folder)
            assert not finding.faults, (number, finding)


def test_the_judge_sees_what_it_is_there_for() -> None:
    """Code that runs, a file that nobody named, an exception, a warning."""
    with sandbox() as folder:
        with observed(folder, lambda place: False) as finding:
            eval(f"{CANARY}()")  # noqa: S307  # what must never happen
            (folder / "unnamed").write_text("x")
            import warnings

            warnings.warn("odd", stacklevel=1)
            raise ValueError("a bug")
        found = "\n".join(finding.faults)
    for word in ("the canary was called", "unnamed", "odd", "a bug"):
        assert word in found


@pytest.mark.parametrize("text", [f"{CANARY}()", f"__import__('{CANARY}')", f"x if {CANARY}() else 1"])
def test_no_expression_calls(text: str) -> None:
    with sandbox() as folder, observed(folder, lambda place: False) as finding:
        parse(text)
    assert "ExpressionError" in "".join(finding.faults) and "canary was" not in "".join(finding.faults)
