"""Several things at one instant, runs cut in two, values between the steps: what went wrong once stays right."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import ModelError

LOCATING = ("dop853", "exact", "taylor", "scipy-dop853", "scipy-rk45", "cvode-adams", "cvode-bdf")


def model(text: str) -> hs.Model:
    return hs.Model.from_toml('schema = 1\nname = "scene"\n' + text)


RISING = '[states]\nx = { start = 0, der = "1" }\n'


@pytest.mark.parametrize("integrator", LOCATING)
@pytest.mark.parametrize(
    ("text", "end", "expected"),
    [
        # a scheduled kick carries x from 1 to 2, over the monitor at 1.5, which sends it to 0: then 0.2 s at rate 1
        (
            RISING + '[monitors.a]\nexpr = "x - 1.5"\naction = "reset"\nreset = { x = "0" }\n'
            '[schedules.k]\ntimes = [1]\nreset = { x = "x + 1" }\n',
            1.2,
            0.2,
        ),
        # a guard and a monitor at one instant
        (
            RISING + '[modes.a]\ninitial = true\nguards.g = { expr = "1 - x", then = "b" }\n[modes.b]\n'
            '[monitors.m]\nexpr = "x - 1"\naction = "reset"\nreset = { x = "0" }\n',
            1.2,
            0.2,
        ),
        # two monitors at one instant
        (
            RISING
            + '[discrete]\nn = 0\n[monitors.a]\nexpr = "x - 1"\naction = "reset"\nreset = { n = "n + 1" }\n'
            '[monitors.b]\nexpr = "2*x - 2"\naction = "reset"\nreset = { x = "0" }\n',
            1.5,
            0.5,
        ),
    ],
)
def test_every_reset_that_is_due_is_applied(integrator: str, text: str, end: float, expected: float) -> None:
    sol = hs.simulate(model(text), (0, end), integrator=integrator)
    assert sol(end)[0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("integrator", LOCATING)
def test_a_stop_and_a_monitor_at_one_instant(integrator: str) -> None:
    text = (
        '[states]\nx = { start = 0, der = "v" }\nv = { start = 1, der = "-f" }\n[discrete]\nn = 0\n'
        '[contacts.f]\nvelocity = "v"\nnormal = "1"\nlaw = { name = "coulomb", mu = 1 }\n'
        '[monitors.m]\nexpr = "t - 1"\naction = "reset"\nreset = { n = "n + 100" }\n'
    )
    sol = hs.simulate(model(text), (0, 2), integrator=integrator)
    assert sol.output("n", 2.0) == 100.0
    assert [i.mode for i in sol.modes["f"]] == ["slip+", "stick"]


@pytest.mark.parametrize("order", ["gh", "hg"])
def test_two_guards_that_lead_apart_at_once_are_refused_in_any_order(order: str) -> None:
    guards = {
        "g": 'guards.g = { expr = "1 - x", then = "b" }\n',
        "h": 'guards.h = { expr = "2 - 2*x", then = "c" }\n',
    }
    text = (
        RISING + "[modes.a]\ninitial = true\n" + "".join(guards[k] for k in order) + "[modes.b]\n[modes.c]\n"
    )
    sol = hs.simulate(model(text), (0, 2))
    assert sol.status == "nonunique" and not sol.success
    assert "g" in sol.message and "h" in sol.message


def test_a_clock_ticks_as_often_in_a_run_cut_in_two() -> None:
    clock = model('[discrete]\nd = 0\n[clocks.a]\nperiod = 0.1\nset = { d = "d + 1" }\n')
    whole = hs.simulate(clock, (0, 1)).output("d", 1.0)
    first = hs.simulate(clock, (0, 0.3)).output("d", 0.3)
    second = hs.simulate(clock, (0.3, 1), x0={"d": float(first)}).output("d", 1.0)
    assert (whole, second) == (11.0, 11.0)


def test_the_end_that_was_asked_for_is_the_end() -> None:
    t0, t1 = -30.2832280457318, -0.6726464242954862
    text = (
        '[states]\nx = { start = 0, der = "v" }\nv = { start = 0, der = "2*sin(t) - x - f" }\n'
        '[contacts.f]\nvelocity = "v"\nnormal = "1"\nlaw = { name = "coulomb", mu = 1 }\n'
    )
    sol = hs.simulate(model(text), (t0, t1), rtol=1e-6, t_eval=[t0, t1])
    assert sol.t.tolist() == [t0, t1]
    assert np.isfinite(sol(t1)).all()


@pytest.mark.parametrize("integrator", LOCATING)
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-8, 1e-10])
def test_between_the_steps_a_ball_stays_between_floor_and_start(integrator: str, rtol: float) -> None:
    sol = hs.simulate("bouncing-ball", (0, 3), integrator=integrator, rtol=rtol)
    height = sol(np.linspace(0, 3, 2001))[0]
    assert height.min() > -10 * rtol
    assert height.max() <= 1 + 10 * rtol


def test_a_jump_through_zero_is_seen_where_it_is() -> None:
    sol = hs.simulate(model(RISING + '[monitors.a]\nexpr = "atan2(sin(x), cos(x))"\n'), (0, 7))
    assert [e.t for e in sol.events] == pytest.approx([np.pi, 2 * np.pi], abs=1e-9)


def test_a_fired_guard_is_zero_where_it_fired() -> None:
    text = (
        '[states]\nx = { start = 0, der = "y" }\ny = { start = 1, der = "-x" }\n'
        '[modes.lo]\ninitial = true\nguards.g = { expr = "1 - x", then = "hi" }\n[modes.hi]\n'
    )
    for rtol in (1e-3, 1e-6, 1e-9):
        sol = hs.simulate(model(text), (0, 100), integrator="scipy-dop853", rtol=rtol)
        for event in sol.events:
            if event.kind == "transition":
                assert abs(1 - event.x_minus[0]) < 1e-12


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign", *LOCATING])
def test_a_wall_whose_reset_leaves_the_position_alone(integrator: str) -> None:
    """Between walls at 0 and 1, from 0.5 with speed 3 and restitution 0.9: hits at 1/6, then every 1/(3*0.9^k)."""
    text = (
        '[states]\nx = { start = 0.5, der = "u" }\nu = { start = 3, der = "0" }\n[modes.fly]\ninitial = true\n'
        'guards.right = { expr = "1 - x", then = { to = "fly", reset = { u = "-0.9*u" } } }\n'
        'guards.left = { expr = "x", then = { to = "fly", reset = { u = "-0.9*u" } } }\n'
    )
    options = {"step": 1e-3} if integrator.startswith("rk4") else {}
    sol = hs.simulate(model(text), (0, 2), integrator=integrator, **options)
    expected = [1 / 6]
    while expected[-1] + 1 / (3 * 0.9 ** len(expected)) < 2:
        expected.append(expected[-1] + 1 / (3 * 0.9 ** len(expected)))
    assert [e.t for e in sol.events] == pytest.approx(expected, abs=1e-6)


def test_a_force_that_drives_its_own_velocity_is_refused() -> None:
    text = (
        '[states]\nx = { start = 0, der = "v" }\nv = { start = 0, der = "-x - f" }\n'
        '[contacts.f]\nvelocity = "0.2 - v"\nnormal = "1"\nlaw = { name = "coulomb", mu = 0.5 }\n'
    )
    with pytest.raises(ModelError, match=r"contact f.*against it"):
        hs.simulate(model(text), (0, 1))


def test_a_rate_that_is_no_number_is_named() -> None:
    sol = hs.simulate(model('[states]\nx = { start = 1, der = "1/(x - 1)" }\n'), (0, 1))
    assert sol.status == "step-failure"
    assert "x" in sol.message


@pytest.mark.parametrize("integrator", LOCATING)
def test_a_monitor_whose_reset_falls_on_a_tick_is_recorded(integrator: str) -> None:
    """y rises to 0.5 at t = 0.5, where a clock ticks as well, and falls back to -0.5, to be there again at 1.5."""
    text = (
        '[states]\ny = { start = 0, der = "1" }\n[discrete]\nd = 0\n[clocks.c]\nperiod = 0.5\nset = { d = "d + 1" }\n'
        '[monitors.r]\nexpr = "y - 0.5"\ndirection = "up"\naction = "reset"\nreset = { y = "y - 1" }\n'
    )
    sol = hs.simulate(model(text), (0, 1.75), integrator=integrator)
    assert [e.t for e in sol.events if e.component == "r"] == pytest.approx([0.5, 1.5], abs=1e-12)
    assert [e.t for e in sol.events if e.component == "c"] == [0, 0.5, 1, 1.5]
    assert sol(1.75)[0] == pytest.approx(-0.25, abs=1e-12)


@pytest.mark.parametrize("integrator", LOCATING)
@pytest.mark.parametrize("names", ["ab", "ba"])
def test_monitors_that_set_one_state_to_two_values_end_the_run(integrator: str, names: str) -> None:
    """In any order of declaration, as guards and schedules do."""
    texts = {
        name: f'[monitors.{name}]\nexpr = "x - 0.5"\naction = "reset"\nreset = {{ y = "{value}" }}\n'
        for name, value in (("a", 1), ("b", 2))
    }
    falling = '[states]\nx = { start = 1, der = "-1" }\ny = { start = 0, der = "0" }\n'
    sol = hs.simulate(model(falling + "".join(texts[name] for name in names)), (0, 1), integrator=integrator)
    assert sol.status == "inconsistent"
    assert "set y to" in sol.message
    assert sol.t[-1] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("integrator", LOCATING)
def test_a_guard_and_a_monitor_at_one_instant_read_the_state_before_both(integrator: str) -> None:
    text = (
        '[states]\nx = { start = 1, der = "-1" }\ny = { start = 0, der = "0" }\nz = { start = 5, der = "0" }\n'
        '[monitors.m]\nexpr = "2*x - 1"\naction = "reset"\nreset = { y = "1" }\n'
        "[modes.a]\ninitial = true\n"
        'guards.g = { expr = "x - 0.5", then = [{ to = "b", reset = { z = "y" } }] }\n[modes.b]\n'
    )
    sol = hs.simulate(model(text), (0, 1), integrator=integrator)
    assert sol(1.0)[1:].tolist() == [1.0, 0.0]


DOSES = '[states]\ngut = { start = 0, der = "-1.2*gut" }\n'


def schedule(name: str, times: str, reset: str) -> str:
    return f'[schedules.{name}]\ntimes = {times}\nreset = {{ gut = "{reset}" }}\n'


@pytest.mark.parametrize("integrator", LOCATING)
@pytest.mark.parametrize(
    ("schedules", "expected"),
    [
        ((("a", "[0, 24, 48]", "+= 100"), ("b", "[24]", "+= 100")), 200.0),
        ((("a", "[0, 24, 48]", "+= 100"), ("b", "[24]", "+= 50")), 150.0),
        ((("a", "[0, 24, 24]", "+= 100"),), 200.0),
        ((("a", "[24, 0, 24]", "+= 2*gut + 1"),), 2.0),
        ((("a", "[0, 0, 30]", "+= 100"), ("b", "[24]", "5")), None),
    ],
)
def test_amounts_of_one_instant_are_summed(
    integrator: str, schedules: tuple[tuple[str, str, str], ...], expected: float | None
) -> None:
    text = DOSES + "".join(schedule(*one) for one in schedules)
    sol = hs.simulate(model(text), (0, 25), integrator=integrator)
    first = 200.0 if expected is None else 1.0 if expected == 2.0 else 100.0
    left = first * np.exp(-1.2 * 24)
    right = 5.0 if expected is None else 2.0 + 5.0 * left if expected == 2.0 else expected + left
    assert sol(24)[0] == pytest.approx(right, rel=1e-14, abs=1e-9)
    assert sol(24, side="-")[0] == pytest.approx(left, rel=1e-6)


def test_a_sum_of_amounts_does_not_depend_on_their_order() -> None:
    amounts = ["0.1", "1e16", "-1e16", "0.7", "1/3"]
    found = set()
    for turn in range(len(amounts)):
        turned = amounts[turn:] + amounts[:turn]
        text = DOSES + "".join(schedule(f"s{k}", "[1]", f"+= {a}") for k, a in enumerate(turned))
        found.add(float(hs.simulate(model(text), (0, 2), x0={"gut": 1.0}, integrator="taylor")(1)[0]))
    assert len(found) == 1
    assert found.pop() == pytest.approx(np.exp(-1.2) + 0.1 + 0.7 + 1 / 3, rel=1e-15)


@pytest.mark.parametrize(
    "schedules",
    [
        (("a", "[24]", "gut + 100"), ("b", "[24]", "gut + 100")),
        (("a", "[24, 24]", "gut + 100"),),
        (("a", "[24]", "gut + 100"), ("b", "[24]", "+= 100")),
        (("a", "[24]", "7"), ("b", "[24]", "+= 100")),
        (("a", "[24]", "7"), ("b", "[24]", "8")),
    ],
)
def test_resets_that_contradict_each_other_name_the_form_that_adds(
    schedules: tuple[tuple[str, str, str], ...],
) -> None:
    sol = hs.simulate(
        model(DOSES + "".join(schedule(*one) for one in schedules)), (0, 25), integrator="dop853"
    )
    assert sol.status == "inconsistent"
    assert '"+= amount"' in sol.message


def test_a_reset_through_a_definition_reads_what_it_sets() -> None:
    text = '[definitions]\nmore = "gut + 100"\n' + DOSES
    text += schedule("a", "[24]", "more") + schedule("b", "[24]", "more")
    sol = hs.simulate(model(text), (0, 25), integrator="taylor")
    assert sol.status == "inconsistent" and '"+= amount"' in sol.message


@pytest.mark.parametrize("integrator", LOCATING)
def test_two_expressions_of_one_value_agree_within_rounding(integrator: str) -> None:
    # b is a + 1 as a double: b - 1 is a within the rounding of b
    text = '[states]\nx = { start = 0, der = "1" }\n[discrete]\na = 0.1\nb = "0.1 + 1"\n'
    text += '[clocks.one]\nperiod = 1\nset = { x = "a" }\n[clocks.two]\nperiod = 1\nset = { x = "b - 1" }\n'
    sol = hs.simulate(model(text), (0, 2.5), integrator=integrator)
    assert sol.status == "finished"
    assert sol(2.5)[0] == pytest.approx(0.6, abs=1e-12)


def test_python_declares_and_writes_resets_that_add() -> None:
    one = hs.Schedule("a", times=[1, 1], reset={"x": "+= 2*k"})
    made = hs.Model(
        "counting",
        parameters=[hs.Parameter("k", 3)],
        states=[hs.State("x", 1, 0)],
        schedules=[one],
        components=[
            hs.Component(
                "c",
                [hs.Mode("on", [hs.Guard("g", "2 - t", hs.Choice("on", reset={"x": "+= 1"}))])],
            )
        ],
    )
    again = hs.Model.from_toml(made.to_toml())
    assert again == made
    assert again.schedules[0].reset["x"].text == "+= 2*k"
    assert hs.simulate(made, (0, 1.5), integrator="taylor")(1.5)[0] == 13.0


def test_an_amount_that_cannot_be_read_is_refused_at_its_place() -> None:
    with pytest.raises(ModelError, match="unknown name 'dose'"):
        model(DOSES + schedule("a", "[1]", "+= dose"))
    with pytest.raises(hs.HybridsimError, match="is empty"):
        model(DOSES + schedule("a", "[1]", "+= "))
    with pytest.raises(hs.HybridsimError):
        model('[states]\ngut = { start = "+= 1", der = "0" }\n')
