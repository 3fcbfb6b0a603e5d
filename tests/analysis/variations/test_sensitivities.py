"""Derivatives of runs with events against Richardson differences of the runs themselves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError

# model, end, integrator, parameters: slip to stick, stick to slip, slip to slip, impacts, resets
RUNS = (
    ("dfcs", 0.05, "exact", ("F0", "N", "k", "omega", "mu", "c", "m")),
    ("dfcs", 0.05, "taylor", ("N", "omega")),
    ("belt", 30.0, "taylor", ("Fs", "delta", "v_belt", "k")),
    ("dfcs-stribeck", 0.05, "taylor", ("F0", "omega", "N")),
    ("static-kinetic", 5.0, "exact", ("mu_s", "mu_k", "v_pull", "k")),
    ("bouncing-ball", 1.2, "exact", ("g", "e")),
    ("thermostat", 3.0, "exact", ("T_low", "T_high", "q", "tau")),
)


def ends(solution: hs.Solution) -> np.ndarray:
    """Times of all events, then the last states."""
    times = [float(segment.start) for segment in list(solution._segments)[1:]]
    return np.concatenate([times, solution.y[:, -1]])


def differences(model: hs.Model, name: str, run: object) -> np.ndarray:
    """d(ends)/d(parameter) to fourth order, with the step at which two of them agree best."""
    value, found = model.parameter_values()[name], []
    for share in (1e-3, 1e-4, 1e-5):
        h = share * (abs(value) or 1.0)
        rows = [ends(run(model.with_(**{name: value + k * h}))) for k in (2, 1, -1, -2)]
        if len({len(row) for row in rows}) == 1:
            found.append((8.0 * (rows[1] - rows[2]) - (rows[0] - rows[3])) / (12.0 * h))
    gaps = [np.abs(a - b).max() for a, b in pairwise(found)]
    return found[int(np.argmin(gaps)) + 1]


@pytest.mark.parametrize(("name", "end", "integrator", "parameters"), RUNS)
def test_against_differences(name: str, end: float, integrator: str, parameters: tuple[str, ...]) -> None:
    model = hs.load(name)

    def run(changed: hs.Model) -> hs.Solution:
        return hs.simulate(changed, (0.0, end), integrator=integrator, rtol=1e-13)

    found = hs.sensitivities(run(model), parameters)
    for j, parameter in enumerate(parameters):
        expected = differences(model, parameter, run)
        events = len(found.times)
        for got, want in (
            (found.times_by_parameter[:, j], expected[:events]),
            (found.by_parameter[:, j], expected[events:]),
        ):
            assert np.abs(got - want).max(initial=0.0) <= 1e-7 * np.abs(want).max(initial=1e-300), parameter


def test_by_start_across_a_reversal() -> None:
    """No stop: slip to slip; the transition matrix against differences."""
    model = hs.load("dfcs").with_(N=12)

    def run(x0: np.ndarray) -> np.ndarray:
        return hs.simulate(model, (0.0, 0.03), x0=x0.tolist(), integrator="exact").y[:, -1]

    start = np.array([1e-4, 0.05])
    solution = hs.simulate(model, (0.0, 0.03), x0=start.tolist(), integrator="exact")
    assert {(e.source, e.target) for e in solution.events} >= {("slip+", "slip-"), ("slip-", "slip+")}
    found = hs.sensitivities(solution, ()).by_start
    for j, h in enumerate((1e-8, 1e-5)):
        move = np.zeros(2)
        move[j] = h
        want = (
            8 * (run(start + move) - run(start - move)) - run(start + 2 * move) + run(start - 2 * move)
        ) / (12 * h)
        assert np.abs(found[:, j] / want - 1.0).max() < 1e-7


def test_stick_forgets_the_velocity_exactly() -> None:
    stick = [i for i in hs.simulate("dfcs", (0.0, 0.03)).modes["f"] if i.mode == "stick"][-1]
    solution = hs.simulate("dfcs", (0.0, 0.5 * (stick.t0 + stick.t1)))
    assert solution.modes["f"][-1].mode == "stick"
    assert (hs.sensitivities(solution, ()).by_start[1] == 0.0).all()


def decay(t: float, x: np.ndarray, p: object) -> tuple[float]:
    return (-x[0],)


def test_what_cannot_be_differentiated_is_refused() -> None:
    with pytest.raises(UsageError, match="Python functions"):
        hs.sensitivities(hs.simulate(hs.Model("m", states={"x": 1.0}, flow=decay), (0, 1)))
    with pytest.raises(UsageError, match="keep"):
        hs.sensitivities(hs.simulate("dfcs", (0.0, 0.1), keep="events"))
    with pytest.raises(UsageError, match="'nu'"):
        hs.sensitivities(hs.simulate("dfcs", (0.0, 0.1)), ["nu"])


def test_a_limit_that_rounding_hides_is_refused() -> None:
    """On a floor at 1 the last bounces are not followed, and their derivatives are not known."""
    guard = hs.Guard("floor", "h - 1", hs.Choice("flight", reset={"h": 1, "w": "-e*w"}))
    modes = [hs.Mode("flight", guard, set={"g": 10}), hs.Mode("rest", set={"g": 0})]
    stop = hs.Choice("rest", reset={"h": 1, "w": 0})
    model = hs.Model(
        "ball",
        parameters=[hs.Parameter("e", 0.5)],
        states=[hs.State("h", 1.2, "w"), hs.State("w", 0, "-g")],
        components=[hs.Component("ball", modes, initial="flight", limit=stop)],
    )
    with pytest.raises(UsageError, match="not resolved to rounding"):
        hs.sensitivities(hs.simulate(model, (0, 1)))
