"""Derivatives of extreme values, amplitudes, integrals and means of a run, against closed forms."""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from known_slopes import EXACT, slope

import hybridsim as hs

BALL = {"h0": 1.0, "e": 0.8, "g": 9.8}


def ball() -> hs.Model:
    """A ball that bounces on a floor."""
    hit = hs.Guard("hit", "h", hs.Choice("up", reset={"h": 0, "w": "-e*w"}))
    return hs.Model(
        "ball",
        parameters=BALL,
        states=[hs.State("h", "h0", "w", nominal=1), hs.State("w", 0, "-g", nominal=1)],
        outputs=[hs.Output("away", "abs(h - 0.3)"), hs.Output("side", "sign(h - 0.3)")],
        components=[hs.Component("floor", [hs.Mode("up", hit)], initial="up")],
    )


def bounced() -> hs.Sensitivities:
    """The derivatives of four bounces."""
    return hs.sensitivities(hs.simulate(ball(), (0, 2.4), integrator="exact"), list(BALL))


def agrees(
    found: hs.Sensitivities,
    reading: tuple[str, ...],
    form: Callable[..., mp.mpf],
    values: dict[str, float],
    t_span: tuple[float, float] | None = None,
) -> None:
    """Compare the value and its derivatives by all parameters with those of a closed form."""
    got = found.of(*reading, t_span=t_span)
    expected = [slope(form, values, name) for name in values]
    size = max(map(abs, expected)) or 1.0
    assert got.value == pytest.approx(float(form(**{k: mp.mpf(v) for k, v in values.items()})), rel=EXACT)
    assert got.by_parameter == pytest.approx(expected, rel=EXACT, abs=EXACT * size)


@pytest.mark.parametrize(
    ("reading", "t_span", "form"),
    [
        (("maximum", "h"), None, lambda h0, e, g: h0),
        (("maximum", "h"), (0.6, 1.2), lambda h0, e, g: e**2 * h0),
        (("maximum", "h"), (1.3, 1.9), lambda h0, e, g: e**4 * h0),
        (("maximum", "w"), None, lambda h0, e, g: e * mp.sqrt(2 * g * h0)),
        (("minimum", "w"), None, lambda h0, e, g: -mp.sqrt(2 * g * h0)),
        (("amplitude", "w"), None, lambda h0, e, g: (1 + e) * mp.sqrt(2 * g * h0) / 2),
        (("minimum", "h"), (0.3, 1.0), lambda h0, e, g: 0 * h0),
        (("maximum", "w"), (0.5, 1.0), lambda h0, e, g: (1 + e) * mp.sqrt(2 * g * h0) - g / 2),
    ],
)
def test_extreme_values_of_a_bouncing_ball(
    reading: tuple[str, str], t_span: tuple[float, float] | None, form: Callable[..., mp.mpf]
) -> None:
    """Apexes, speeds at an impact on both sides, a height of zero, and the end of a span."""
    agrees(bounced(), reading, form, BALL, t_span)


def test_an_extreme_value_at_the_start_changes_with_the_start() -> None:
    """The greatest height is h(0), and the last apex has the height e^8 (h0 + w0^2/(2 g)) with w0 = 0."""
    assert bounced().of("maximum", "h").by_start == pytest.approx([1.0, 0.0], abs=1e-12)


def arcs(t: mp.mpf, h0: mp.mpf, e: mp.mpf, g: mp.mpf, power: int) -> mp.mpf:
    """The integral of h (power 1), w (0) or h^2 (2) from 0 to a time after four bounces."""
    primitive = {
        0: lambda s, h, w: w * s - g * s**2 / 2,
        1: lambda s, h, w: h * s + w * s**2 / 2 - g * s**3 / 6,
        2: lambda s, h, w: (
            h**2 * s + h * w * s**2 + (w**2 - g * h) * s**3 / 3 - w * g * s**4 / 4 + g**2 * s**5 / 20
        ),
    }[power]
    begin = mp.sqrt(2 * h0 / g)
    total, speed = primitive(begin, h0, mp.mpf(0)), e * g * begin
    while t > begin + 2 * speed / g:
        total += primitive(2 * speed / g, mp.mpf(0), speed)
        begin, speed = begin + 2 * speed / g, e * speed
    return total + primitive(t - begin, mp.mpf(0), speed)


