"""What mutated files and command lines have found, each by itself."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

import hybridsim as hs
from hybridsim.cli import main
from hybridsim.engine.run import compiled_loop


def rubbing_block(
    x: object = 0,
    v: object = 0,
    push: str = "cos(t)",
    normal: str = "1",
    law: str = '{ name = "coulomb", mu = 1 }',
    more: str = "",
) -> hs.Model:
    """A block on a spring that is pushed, with one contact."""
    return hs.Model.from_toml(f"""
[states]
x = {{ start = {x}, der = "v" }}
v = {{ start = {v}, der = "{push} - x - f" }}
[contacts.f]
velocity = "v"
normal = {normal}
law = {law}
{more}
""")


def test_a_frequency_that_a_reset_or_an_output_alone_has() -> None:
    model = hs.Model.from_toml("""
[states]
x = { start = 0, der = "1" }
[monitors.m]
expr = "x - 0.5"
direction = "up"
action = "reset"
reset = { x = "0.7 + 0.1*sin(9*t)" }
[schedules.s]
times = 0.75
reset = { x = "cos(5*t)" }
[outputs]
y = "sin(7*t)"
""")
    for integrator in ("dop853", "exact", "taylor"):
        sol = hs.simulate(model, (0.0, 1.0), integrator=integrator)
        assert sol.events[0].x_plus[0] == pytest.approx(0.7 + 0.1 * math.sin(4.5), rel=1e-12)
        assert sol(1.0)[0] == pytest.approx(math.cos(3.75) + 0.25, rel=1e-12)
        assert sol.output("y", 0.5) == pytest.approx(math.sin(3.5), rel=1e-12)


@pytest.mark.parametrize("rate", ["acos(9*k)", "1e200*x", "x/(k - 3)"])
@pytest.mark.parametrize("is_first", [True, False], ids=["first", "later"])
def test_a_linear_rate_that_has_no_value_or_too_large_a_one(
    rate: str, is_first: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the model is the first of a process, for which the loop is compiled."""
    if is_first:
        monkeypatch.setattr(compiled_loop, "_compiled", [])
    model = hs.Model.from_toml(f"""
[parameters]
k = 3
[states]
x = {{ start = 1, der = "{rate}" }}
v = {{ start = 0, der = "-x" }}
[modes.a]
initial = true
guards.g = {{ expr = "v + 2", then = "b" }}
[modes.b]
""")
    sol = hs.simulate(model, (0.0, 1.0), integrator="exact", limits={"steps": 1000})
    assert sol.status == "step-failure"
    assert "the step size fell" in sol.message or "the rate of x is not a number" in sol.message


def test_a_guard_over_scales_that_no_step_spans_ends_with_its_limit() -> None:
    model = hs.Model.from_toml("""
[states]
y = { start = -120, der = "3*t**2 + 12*t - 1e17" }
[modes.below]
initial = true
guards.zero = { expr = "-y", then = "above" }
[modes.above]
guards.zero = { expr = "y", then = "below" }
""")
    sol = hs.simulate(model, (0.0, 1.0), integrator="exact", limits={"steps": 1000})
    assert sol.status in ("finished", "limit")


def test_a_jump_of_friction_that_has_no_value_at_zero_warns_of_nothing() -> None:
    law = '{ name = "static-kinetic", mu_s = "1", mu_k = "1/sin(t)" }'
    model = rubbing_block(v=0, push="sin(t)", law=law)
    sol = hs.simulate(model, (0.0, 1.0), limits={"steps": 1000})
    assert sol.success and [i.mode for i in sol.modes["f"]] == ["stick"]


def test_an_enormous_whole_number() -> None:
    text = '[states]\nx = {{ start = 0, der = "1", nominal = {} }}\n'
    with pytest.raises(hs.ModelError, match="nominal"):
        hs.Model.from_toml(text.format("9" * 400))
    assert hs.Model.from_toml(text.format("9" * 300)).states[0].nominal == pytest.approx(1e300)


def test_a_message_about_a_word_without_end_has_an_end() -> None:
    with pytest.raises(hs.ModelError) as caught:
        hs.Model.from_toml('[states]\nv = { start = 0, der = "-f" }\n[contacts.f]\nvelocity = "v"\n'
                           f'normal = 1\nlaw = {{ name = "{"(" * 20_000}x" }}\n')  # fmt: skip
    assert len(str(caught.value)) < 2000


def test_a_motion_that_is_not_settled_after_the_first_stretch(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["steady", "bouncing-ball", "--max-periods", "4"]) in (0, 1)
    assert "internal error" not in capsys.readouterr().err


@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "rodas5p", "scipy-rk45", "auto"])
@pytest.mark.parametrize(("x", "v"), [("0", "1e308"), ("-1e150", "1"), ("1", "1e150")])
def test_a_start_that_no_double_can_square(integrator: str, x: str, v: str) -> None:
    model = rubbing_block(x=x, v=v)
    sol = hs.simulate(model, (0.0, 1.0), integrator=integrator, limits={"steps": 1000})
    assert sol.status in ("finished", "limit", "step-failure") and sol.message


