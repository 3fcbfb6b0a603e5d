"""`explain-status` prints sections of the explanations that the package contains."""

from __future__ import annotations

from collections.abc import Callable

from hybridsim.presentation.statuses import explanations


def test_the_command_prints_a_section_or_all_headings(hybridsim: Callable) -> None:
    code, out, err = hybridsim("explain-status", "step-failure")
    assert (code, err) == (0, "") and out.startswith("step-failure\n\n") and "](" not in out
    _, every, _ = hybridsim("explain-status")
    assert every.splitlines() == list(explanations())
    assert hybridsim("explain-status", "no", "such")[0] == 2