@pytest.mark.parametrize(
    ("reading", "form"),
    [
        (("integral", "h"), lambda **v: arcs(mp.mpf("2.4"), power=1, **v)),
        (("integral", "w"), lambda **v: arcs(mp.mpf("2.4"), power=0, **v)),
        (("integral", "h", "h"), lambda **v: arcs(mp.mpf("2.4"), power=2, **v)),
        (("mean", "h"), lambda **v: arcs(mp.mpf("2.4"), power=1, **v) / mp.mpf("2.4")),
        (("integral", "h", "w"), lambda **v: (height(**v) ** 2 - v["h0"] ** 2) / 2),
        (
            ("integral", "t", "w"),
            lambda **v: mp.mpf("2.4") * height(**v) - arcs(mp.mpf("2.4"), power=1, **v),
        ),
    ],
)
def test_integrals_of_a_bouncing_ball(reading: tuple[str, ...], form: Callable[..., mp.mpf]) -> None:
    """Integrals through four impacts, at which the speed jumps: those of w and h w are known from the end."""
    agrees(bounced(), reading, form, BALL)


def height(**values: mp.mpf) -> mp.mpf:
    """The height at the end."""
    return values["h0"] + arcs(mp.mpf("2.4"), power=0, **values)


def test_the_largest_forces_of_a_block_that_is_pulled() -> None:
    """A block sticks until k V t = mu_s and slides: the friction ends at mu_s, the spring peaks behind that.

    The spring force is mu_k + (mu_s - mu_k) cos a + V sqrt(k) sin a with a = sqrt(k) (t - release).
    """
    values = {"k": 4.0, "V": 0.5, "mu_s": 1.2, "mu_k": 0.7}
    model = hs.Model(
        "pulled",
        parameters=values,
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "k*(V*t - x) - f", nominal=1)],
        contacts=[hs.Contact("f", "v", 1, "static-kinetic", {"mu_s": "mu_s", "mu_k": "mu_k"})],
        outputs=[hs.Output("spring", "k*(V*t - x)")],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1.4), integrator="exact"), list(values))
    agrees(found, ("maximum", "f"), lambda k, V, mu_s, mu_k: mu_s, values)
    agrees(
        found,
        ("maximum", "spring"),
        lambda k, V, mu_s, mu_k: mu_k + mp.sqrt((mu_s - mu_k) ** 2 + k * V**2),
        values,
    )
    # f = k V t in stick, and then mu_k: the integral of the force
    agrees(
        found,
        ("integral", "f"),
        lambda k, V, mu_s, mu_k: mu_s**2 / (2 * k * V) + mu_k * (mp.mpf(1.4) - mu_s / (k * V)),
        values,
    )


def test_a_forced_oscillator() -> None:
    """The peak of x = a (cos w t - cos w0 t), a = F/(w0^2 - w^2), is at the root of x', which mpmath finds."""
    values = {"F": 2.0, "w": 1.3, "k": 4.0}
    model = hs.Model(
        "forced",
        parameters=values,
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "F*cos(w*t) - k*x", nominal=1)],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 3), integrator="exact"), list(values))

    def x(t: mp.mpf, F: mp.mpf, w: mp.mpf, k: mp.mpf) -> mp.mpf:
        return F / (k - w**2) * (mp.cos(w * t) - mp.cos(mp.sqrt(k) * t))

    def top(**v: mp.mpf) -> mp.mpf:
        w, natural = v["w"], mp.sqrt(v["k"])
        return x(
            mp.findroot(lambda t: w * mp.sin(w * t) - natural * mp.sin(natural * t), mp.mpf("1.25")), **v
        )

    with mp.workdps(30):
        agrees(found, ("maximum", "x"), top, values, (1.0, 2.7))
        agrees(found, ("mean", "x"), lambda F, w, k: F / (k - w**2) * (
            mp.sin(3 * w) / w - mp.sin(3 * mp.sqrt(k)) / mp.sqrt(k)) / 3, values)  # fmt: skip


@pytest.mark.parametrize(
    ("reading", "value"),
    [("maximum", 1.5), ("minimum", 0.5), ("amplitude", 0.5), ("mean", 1.0), ("integral", 1.0)],
)
def test_readings_of_time_do_not_change(reading: str, value: float) -> None:
    """The ends of a part of a run are fixed, so a reading of t has the derivative 0, impacts in the part or not."""
    found = bounced().of(reading, "t", t_span=(0.5, 1.5))
    assert found.value == pytest.approx(value, rel=1e-15)
    assert not found.by_start.any()
    assert not found.by_parameter.any()


def test_a_maximum_that_is_held() -> None:
    """A slider that stops stays at x = v0^2/(2 mu g), its largest place, for the rest of the run."""
    values = {"v0": 2.0, "mu": 0.3, "g": 9.81}
    model = hs.Model(
        "slider",
        parameters=values,
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", "v0", "-f", nominal=1)],
        contacts=[hs.Contact("f", "v", "g", "coulomb", {"mu": "mu"})],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1), integrator="exact"), list(values))
    agrees(found, ("maximum", "x"), lambda v0, mu, g: v0**2 / (2 * mu * g), values)
    agrees(found, ("minimum", "v"), lambda v0, mu, g: 0 * v0, values)


