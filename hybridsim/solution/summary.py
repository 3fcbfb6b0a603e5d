"""This module summarises a solution as text for a terminal and as HTML for a notebook."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from hybridsim.errors import printable
from hybridsim.presentation.notebook import run_html
from hybridsim.solution.model_trajectory import ModelTrajectory

if TYPE_CHECKING:
    from hybridsim.solution.solution import Solution


def as_text(solution: Solution) -> str:
    """Return a summary as text: status, end state, events by kind, cost and warnings."""
    lines = [
        f"Solution of {solution.model.name} by {solution.integrator}: {solution.status}",
        f"  {solution.message}",
        *solution._trajectory.summary(),
        *(f"  warning: {w}" for w in solution.warnings),
    ]
    return printable("\n".join(lines))


def in_html(solution: Solution) -> str:
    """Return a summary as HTML: status, a strip of modes for each component, events and warnings."""
    if not isinstance(solution._trajectory, ModelTrajectory):
        return f"<pre>{escape(as_text(solution))}</pre>"
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
