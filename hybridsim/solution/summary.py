"""This module summarises a solution as text for a terminal and as HTML for a notebook."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from hybridsim.errors import printable
from hybridsim.presentation.notebook import run_html

if TYPE_CHECKING:
    from hybridsim.solution.solution import Solution


def kinds(solution: Solution) -> Counter[str]:
    """Count the events of each kind, including corners, without creating event objects."""
    found: Counter[str] = Counter()
    for block in solution._trajectory.occurrences.blocks:
        found += block.kinds()
    return found


def as_text(solution: Solution) -> str:
    """Return a summary as text: status, end state, events by kind, cost and warnings."""
    counted = ", ".join(f"{n} {kind}" for kind, n in sorted(kinds(solution).items())) or "none"
    counted = "not kept" if solution._save == "nothing" else counted
    lines = [
        f"Solution of {solution.model.name} by {solution.integrator}: {solution.status}",
        f"  {solution.message}",
    ]
    if solution._segments:
        last = solution._segments[-1].x[-1]
        final = ", ".join(f"{n} = {v:.9g}" for n, v in zip(solution.names, last, strict=True))
        lines += [f"  t from {solution.t_start:.9g} to {solution.t_end:.9g}; at the end {final}"]
    stats = solution.stats
    lines += [
        f"  events: {counted}",
        f"  cost: {stats['steps']} steps, {stats['rhs_evaluations']} right-hand sides, {stats['wall_time']:.3g} s",
        *(f"  warning: {w}" for w in solution.warnings),
    ]
    return printable("\n".join(lines))


def in_html(solution: Solution) -> str:
    """Return a summary as HTML: status, a strip of modes for each component, events and warnings."""
    stats, model = solution.stats, solution.model
    head = {
        solution.status: f"{model.title or model.name}, by {solution.integrator}",
        "cost": f"{stats['steps']} steps ({stats['rejected']} rejected), "
        f"{stats['rhs_evaluations']} right-hand sides, {stats['wall_time']:.3g} s",
    }
    head |= {} if solution.success else {"message": solution.message}
    span = (solution.t_start, solution.t_end) if solution._segments else None
    known = solution._save != "nothing"
    modes, events = (solution.modes, solution.events) if known else ({}, ())
    return run_html(solution.components, head, solution.success, span, modes, events, solution.warnings)
