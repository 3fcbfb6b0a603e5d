"""The compiled mode loop of Runge-Kutta methods: its parts against closed forms, runs against the general way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs
from hybridsim.engine.record.hermite import bernstein_weights, fit_all, hermite, right_system, shift_matrix
from hybridsim.engine.roots.dense_guards import stays_positive
from hybridsim.engine.run import compiled_loop, mode_loop
from hybridsim.integrators.registry import integrator_class
from hybridsim.integrators.runge_kutta.dop853 import Dop853
from hybridsim.integrators.runge_kutta.segments import first_length
from hybridsim.integrators.step_control import forget, next_length
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.measuring import load
from hybridsim.testing.scene import Scene

METHODS = ("dop853", "tsit5")
PERIOD = 2 * math.pi / hs.load("dfcs").parameter_values()["omega"]
# How many crossings of `twisting` are told apart before their limit is chance; `long-swing` is seen at zeros of
# v alone, which have no scale. Both are judged by their truths, as all scenes are.
# In `touch-beside-a-sample` a guard comes to zero at a peak and turns: within the tolerance either is right, and the
# next samples follow from it. The states, which no sample moves, agree to 3e-12 of their size.
APART = ("twisting", "long-swing", "touch-beside-a-sample")
SAME_TO_ROUNDING = [s for s in SCENES if "stiff" not in s.needs and s.name not in APART]
WEIGHTS = bernstein_weights(4)
PERIODS, ENDLESS = 20.0, 1e6  # units of time: what is compared of a long scene, and what only an event ends


def compared(scene: Scene) -> tuple[float, float]:
    """The first periods of a scene: later events repeat them, and conformance tests judge the whole scene."""
    first, last = scene.span
    is_cut = PERIODS < abs(last - first) / scene.unit < ENDLESS
    return first, first + math.copysign(PERIODS * scene.unit, last - first) if is_cut else last


def still(guard: str) -> hs.Model:
    """x = t, watched by a guard."""
    return hs.Model(
        "still",
        states=[hs.State("x", 0, "1")],
        components=[
            hs.Component(
                "c", modes=[hs.Mode("a", guards=[hs.Guard("g", guard, then="b")]), hs.Mode("b")], initial="a"
            )
        ],
    )


def ends(a: np.ndarray, d: float) -> tuple[np.ndarray, np.ndarray]:
    """Four Taylor coefficients of a polynomial at 0 and at d."""
    right = [sum(math.comb(j, k) * a[j] * d ** (j - k) for j in range(k, len(a))) for k in range(4)]
    return a[:4].copy(), np.array(right)


def test_what_is_called_positive_is() -> None:
    """Random polynomials of degree 7, sampled densely; the test may fail to see it, but not often far from zero."""
    draw = np.random.default_rng(3)
    seen = missed = 0
    for _ in range(2000):
        a, d, order = draw.normal(size=8), draw.uniform(0.1, 2), int(draw.integers(3))
        a[:order], a[order] = 0.0, draw.uniform(0, 30)
        inside = np.linspace(0, d, 401)[1:]
        low = (np.polynomial.polynomial.polyval(inside, a) / inside**order).min()
        left, right = ends(a, d)
        left[:order] = 1e-17 * draw.normal(size=order)  # zero by decree, whatever rounding made of it
        if stays_positive(left, right, order, 0.0, d, WEIGHTS):
            assert low > 0
            seen += 1
        else:
            missed += low > 2
    assert seen > 5 * missed


def test_all_steps_at_once_and_one_by_one() -> None:
    draw = np.random.default_rng(4)
    steps, series = np.array([[0.5, 0.25], [0.75, 2.0]]), draw.normal(size=(2, 3, 8))
    out = np.empty_like(series)
    fit_all(steps, series, shift_matrix(4), right_system(4), out)
    for (start, length), both, found in zip(steps, series, out, strict=True):
        d = np.linspace(0, length, 7)
        expected = hermite(start, start + length, both[:, :4], both[:, 4:])(start + d)
        values = np.polynomial.polynomial.polyval(d, found.T).T
        assert values == pytest.approx(expected, abs=1e-10)


def test_first_estimate_of_dop853() -> None:
    """On x' = x the estimates are polynomials in h, found here by running the stages; the first length meets them."""

    def estimate(h: float, e: np.ndarray) -> float:
        k: list[float] = []
        for row in Dop853.tableau.a:
            k.append(1.0 + h * sum(w * slope for w, slope in zip(row, k, strict=False)))
        return abs(h * sum(w * slope for w, slope in zip(e, k, strict=True)))

    q, c, c_next, q_low, c_low = Dop853.tableau.leading_terms
    assert (q, q_low) == (6, 4)
    h = 1e-2
    main = estimate(h, Dop853.tableau.e)
    assert main == pytest.approx(h**q * (c / math.factorial(q)), rel=0.1)
    low = estimate(h, Dop853.tableau.e_low)
    assert low == pytest.approx(h**q_low * c_low / math.factorial(q_low), rel=0.1)
    V = np.array([[1 / math.factorial(k) for k in range(q + 2)]])
    control = (1e-9, np.zeros(1))
    h = first_length((q, c, c_next, q_low, c_low), np.ones(1), control, V, 9.0)
    main, low = estimate(h, Dop853.tableau.e), estimate(h, Dop853.tableau.e_low)
    assert 0.2 < main**2 / math.hypot(main, 0.1 * low) / (1e-9 * math.exp(h)) <= 1.0


