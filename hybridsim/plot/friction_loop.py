"""An output against a state: for a friction force against a displacement, the loop whose area is the loss."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybridsim.errors import UsageError
from hybridsim.plot.orbit import draw_orbit
from hybridsim.plot.pieces import refuse_arrays

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.solution import Solution


def friction_loop(
    solution: Solution,
    output: str | None = None,
    state: str | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw an output against a state.

    Parameters
    ----------
    output : the force of the first contact if not given; without a contact the first output.
    state : the first if not given.
    t_span : part of the run; if not given all, or the last few of very many periods (the title says so).
    axes : where to draw; a new figure if not given.
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
