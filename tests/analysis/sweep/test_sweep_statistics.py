"""Statistics of runs and of steady states are those of closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs

RATIO, SPEED = 0.1, 1.5


def decaying() -> hs.Model:
    """Return a damped oscillator that starts from x = 1 at rest."""
    return hs.Model(
        "decaying",
        parameters={"zeta": RATIO, "gap": 0.2},
        states=[hs.State("x", 1.0, "v"), hs.State("v", 0.0, "-x - 2*zeta*v")],
        outputs=[hs.Output("square", "x**2")],
    )


def thrown() -> hs.Model:
    """Return a block of 2 kg that slides to rest with a deceleration of 3."""
    return hs.Model(
        "thrown",
        parameters={"mu": 0.3},
        states=[hs.State("x", 0.0, "v", unit="m"), hs.State("v", SPEED, "-f/2", unit="m/s")],
        contacts=[hs.Contact("f", velocity="v", normal=20, law="coulomb", arguments={"mu": "mu"})],
    )


def forced(zeta: float) -> hs.Model:
    """Return a forced oscillator without friction, with m = k = F = 1."""
    return hs.Model(
        "forced",
        parameters={"w": 0.8, "zeta": zeta},
        states=[hs.State("x", 0.0, "v"), hs.State("v", 0.0, "sin(w*t) - x - 2*zeta*v")],
    )


def one(model: hs.Model, readings: list[str], **options: object) -> dict[str, float]:
    """Return the readings of a sweep with one point."""
    found = hs.sweep(model, {model.parameters[0].name: [model.parameters[0].value]}, readings, **options)
    assert not found.failed.any(), found.status
    return {name: float(values[0]) for name, values in found.values.items()}


def test_extremes_of_a_run_are_those_of_the_continuous_motion() -> None:
    """The output x**2 is largest at the start, and x is least after half a period of the damped motion."""
    least = -math.exp(-math.pi * RATIO / math.sqrt(1.0 - RATIO**2))
    readings = ["minimum.x", "maximum.x", "peak.x", "amplitude.x", "minimum.square", "maximum.square"]
    found = one(decaying(), readings, t_span=(0, 20))
    assert found["minimum.x"] == pytest.approx(least, abs=1e-9)
    assert found["amplitude.x"] == pytest.approx(0.5 * (1.0 - least), abs=1e-9)
    largest = [found["maximum.x"], found["peak.x"], found["maximum.square"]]
    assert largest == pytest.approx([1.0, 1.0, 1.0], abs=1e-12)
    assert found["minimum.square"] == pytest.approx(0.0, abs=1e-12)


def test_mean_and_mean_square_of_a_run() -> None:
    """x = exp(-z t) (cos d t + z/d sin d t) has its integral in closed form: x = -(x'' + 2 z x')."""
    end = 7.0
    d = math.sqrt(1.0 - RATIO**2)
    decay = math.exp(-RATIO * end)
    x, v = decay * (math.cos(d * end) + RATIO / d * math.sin(d * end)), -decay / d * math.sin(d * end)
    mean = -(v + 2.0 * RATIO * (x - 1.0)) / end
    # x^2 = (v^2 + 2 z x v)' - ... : from (x v)' = v^2 - x^2 - 2 z x v and (x^2 + v^2)' = -4 z v^2
    of_v = (1.0 - x * x - v * v) / (4.0 * RATIO)
    of_x = of_v - x * v - RATIO * (x * x - 1.0)
    found = one(decaying(), ["mean.x", "rms.x", "rms.v", "energy.x"], t_span=(0, end))
    assert found["mean.x"] == pytest.approx(mean, rel=1e-8)
    assert found["energy.x"] == pytest.approx(of_x, rel=1e-8)
    assert found["rms.x"] == pytest.approx(math.sqrt(of_x / end), rel=1e-8)
    assert found["rms.v"] == pytest.approx(math.sqrt(of_v / end), rel=1e-8)


def test_a_block_that_slides_to_rest() -> None:
    """It stops after half a second and 0.375 m, and friction takes all its energy."""
    stopped = SPEED / 3.0
    readings = ["stops.f", "dissipated.f", "stick_fraction.f", "final.x", "first_passage.x>0.3"]
    readings += ["first_passage.x>1.5*mu", "first_passage.v<0.5", "first_passage.f<3", "first_passage.x<-1"]
    readings += ["mode_fraction.f.slip+", "mode_fraction.f.slip-", "mode_fraction.f.stick"]
    found = one(thrown(), readings, t_span=(0, 2))
    assert found["stops.f"] == 1.0
    assert found["dissipated.f"] == pytest.approx(SPEED**2, rel=1e-9)
    assert found["stick_fraction.f"] == found["mode_fraction.f.stick"]
    assert found["mode_fraction.f.stick"] == pytest.approx(1.0 - stopped / 2.0, rel=1e-12)
    assert found["mode_fraction.f.slip+"] == pytest.approx(stopped / 2.0, rel=1e-12)
    assert found["mode_fraction.f.slip-"] == 0.0
    assert found["final.x"] == pytest.approx(0.375, rel=1e-12)
    assert found["first_passage.x>0.3"] == pytest.approx((SPEED - math.sqrt(SPEED**2 - 1.8)) / 3.0, rel=1e-11)
    assert found["first_passage.x>1.5*mu"] == math.inf  # it comes to rest before 0.45 m
    assert found["first_passage.x<-1"] == math.inf
    assert found["first_passage.v<0.5"] == pytest.approx(1.0 / 3.0, rel=1e-11)
    assert found["first_passage.f<3"] == pytest.approx(stopped, rel=1e-11)  # the force jumps to zero


def test_a_passage_shorter_than_any_step_is_found() -> None:
    """One level lies 1e-7 below the first maximum of x, and the other one as much above it."""
    d = math.sqrt(1.0 - RATIO**2)
    model = decaying().with_start(x=-1.0)  # its maximum is after half a period
    first = math.exp(-math.pi * RATIO / d)
    found = one(
        model, [f"first_passage.x>{first - 1e-7}", f"first_passage.x>{first + 1e-7}", "first_passage.x>-2"],
        t_span=(1, 21),
    )  # fmt: skip
    before = math.sqrt(2.0 * 1e-7 / first)  # x'' = -x at the maximum
    below, above, at_once = found.values()
    assert below == pytest.approx(1.0 + math.pi / d - before, abs=1e-6)
    assert (above, at_once) == (math.inf, 1.0)


def test_a_touch_of_a_level_is_no_passage() -> None:
    """A bouncing ball does not pass its floor, and a motion from rest at x = 1 stays below 1, with v < 0 at first."""
    ball = hs.Model(
        "ball",
        parameters={"g": 9.81},
        states=[hs.State("h", 1.0, "w"), hs.State("w", 0.0, "-g + N")],
        impacts=[hs.Impact("N", "h", restitution=0.5)],
    )
    found = one(ball, ["first_passage.h<0", "first_passage.w>2"], t_span=(5, 8))
    assert found["first_passage.h<0"] == math.inf
    assert found["first_passage.w>2"] == pytest.approx(5.0 + math.sqrt(2.0 / 9.81), rel=1e-9)
    hit = hs.Guard("hit", "h", hs.Choice("fly", reset={"w": "-0.6*w"}))
    bounces = hs.Component(
        "bounces",
        [hs.Mode("fly", hit), hs.Mode("rest", der={"h": 0, "w": 0})],
        initial="fly",
        limit="rest",  # h is there -3e-14
    )
    states = [hs.State("h", 0.8, "w"), hs.State("w", 0.0, "-g")]
    resting = hs.Model("resting", parameters={"g": 10.0}, states=states, components=[bounces])
    assert one(resting, ["first_passage.h<0"], t_span=(0, 4)) == {"first_passage.h<0": math.inf}
    half = math.pi / math.sqrt(1.0 - RATIO**2)
    for integrator in ("exact", "taylor", "tsit5"):
        passages = ["first_passage.x>1", "first_passage.v>0"]
        above, upward = one(decaying(), passages, t_span=(0, 10), integrator=integrator).values()
        assert above == math.inf
        assert upward == pytest.approx(half, rel=1e-7)


def test_a_warm_start_continues_discrete_states_and_modes() -> None:
    """x rises from 1/4 to 1 again and again, in two modes by turns, and n counts; three runs of 5/4 are one of 15/4."""
    count = {"x": 0.25, "n": "n + 1"}
    up = hs.Mode("up", hs.Guard("top", "1 - x", hs.Choice("down", reset=count)))
    down = hs.Mode("down", hs.Guard("top", "1 - x", hs.Choice("up", reset=count)))
    model = hs.Model(
        "counter",
        parameters={"rate": 1.0},
        states=[hs.State("x", 0.25, "rate")],
        discrete=[hs.Discrete("n", 0.0)],
        components=[hs.Component("side", [up, down], initial="up")],
        outputs=[hs.Output("count", "n")],
    )
    found = hs.sweep(
        model,
        {"rate": [1.0] * 3},
        ["final.x", "mean.count", "mode_fraction.side.up"],
        t_span=(0, 1.25),
        warm_start=True,
    )
    assert found["final.x"] == pytest.approx(
        [0.75, 0.5, 0.25], rel=1e-12
    )  # the last one after the reset at 15/4
    # resets at 3/4, 3/2, 9/4, 3 and 15/4
    assert found["mean.count"] == pytest.approx(
        [0.5 / 1.25, (0.25 + 1.5 + 0.75) / 1.25, (1.5 + 3.0) / 1.25], rel=1e-9
    )
    assert found["mode_fraction.side.up"] == pytest.approx([0.6, 0.6, 0.6], rel=1e-9)


def test_final_states_and_statistics_belong_to_one_run() -> None:
    """A chain of warm starts goes on from the last states."""
    found = hs.sweep(thrown(), {"mu": [0.3, 0.3]}, ["final.x", "maximum.v"], t_span=(0, 0.2), warm_start=True)
    assert found["maximum.v"] == pytest.approx([SPEED, SPEED - 0.6], rel=1e-9)
    assert found["final.x"][1] == pytest.approx(SPEED * 0.4 - 1.5 * 0.16, rel=1e-9)
    assert found.units["maximum.v"] == "m/s"


@pytest.mark.parametrize("after", [None, 40])
def test_a_linear_oscillator_has_the_mean_square_of_a_sine(after: int | None) -> None:
    """Compiled code measures all points, of steady states and of periods after a number of periods."""
    ratios = [0.3, 0.8, 2.0]
    options = {} if after is None else {"after": after}
    found = hs.sweep(forced(0.2), {"w": ratios}, ["rms.x", "mean.x"], **options)
    assert found.one_by_one == 0 and not found.failed.any()
    amplitudes = [1.0 / math.hypot(1.0 - r * r, 0.4 * r) for r in ratios]
    assert found["rms.x"] == pytest.approx(np.array(amplitudes) / math.sqrt(2.0), rel=1e-7)
    assert found["mean.x"] == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("after", [None, 60])
def test_times_in_modes_are_the_same_by_both_ways(after: int | None) -> None:
    """A symmetric motion slides equally long in both directions; all modes together take the period."""
    modes = [f"mode_fraction.f.{mode}" for mode in ("slip+", "slip-", "stick")]
    options = {} if after is None else {"after": after}
    found = hs.sweep("dfcs", {"F0": [22.0, 30.0, 60.0]}, [*modes, "stick_fraction.f", "rms.v"], **options)
    assert found.one_by_one == 0
    up, down, stuck = (found[name] for name in modes)
    assert up == pytest.approx(down, rel=1e-5) and up + down + stuck == pytest.approx(1.0, rel=1e-12)
    assert stuck == pytest.approx(found["stick_fraction.f"], rel=1e-12) and (stuck[:2] > 0.0).all()
    general = hs.sweep("dfcs", {"F0": [22.0]}, [*modes, "rms.v"], integrator="dop853", **options)
    assert general.one_by_one == 1
    for name in (*modes, "rms.v"):
        assert general[name][0] == pytest.approx(found[name][0], rel=1e-6)
    steady = hs.steady_state("dfcs", params={"F0": 22.0})
    assert steady.mode_fraction["f.stick"] == pytest.approx(steady.stick_fraction["f"], rel=1e-12)
    assert after or steady.rms["v"] == found["rms.v"][0]


def test_a_state_that_rests_spends_all_its_time_in_stick() -> None:
    found = hs.sweep("dfcs", {"F0": [5.0]}, ["mode_fraction.f.stick", "mode_fraction.f.slip+", "rms.x"])
    assert [float(values[0]) for values in found.values.values()] == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "reading, message",
    [
        ("first_passage.x>", "no measure 'first_passage.x>' of a run"),
        ("first_passage.y>1", "no measure 'first_passage.y>1' of a run"),
        ("first_passage.x>q", "'q'"),
        ("mode_fraction.f.slip", r"did you mean 'mode_fraction\.f\.slip"),
        ("harmonic.x.1", "no measure 'harmonic.x.1' of a run"),
        ("period", "no measure 'period' of a run"),
    ],
)
def test_a_reading_that_a_run_does_not_have(reading: str, message: str) -> None:
    with pytest.raises(hs.HybridsimError, match=message):
        hs.sweep(thrown(), {"mu": [0.3]}, [reading], t_span=(0, 1))


