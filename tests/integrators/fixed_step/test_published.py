"""The published fixed-step methods, and exact stick, against the closed form at the two published points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from reference.dfcs_closed_form import Motion, Oscillator

import hybridsim as hs
from hybridsim.model import Model

MODES = {1: "slip+", -1: "slip-", 0: "stick"}
PERIODS = 100
# (steps for each period, half width of the zero-velocity interval): the published setting, and both refined together
REFINED = ((1200, 8e-4), (4800, 8e-6), (19200, 8e-8))


@dataclass(frozen=True)
class Point:
    """The model at a published point, its exact motion from rest, and samples of the last of 100 periods."""

    model: Model
    period: float
    motion: Motion
    times: np.ndarray
    x: np.ndarray
    v: np.ndarray

    @property
    def amplitude(self) -> float:
        return self.motion.amplitude(99 * self.period, 100 * self.period)

    @property
    def sequence(self) -> list[str]:
        return [MODES[change.mode] for change in self.motion.changes]

    def run(
        self, integrator: str = "rk4-dichotomy", periods: float = PERIODS, **options: object
    ) -> hs.Solution:
        return hs.simulate(self.model, (0.0, periods * self.period), integrator=integrator, **options)

    def errors(self, sol: hs.Solution) -> tuple[float, float, float]:
        """Largest errors over the last period in x and v, relative to their size, and of event times in periods."""
        x, v = sol(self.times)
        late = [abs(e.t - c.t) / self.period for e, c in zip(sol.events, self.motion.changes, strict=True)]
        size = float(np.abs(self.v).max())
        return (
            float(np.abs(x - self.x).max()) / self.amplitude,
            float(np.abs(v - self.v).max()) / size,
            max(late),
        )


@cache
def point(name: str) -> Point:
    ratio, F0 = {"P1": (0.6, 30.0), "P2": (0.64, 22.0)}[name]
    model = hs.load("dfcs").with_(omega=f"{ratio}*sqrt(k/m)", N=40, F0=F0)
    p = model.parameter_values()
    limit, period = p["mu"] * p["N"], 2 * math.pi / p["omega"]
    motion = Oscillator(p["m"], p["c"], p["k"], limit, limit, F0, p["omega"]).run(0, PERIODS * period, 0)
    times = np.linspace(99 * period, 100 * period, 500, endpoint=False)
    states = np.array([motion.state(t)[:2] for t in times])
    return Point(model, period, motion, times, states[:, 0], states[:, 1])


def sequence(sol: hs.Solution) -> list[str]:
    return [e.target for e in sol.events]


@pytest.mark.parametrize(("name", "changes"), [("P1", 401), ("P2", 400)])
def test_the_published_points_have_that_many_changes(name: str, changes: int) -> None:
    assert len(point(name).motion.changes) == changes


# -- rk4-dichotomy ----------------------------------------------------------------------------------------------

VARIANTS = [
    {},
    {"release": "located"},
    {"friction": "stage"},
    {"after_event": "rest-of-step"},
    {"release": "located", "after_event": "rest-of-step"},
]


@pytest.mark.parametrize("options", VARIANTS, ids=lambda o: ",".join(o.values()) or "literal")
@pytest.mark.parametrize("name", ["P1", "P2"])
def test_with_v_zeroed_the_sequence_is_right_and_x_good_to_a_thousandth(
    name: str, options: dict[str, str]
) -> None:
    at = point(name)
    sol = at.run(stick_velocity="zero", **options)
    assert sol.status == "finished"
    assert sequence(sol) == at.sequence
    x, v, late = at.errors(sol)
    assert x < 1e-3
    assert v < 1e-2
    assert late < 4 / 1200, "an event is found within the steps around it"


@pytest.mark.parametrize("release", ["step", "located"])
@pytest.mark.parametrize("name", ["P1", "P2"])
def test_errors_fall_as_the_step_and_the_interval_shrink_together(name: str, release: str) -> None:
    at, found = point(name), []
    for steps, eps in REFINED:
        options = {"steps_per_period": steps, "eps_v": eps, "max_bisections": 60}
        sol = at.run(stick_velocity="zero", release=release, **options)
        assert sequence(sol) == at.sequence
        found.append(at.errors(sol))
    (x0, v0, t0), (x1, v1, t1), (x2, v2, t2) = found
    # where the release is located, event times are of first order in eps_v, which falls by 10**4; where it is taken at
    # the next step they are of first order in the step, which falls by 16
    fall = 1e4 if release == "located" else 100
    assert x0 > 10 * x1
    assert v0 > 10 * v1
    assert x0 > fall * x2
    assert v0 > fall * v2
    assert t0 > 2 * t1 > 4 * t2
    assert t0 > (1e3 if release == "located" else 16) * t2


@pytest.mark.parametrize("name", ["P1", "P2"])
def test_with_v_kept_the_body_creeps_while_it_sticks(name: str) -> None:
    """What Eq. 4 leaves of the velocity moves the body, by no more than eps_v times the time; the method says so."""
    at = point(name)
    sol = at.run(stick_velocity="kept")
    assert sequence(sol) == at.sequence
    sticks = [m for m in sol.modes["f"] if m.mode == "stick" and m.t0 > 0]
    creep = []
    for stick in sticks:
        inside = np.linspace(stick.t0, stick.t1, 7)[1:-1]
        x, v = sol(inside)
        assert (np.abs(v) <= 8e-4).all()
        creep.append(abs(x[-1] - x[0]))
        assert creep[-1] <= 8e-4 * (inside[-1] - inside[0]) * (1 + 1e-9)
    assert len(sticks) >= 199
    assert min(creep) > 0.0
    assert max(creep) > 1e-4 * at.amplitude, "small, and not rounding"
    assert "exact-stick" in next(i for i in hs.list_integrators() if i.name == "rk4-dichotomy").lacks


@pytest.mark.parametrize("name", ["P1", "P2"])
def test_with_v_kept_the_answer_is_worse_than_with_v_zeroed(name: str) -> None:
    at = point(name)
    kept, zeroed = (at.errors(at.run(stick_velocity=choice))[0] for choice in ("kept", "zero"))
    assert kept > 100 * zeroed


@pytest.mark.parametrize("eps", [8e-4, 8e-6])
def test_the_velocity_at_an_event_is_within_the_interval(eps: float) -> None:
    at = point("P1")
    sol = at.run(stick_velocity="kept", eps_v=eps, max_bisections=60, periods=20)
    stops = [e for e in sol.events if e.target == "stick"]
    assert len(stops) >= 39
    assert all(abs(e.x_plus[1]) <= eps for e in stops)


# -- rk4-sign ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["P1", "P2"])
def test_without_stick_the_amplitude_is_off_and_comes_nearer_as_the_step_shrinks(name: str) -> None:
    at, off, errors = point(name), [], []
    for steps in (300, 1200, 4800):
        sol = at.run("rk4-sign", steps_per_period=steps)
        x = sol(at.times)[0]
        off.append(abs((x.max() - x.min()) / 2 / at.amplitude - 1))
        errors.append(np.abs(x - at.x).max() / at.amplitude)
    assert off[0] > 3 * off[1] > 9 * off[2]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert off[0] > 1e-2


def test_without_stick_the_velocity_chatters_where_the_body_should_stick() -> None:
    """Changes of sign inside the exact stick phases of P2: the finer the step, the more of them."""
    at, counts = point("P2"), []
    for steps in (300, 1200, 4800):
        sol = at.run("rk4-sign", periods=20, steps_per_period=steps)
        v = sol.y[1]
        inside = np.array([at.motion.state(t)[2] == 0 for t in sol.t[1:]])
        counts.append(int(np.sum((v[1:] * v[:-1] < 0) & inside)))
    assert counts[0] > 80
    assert counts[2] > 3 * counts[1] > 9 * counts[0]


# -- exact stick ------------------------------------------------------------------------------------------------


def check_exact_stick(name: str, integrator: str, periods: int, **options: object) -> int:
    """In every stick phase v is 0.0 and x keeps every bit; returns how many phases there were.

    Call it with periods=1000 for any integrator: some ten seconds for the compiled ones, minutes for the others.
    """
    at = point(name)
    sol = at.run(integrator, periods=periods, **options)
    assert sol.status == "finished"
    sticks = [m for m in sol.modes["f"] if m.mode == "stick"]
    shares = np.linspace(0.0, 1.0, 9)[1:-1]
    times = np.concatenate([stick.t0 + shares * (stick.t1 - stick.t0) for stick in sticks])
    x, v = sol(times)
    assert (v == 0.0).all()
    x = x.reshape(len(sticks), -1)
    assert (x == x[:, :1]).all()
    for stick, held in zip(sticks, x[:, 0], strict=True):
        assert stick.t1 > stick.t0
        assert sol(stick.t0)[0] == held
        assert sol(stick.t1, side="-")[0] == held
    for event in sol.events:
        if "stick" in (event.source, event.target):
            assert event.x_plus[1] == 0.0
    return len(sticks)


EXACT = [one.name for one in hs.list_integrators() if not {"exact-stick", "adaptive"} & set(one.lacks)]


def test_most_integrators_stick_exactly() -> None:
    assert {"dop853", "scipy-dop853", "scipy-rk45", "cvode-bdf", "cvode-adams"} <= set(EXACT)


@pytest.mark.parametrize("name", ["P1", "P2"])
@pytest.mark.parametrize("integrator", EXACT)
def test_stick_is_exact(integrator: str, name: str) -> None:
    assert check_exact_stick(name, integrator, periods=20, rtol=1e-7) >= 40


@pytest.mark.parametrize("release", ["step", "located"])
@pytest.mark.parametrize("name", ["P1", "P2"])
def test_stick_with_v_zeroed_is_exact_over_a_thousand_periods(name: str, release: str) -> None:
    options = {"stick_velocity": "zero", "release": release}
    assert check_exact_stick(name, "rk4-dichotomy", periods=1000, **options) >= 2000


def test_stick_on_a_belt_is_the_speed_of_the_belt() -> None:
    """Bit for bit, at every stick of the limit cycle."""
    for integrator in (
        one.name
        for one in hs.list_integrators()
        if not {"exact-stick", "nonlinear", "adaptive"} & set(one.lacks)
    ):
        sol = hs.simulate("belt", (0.0, 60.0), integrator=integrator, rtol=1e-7)
        speed = sol.model.parameter_values()["v_belt"]
        sticks = [m for m in sol.modes["f"] if m.mode == "stick"]
        assert len(sticks) >= 4
        for stick in sticks:
            assert (sol(np.linspace(stick.t0, stick.t1, 9)[:-1])[1] == speed).all()