def test_a_frequency_that_is_too_small_for_a_period() -> None:
    model = hs.Model.from_toml('[states]\nx = { start = 1, der = "cos(1e-308*t)" }\n')
    assert hs.simulate(model, (0.0, 1.0), integrator="dop853")(1.0)[0] == pytest.approx(2.0, rel=1e-12)


def test_a_load_without_a_value_where_a_fixed_step_starts() -> None:
    model = rubbing_block(v=1, normal='"1 + 1.5/x"', more="opens = true")
    sol = hs.simulate(model, (0.0, 1.0), integrator="rk4-dichotomy", limits={"steps": 1000})
    assert sol.status == "step-failure" and "not a number" in sol.message


def test_relays_whose_rates_fill_the_range_of_doubles() -> None:
    model = hs.Model.from_toml("""
[states]
x = { start = 1, der = "-u - 2*w" }
y = { start = 1, der = "1e308*u - w" }
[surfaces]
u = "x"
w = "y"
""")
    sol = hs.simulate(model, (0.0, 1.0), limits={"steps": 5000})
    assert sol.message


def test_a_guard_whose_bound_is_no_number_ends_with_the_limits() -> None:
    """exp(-1/r**2) is 0 where r is, and has derivatives that no series finds there."""
    model = hs.Model.from_toml("""
[definitions]
r = "max(s - 3, 0)"
[states]
s = { start = 2, der = "v" }
v = { start = 0, der = "max(exp(-1/r**2), s - 0.5) - max(-r, min(r, v))" }
""")
    sol = hs.simulate(model, (0.0, 1.0), limits={"steps": 5000})
    assert sol.message


def test_a_message_about_a_name_of_a_thousand_words_has_an_end() -> None:
    shape = "name if name > 0 else " * 1000
    with pytest.raises(hs.ModelError, match="unknown shape") as caught:
        hs.Model.from_toml(f'[inputs.p]\nkind = "wave"\nshape = "{shape}"\nperiod = 1\n'
                           '[states]\nx = { start = 0, der = "p" }\n')  # fmt: skip
    assert len(str(caught.value)) < 4000


@pytest.mark.parametrize("place", ["x" * 300, "y/" * 3000, "(F0 + 1)*" * 600])
def test_a_result_with_a_name_that_no_file_can_have(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "belt", "--t-end", "0.01", "--csv", place]) == 2
    said = capsys.readouterr().err
    assert "--csv" in said and "too long" in said and len(said) < 3000


def test_corners_inside_one_another_are_met_once_each() -> None:
    """Both sides of an abs hold its argument: twenty inside one another were taken apart a million times and more."""
    inner = "y - 1"
    for _ in range(20):
        inner = f"y - abs({inner})"
    states = [hs.State("x", 2, f"-x*({inner})"), hs.State("y", 0, "1")]
    sol = hs.simulate(hs.Model("nested", states), (0.0, 0.1), integrator="dop853", rtol=1e-10)
    # from y = 0 on the innermost is y - |y - 1| = 2*y - 1 < 0, the next y - (1 - 2*y) = 3*y - 1 < 0, and so on
    assert sol.y[0, -1] == pytest.approx(_decay(0.1, 20), rel=1e-8)


def _decay(end: float, depth: int) -> float:
    """x of dx/dt = -x*g(t) from 2, g = t - |t - ... |t - 1||, by a sum over its linear pieces."""

    def g(t: float) -> float:
        value = t - 1
        for _ in range(depth):
            value = t - abs(value)
        return value

    corners = sorted({0.0, end, *(k * end / 20000 for k in range(20001))})
    return 2 * math.exp(-math.fsum(0.5 * (b - a) * (g(a) + g(b)) for a, b in pairwise(corners)))


def test_more_arguments_than_min_and_max_are_taken_apart_into() -> None:
    many = ", ".join(f"{k}*x" for k in range(300))
    with pytest.raises(hs.ModelError, match=r"max\(\) needs 2 to 64 arguments, but was called with 300"):
        hs.Model.from_toml(f'[states]\nx = {{ start = 2, der = "max({many})" }}\n')


@pytest.mark.parametrize("integrator", ["scipy-rk45", "dop853", "taylor"])
def test_a_state_that_a_surface_leaves_without_a_number(integrator: str) -> None:
    model = hs.Model.from_toml("""
[states]
x = { start = 2e150, der = "(t/4 - u)*x - y" }
y = { start = 0, der = "(t/4 - u)*y + x" }
[surfaces]
u = "y**0.5"
""")
    sol = hs.simulate(model, (0.0, 1.0), integrator=integrator, limits={"steps": 5000})
    assert sol.message
