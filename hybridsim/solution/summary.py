"""This module summarises a solution as text for a terminal and as HTML for a notebook."""

from __future__ import annotations

from html import escape

from hybridsim.errors import printable
from hybridsim.presentation.notebook import run_html
from hybridsim.presentation.readable import cost_text
from hybridsim.solution.model_trajectory import ModelTrajectory
from hybridsim.solution.run_trajectory import RunTrajectory


def as_text(run: RunTrajectory) -> str:
    """Return a summary as text: status, end state, events by kind, cost and warnings."""
    lines = [
        f"Solution of {run.model.name} by {run.integrator}: {run.status}",
        f"  {run.message}",
        *run.summary(),
        *(f"  warning: {w}" for w in run.warnings),
    ]
    return printable("\n".join(lines))


def in_html(run: RunTrajectory, success: bool) -> str:
    """Return a summary as HTML: status, a strip of modes for each component, events and warnings."""
    if not isinstance(run, ModelTrajectory):
        return f"<pre>{escape(as_text(run))}</pre>"
    model = run.model
    head = {run.status: f"{model.title or model.name}, by {run.integrator}", "cost": cost_text(run.stats)}
    head |= {} if success else {"message": run.message}
    span = (run.t_start, run.t_end) if run.segments else None
    known = run.save != "nothing"
    modes, events = (run.modes, run.events) if known else ({}, ())
    return run_html(run.components, head, success, span, modes, events, run.warnings)