def test_a_maximum_at_which_a_block_rests_for_a_while() -> None:
    """The block stops at its greatest place, and the place of a block at rest has one derivative."""
    found = hs.sensitivities(hs.simulate("dfcs", (0, 0.05), integrator="exact"), ["F0", "omega"])
    peak = found.of("maximum", "x", t_span=(0.02, 0.04))
    assert peak.by_parameter == pytest.approx(found.at(0.035, "x").by_parameter[0], rel=1e-12)


def test_a_force_that_reaches_its_limit_at_each_release() -> None:
    """The largest friction force is mu_s N, at many times that rounding does not tell apart: m does not change it."""
    run = hs.simulate("dfcs-stribeck", (0, 0.74), rtol=1e-11)
    found = hs.sensitivities(run, ["m", "N"]).of("maximum", "f")
    largest = found.value / run.model.parameter_values()["N"]
    assert found.by_parameter == pytest.approx([0.0, largest], rel=1e-9, abs=1e-6)


def swinging(output: str) -> hs.Model:
    """An undamped oscillator that starts at rest, and an output of it."""
    return hs.Model(
        "swinging",
        parameters={"a": 1.0, "b": 0.0},
        states=[hs.State("x", "a", "v", nominal=1), hs.State("v", 0, "-x", nominal=1)],
        outputs=[hs.Output("q", output)],
    )


def test_equal_maxima_that_move_together_have_a_derivative() -> None:
    """All peaks of a cos t are a."""
    found = hs.sensitivities(hs.simulate(swinging("x"), (1, 20), integrator="exact"), ["a", "b"])
    assert found.of("amplitude", "q").by_parameter == pytest.approx([1.0, 0.0], abs=1e-10)


def test_equal_maxima_that_move_apart_are_refused() -> None:
    """x^2 + b x is 1 + b at t = 2 pi and 1 - b at t = pi."""
    run = hs.simulate(swinging("x**2 + b*x"), (0, 8), integrator="exact")
    found = hs.sensitivities(run, ["b"])
    with pytest.raises(hs.UsageError, match=r"q has the same maximum .* at t = .* and t = .*change of b"):
        found.of("maximum", "q", t_span=(2, 7))
    assert found.of("maximum", "q", t_span=(2, 4)).by_parameter == pytest.approx([-1.0])


def test_a_span_that_ends_at_an_event_is_refused() -> None:
    """The first impact is at sqrt(2 h0/g), and moves."""
    found = bounced()
    span = (0.0, float(found.times[0]))
    with pytest.raises(hs.UsageError, match=r"the extreme value of w is at .*change of the start of h"):
        found.of("minimum", "w", t_span=span)
    with pytest.raises(hs.UsageError, match=r"w jumps at .*; a change of the start of h"):
        found.of("integral", "w", t_span=span)
    assert found.of("integral", "h", t_span=span).by_parameter[0] == pytest.approx(
        float(np.sqrt(2 / 9.8)), rel=EXACT
    )


def test_kinks_and_jumps_that_are_no_events() -> None:
    """The ball passes the height 0.3 at tau = sqrt(2 (h0 - 0.3)/g): abs has a kink there, sign a jump."""
    found, span = bounced(), (0.0, 0.44)
    with pytest.raises(hs.UsageError, match="away has a kink or a jump at its extreme value"):
        found.of("minimum", "away", t_span=span)
    with pytest.raises(hs.UsageError, match="side jumps, or varies too fast"):
        found.of("integral", "side", t_span=span)

    def away(h0: mp.mpf, e: mp.mpf, g: mp.mpf) -> mp.mpf:
        until, end = mp.sqrt(2 * (h0 - mp.mpf(0.3)) / g), mp.mpf(0.44)
        first, whole = ((h0 - mp.mpf(0.3)) * t - g * t**3 / 6 for t in (until, end))
        return 2 * first - whole

    agrees(found, ("integral", "away"), away, BALL, span)
    agrees(found, ("maximum", "away"), lambda h0, e, g: h0 - mp.mpf(0.3), BALL, span)


def test_readings_that_do_not_exist_are_refused() -> None:
    """Unknown readings, quantities and spans."""
    found = bounced()
    with pytest.raises(hs.UsageError, match="the reading 'maximun' does not exist"):
        found.of("maximun", "h")
    with pytest.raises(hs.UsageError, match="no quantity 'x'"):
        found.of("mean", "x")
    with pytest.raises(hs.UsageError, match="got 2 quantities for the reading 'maximum'"):
        found.of("maximum", "h", "w")
    with pytest.raises(hs.UsageError, match="got 0 quantities for the reading 'integral'"):
        found.of("integral")
    with pytest.raises(hs.UsageError, match="two different times"):
        found.of("mean", "h", t_span=(1, 1))
    with pytest.raises(hs.UsageError, match="outside the run"):
        found.of("mean", "h", t_span=(0, 9))
