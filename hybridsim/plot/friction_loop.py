"""An output against a state: for a friction force against a displacement, the loop whose area is the loss."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybridsim.errors import UsageError
from hybridsim.plot.orbit import draw_orbit

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
    output : the first that is the force of a contact if not given, else the first of all.
    state : the first if not given.
    t_span : part of the run; if not given all, or the last few of very many periods (the title says so).
    axes : where to draw; a new figure if not given.
    """
    model = solution.model
    if output is None:
        names = [declared.name for declared in model.outputs]
        forces = [contact.name for contact in model.contacts if contact.name in names]
        if not names:
            raise UsageError(
                f"{model.name} has no outputs",
                remedy="declare one under [outputs], such as the friction force",
            )
        output = (forces or names)[0]
    if state is None:
        state = model.states[0].name
    return draw_orbit(solution, state, output, t_span, axes)
