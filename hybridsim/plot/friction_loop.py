"""This module draws an output against a state: the area of a friction loop is the energy loss."""

from __future__ import annotations

from matplotlib.axes import Axes

from hybridsim.errors import UsageError
from hybridsim.plot.orbit import draw_orbit
from hybridsim.plot.shared.smooth_parts import refuse_arrays
from hybridsim.solution import Solution


def friction_loop(
    solution: Solution,
    output: str | None = None,
    state: str | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw an output over a state; the enclosed area is the energy loss of the friction.

    Parameters
    ----------
    output : by default the force of the first contact; without a contact the first output.
    state : by default the first.
    t_span : part of the run; by default all, or the last few of very many periods (the title says so).
    axes : the axes to draw in; by default a new figure.
    """
    refuse_arrays(solution)
    model = solution.model
    if output is None:
        names = [
            *(contact.name for contact in model.contacts),
            *(declared.name for declared in model.outputs),
        ]
        if not names:
            raise UsageError(
                f"{model.name} has no contacts and no outputs", remedy="declare an output under [outputs]"
            )
        output = names[0]
    if state is None:
        state = model.states[0].name
    return draw_orbit(solution, state, output, t_span, axes)