def test_steps_that_shrink_are_foreseen() -> None:
    memory = np.empty(3)
    forget(memory)
    first = next_length(1.0, 0.5, 8, memory)
    assert first == pytest.approx(0.9 * 0.5 ** (-1 / 8))
    steady = next_length(first, 0.5, 8, memory)
    growing = next_length(steady, 0.9, 8, memory)
    assert steady == pytest.approx(first * first * first)
    assert growing < 0.9 * 0.9 ** (-1 / 8) * steady
    assert next_length(1.0, 100.0, 8, memory) == pytest.approx(0.9 * 100 ** (-1 / 8))
    assert next_length(0.5, 1e-8, 8, memory) == 0.5  # not longer right after a rejected step
    assert next_length(0.5, 1e-8, 8, memory) > 0.5
    assert next_length(1.0, math.nan, 8, memory) == 0.2


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", SAME_TO_ROUNDING, ids=lambda scene: scene.name)
def test_the_compiled_loop_and_the_general_way(
    scene: Scene, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same events to the order, times and states to the tolerance."""
    settings = {"params": dict(scene.params), "x0": dict(scene.start), "rtol": 1e-10, **scene.options}
    span = compared(scene)
    kernel_run = hs.simulate(load(scene), span, integrator=method, **settings)
    with monkeypatch.context() as patch:
        patch.setattr(integrator_class(method), "has_compiled_loop", False)
        stepped = hs.simulate(load(scene), span, integrator=method, **settings)
    assert kernel_run.status == stepped.status
    assert [(e.kind, e.component, e.guard, e.source, e.target) for e in kernel_run.events] == [
        (e.kind, e.component, e.guard, e.source, e.target) for e in stepped.events
    ]
    times = [[e.t for e in sol.events] for sol in (kernel_run, stepped)]
    assert times[0] == pytest.approx(times[1], rel=1e-8, abs=1e-8 * scene.unit)
    grid = np.linspace(*sorted((span[0], min(kernel_run.t_end, stepped.t_end))), 201)
    # closer to an event than times are compared, an instant may be before it in one run and behind it in the other;
    # and the potential of `exponential-neuron` rises there by 2e10 per unit of time
    near = 1e-8 * max(scene.unit, *map(abs, span))
    grid = grid[[all(abs(t - at) > near for at in times[0]) for t in grid]]
    size = np.max(np.abs(stepped(grid)), axis=1, initial=0.0)[:, None]
    assert np.max(np.abs(kernel_run(grid) - stepped(grid)) / (size + 1e-300), initial=0.0) < 1e-6
    assert [i.mode for c in kernel_run.modes.values() for i in c] == [
        i.mode for c in stepped.modes.values() for i in c
    ]


@pytest.mark.parametrize("method", METHODS)
def test_the_reference_model_is_one_compiled_call(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """401 events in a hundred periods, not one by the general way; their times are those of the closed form."""
    taken = []
    segment_run = mode_loop.SegmentRun
    monkeypatch.setattr(mode_loop, "SegmentRun", lambda *args: taken.append(args) or segment_run(*args))
    sol = hs.simulate("dfcs", (0, 100 * PERIOD), integrator=method, rtol=1e-9)
    assert not taken
    p = hs.load("dfcs").parameter_values()
    limit = p["mu"] * p["N"]
    motion = Oscillator(p["m"], p["c"], p["k"], limit, limit, p["F0"], p["omega"]).run(0, 100 * PERIOD, 0)
    assert len(sol.events) == len(motion.changes) == 401
    error = max(abs(e.t - c.t) for e, c in zip(sol.events, motion.changes, strict=True))
    assert error < 1e-9 * PERIOD
    times = np.linspace(0.1, 99.9, 999) * PERIOD  # between the steps, too
    truth = np.array([motion.state(t)[:2] for t in times]).T
    assert np.max(np.abs(sol(times) - truth) / np.abs(truth).max(axis=1)[:, None]) < 1e-8


@pytest.mark.parametrize("method", METHODS)
def test_steps_of_a_given_length(method: str) -> None:
    sol = hs.simulate("dfcs", (0, 2 * PERIOD), integrator=method, rtol=1e-6, max_step=PERIOD / 100)
    assert max(np.diff(sol.t)) <= PERIOD / 100 * (1 + 1e-12)
    first = hs.simulate("dfcs", (0, 2 * PERIOD), integrator=method, rtol=1e-6, first_step=PERIOD / 1000)
    assert first.t[1] == pytest.approx(PERIOD / 1000, rel=1e-12)
    assert len(sol.events) == len(first.events) == 9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("guard", "time"),
    [
        ("0.5 - tanh(50*(x - 1))", 1 + math.atanh(0.5) / 50),
        ("1 - exp(1000*(x - 5))", 5.0),
        ("2 - x**50", 2 ** (1 / 50)),
        ("1/(1 + x**12) - 0.01", 99 ** (1 / 12)),
        ("cos(x**8) + 0.5", (2 * math.pi / 3) ** 0.125),
    ],
)
def test_guards_whose_series_say_nothing_of_what_comes(guard: str, time: float, method: str) -> None:
    """The flow is solved in one step, and the guard looked at all along it: stretch by stretch."""
    model = still(guard)
    sol = hs.simulate(model, (0, 8), integrator=method, rtol=1e-9)
    assert [event.t for event in sol.events] == pytest.approx([time], rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_dips_within_one_step(method: str) -> None:
    """Fifty minima of a guard inside one step of the flow: above zero nothing happens, below the first one counts."""
    for lowest, expected in ((1e-4, []), (-1e-4, [(1.5 * math.pi - math.acos(1 - 1e-4)) / 40])):
        model = still(f"sin(40*x) + 1 + {lowest}")
        sol = hs.simulate(model, (0, 8), integrator=method, rtol=1e-9)
        assert [event.t for event in sol.events] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_a_segment_of_more_steps_than_there_is_room_for(
    integrator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop commits it in pieces, each in a block of its own, and goes on with the length of step it had."""
    states = [hs.State("x", 1, "v"), hs.State("v", 0, "-x*(1 + 0.1*x**2)")]
    whole = hs.simulate(hs.Model("whole", states=states), (0, 200), integrator=integrator, rtol=1e-12)
    monkeypatch.setattr(
        compiled_loop, "_CALL_DOUBLES", 0
    )  # for loops that are made from now on: a known model keeps its own
    cramped = hs.simulate(hs.Model("cramped", states=states), (0, 200), integrator=integrator, rtol=1e-12)
    assert cramped.stats["steps"] == pytest.approx(whole.stats["steps"], rel=0.02)
    assert cramped(200.0) == pytest.approx(whole(200.0), abs=1e-9)
    kinds = {type(b).__name__ for b in cramped._of_model.record.segments.blocks}
    assert kinds in ({"SeriesBlock"}, {"HermiteBlock"})
    assert (
        len(cramped._of_model.record.segments.blocks)
        >= whole.stats["steps"] // compiled_loop.MIN_STEPS_IN_PART
    )


@pytest.mark.parametrize("method", METHODS)
def test_landings_on_events_are_accepted_while_contacts_between_moving_bodies_hold(method: str) -> None:
    """The velocity of a body that sticks to a moving one is no state of its own; its stored value is not compared."""
    drifts = ("v1", "(v2 - v1)", "(v3 - v2)")
    force = [f"40*({drift.replace('v', 'x')}) + f{i}" for i, drift in enumerate(drifts, 1)] + ["0"]
    rates = [f"{force[i + 1]} - ({force[i]}) + 8*sin(2*t)" for i in range(3)]
    tower = hs.Model(
        "tower",
        states=[hs.State(f"x{i}", 0, f"v{i}") for i in (1, 2, 3)]
        + [hs.State(f"v{i}", 0, rate) for i, rate in enumerate(rates, 1)],
        contacts=[
            hs.Contact(f"f{i}", drift, "1", "coulomb", {"mu": mu})
            for i, (drift, mu) in enumerate(zip(drifts, (3.0, 9.0, 6.0), strict=True), 1)
        ],
    )
    sol = hs.simulate(tower, (0, 20), integrator=method, rtol=1e-6)
    assert sol.status == "finished" and len(sol.events) > 20
    assert sol.stats["rejected"] < sol.stats["steps"]