@pytest.mark.parametrize("reading", ["first_passage.x>1", "stops.f", "final.x"])
def test_a_reading_of_a_run_needs_its_time_span(reading: str) -> None:
    with pytest.raises(hs.UsageError, match="needs `t_span`"):
        hs.sweep(thrown(), {"mu": [0.3]}, ["maximum.x", reading])


@pytest.mark.parametrize("name", ["keep", "save"])
@pytest.mark.parametrize("part", ["nothing", "events", "last-period", 1.0])
def test_readings_need_the_whole_run(name: str, part: str | float) -> None:
    """The first passage and the maximum of the last part of a run are not those of the run."""
    with pytest.raises(hs.UsageError, match=f"`{name}` is {part!r}, but only 'final'"):
        hs.sweep(decaying(), {"gap": [0.2]}, ["maximum.x"], t_span=(0, 20), **{name: part})
    assert math.isfinite(one(decaying(), ["final.x"], t_span=(0, 20), keep="events")["final.x"])


def test_a_run_backward_in_time_has_only_final_states() -> None:
    """A run of x' = -x backward in time from t = 1 to t = 0 ends at x = e."""
    model = hs.Model("falling", parameters={"k": 1.0}, states=[hs.State("x", 1.0, "-k*x")])
    assert one(model, ["final.x"], t_span=(1, 0))["final.x"] == pytest.approx(math.e, rel=1e-9)
    found = hs.sweep(model, {"k": [1.0]}, ["maximum.x"], t_span=(1, 0))
    assert "does not run forward in time" in found.status[0]
