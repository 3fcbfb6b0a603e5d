"""The picture of a ladder: every error is told from the tolerance, however far both are apart."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs
from hybridsim.analysis.advise.ladder import ADEQUATE, FULL, NOT_ADEQUATE, NOT_APPLICABLE, Step
from hybridsim.plot import advice


def ladder(tol: float, *errors: float | None) -> hs.Advice:
    names = ["at-rest", "no-friction", "viscous", "no-stop", "tanh"]
    steps = [
        Step(name, name, "", None, math.inf, math.nan, NOT_APPLICABLE, "")
        if error is None
        else Step(name, name, "", 1.0, error, 1e-3, ADEQUATE if error <= tol else NOT_ADEQUATE, "")
        for name, error in zip(names, errors, strict=False)
    ]
    steps.append(Step(FULL, FULL, "nothing", 1.0, 0.0, 1e-3, FULL, ""))
    return hs.Advice(hs.load("dfcs"), "amplitude.x", tol, 1.0, tuple(steps))


@pytest.mark.parametrize(
    ("tol", "errors"),
    [
        (0.01, (1.0, 11.0, None, 1e-15, 0.0)),
        (1e-6, (1.0, 0.28)),
        (0.01, (0.0, math.inf)),
        (0.5, (0.49, 0.51, 0.4)),
        (1e-3, (None, None)),
    ],
)
def test_the_tolerance_stands_well_inside(tol: float, errors: tuple[float | None, ...]) -> None:
    axes = advice(ladder(tol, *errors))
    axes.figure.canvas.draw()  # it can be drawn
    low, high = axes.get_xlim()
    share = math.log(tol / low) / math.log(high / low)
    assert 0.2 < share < 0.8
    for line in axes.lines[1:]:  # the first is the tolerance; each of the others is the mark of an error
        at = float(line.get_xdata()[0])
        assert low <= at <= high
        assert (at <= tol) == (line.get_markerfacecolor() != "white")
    assert len(axes.lines) - 1 == sum(error is not None for error in errors)


def test_the_title_names_the_question_and_the_answer() -> None:
    title = advice(ladder(0.01, 1.0, 0.001)).get_title(loc="left")
    assert " ".join(title.split()) == "Simplest model of dfcs for amplitude.x within 0.01: no-friction"
