"""This module draws a friction law: force against velocity, and against displacement for laws with memory."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np
from matplotlib.axes import Axes

from hybridsim.errors import UsageError
from hybridsim.expr import evaluate, parse
from hybridsim.model import Contact, FrictionLaw, Model, Output, State, load_law
from hybridsim.plot.shared import style
from hybridsim.plot.shared.curve_samples import sample_curves
from hybridsim.plot.shared.smooth_parts import Window, samples_of
from hybridsim.simulate import simulate

_PARTS = 300  # first division of the speeds
_ARROW = 0.3  # of the length of a loop: an arrow halfway would be at the turning point of the velocity


def friction_law(
    law: FrictionLaw | str,
    arguments: Mapping[str, float] | None = None,
    *,
    speed: float | None = None,
    normal: float = 1.0,
    amplitude: float = 1.0,
    mean: float = 0.0,
    integrator: str = "auto",
) -> list[Axes]:
    """Draw a friction law in one axes, or in two if the law has states.

    A set-valued law is drawn as its curve, with the range of forces at rest. Any other law is driven by the
    velocity mean + speed*cos(speed/amplitude*t) and drawn over the second period. A law with states is also
    drawn against the displacement, without its mean motion.

    Parameters
    ----------
    law : a law, or the name of a packaged one.
    arguments : values of its parameters.
    speed : largest velocity about the mean; it has no default, because a law does not determine a range of speeds.
    """
    found = load_law(law) if isinstance(law, str) else law
    if speed is None:
        raise UsageError(
            f"friction_law({found.name!r}) needs `speed`",
            remedy="set `speed` to the largest velocity to draw",
        )
    if not speed > 0 or not amplitude > 0:
        raise UsageError(
            f"`speed` and `amplitude` cannot be {speed!r} and {amplitude!r}", remedy="use numbers above zero"
        )
    law_arguments = {name: parse(value) for name, value in (arguments or {}).items()}
    contact = Contact("f", parse("v"), parse(normal), found, law_arguments)
    panels = 1 + bool(found.states)
    figure = style.figure(0.6 + 3.4 * panels, 2.8)
    axes = list(np.atleast_1d(figure.subplots(1, panels, sharey=True)))
    if found.is_set_valued:
        _curve(axes[0], contact, speed)
    else:
        _driven(axes, contact, speed, amplitude, mean, integrator)
    axes[0].set_xlabel("velocity", fontsize=9)
    axes[0].set_ylabel("friction force" + (" / normal load" if normal == 1.0 else ""), fontsize=9)
    low, high = axes[0].get_ylim()
    if low > 0:  # a small effect looks small
        axes[0].set_ylim(0.0, 1.1 * high)
    for each in axes:
        style.dress(each)
    style.head(axes[0], found.title or found.name)
    return axes


def _curve(axes: Axes, contact: Contact, speed: float) -> None:
    limits = evaluate(contact.limit_force(), {}), -evaluate(contact.limit_force(backward=True), {})
    corners = [v for table in contact.law.tables if table.over.text == "v" for v in table.at if 0 < v < speed]
    knots = np.union1d(speed * np.linspace(0.0, 1.0, _PARTS), corners)
    for sign, colour in ((1, style.PALETTE[0]), (-1, style.PALETTE[1])):

        def signed(at: np.ndarray, _: bool, sign: int = sign) -> np.ndarray:
            return np.array([[sign * slip_force(contact, v, backward=sign < 0) for v in at.tolist()]])

        speeds, (force,), _ = sample_curves(signed, knots, np.zeros(len(knots) - 1, dtype=bool))
        axes.plot(sign * speeds, force, color=colour, linewidth=1.6)
        for table in contact.law.tables if sign > 0 else ():
            marked = [v for v in table.at if v <= speed and table.over.text == "v"]
            forces = [slip_force(contact, v) for v in marked]
            axes.plot(marked, forces, "o", color=colour, markersize=4, label="points of the table")
    axes.plot([0, 0], limits, color=style.INK, linewidth=3.0, solid_capstyle="butt")


def slip_force(contact: Contact, speed: float, *, backward: bool = False) -> float:
    """Return the magnitude of the slip force of a contact at a given speed."""
    law = contact.law
    of_tables = {table.name for table in law.tables}
    values = {name: evaluate(e, {}) for name, e in contact.values().items() if name not in of_tables}
    values["v"] = speed
    arguments = {
        table.name: [evaluate(e, values) for e in (table.over, table.across) if e is not None]
        for table in law.tables
    }
    known = {name: parse(value) for name, value in values.items()}
    values |= {table.name: table.bound(known).value(*arguments[table.name]) for table in law.tables}
    return evaluate((law.slip_backward if backward else None) or law.slip, values)


def _driven(
    axes: list[Axes], contact: Contact, speed: float, amplitude: float, mean: float, integrator: str
) -> None:
    rate = speed / amplitude
    velocity = parse(f"{mean!r} + {speed!r}*cos({rate!r}*t)")
    driven = Contact("f", velocity, contact.normal, contact.law, contact.arguments)
    displacement = State("x", parse(0), parse(f"{speed!r}*cos({rate!r}*t)"), nominal=amplitude)
    model = Model("driven", (displacement,), contacts=(driven,), outputs=(Output("f", parse("f")),))
    period = 2 * pi / rate
    solution = simulate(model, (0.0, 2 * period), integrator=integrator, rtol=1e-8)
    samples = samples_of(solution, ["f", "x"], Window(period, 2 * period))
    t, force = samples.t, samples.values["f"]
    curves = [mean + speed * np.cos(rate * t), amplitude * np.sin(rate * t)]
    for panel, x in zip(axes, curves, strict=False):
        panel.plot(x, force, color=style.INK, linewidth=1.4)  # one curve: the law has no modes of slip
        if contact.law.states:
            style.point_along(panel, x, force, style.INK, _ARROW)
    if len(axes) > 1:
        axes[1].set_xlabel("displacement", fontsize=9)
