"""Steady states that compiled code finds for many points together, against closed forms and plain long runs."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.reference.closed_forms.den_hartog import no_stops

WN = math.sqrt(1e5 / 0.2)
ZETA = 5.65 / (2.0 * math.sqrt(1e5 * 0.2))
READINGS = ["amplitude.x", "energy.x", "stick_fraction.f", "stops_per_period.f", "kind", "multiple", "period"]


def linear(zeta: float) -> hs.Model:
    """Return a forced oscillator without friction, with m = k = F = 1."""
    return hs.Model(
        "linear",
        parameters={"w": 0.8, "zeta": zeta},
        states=[hs.State("x", 0.0, "v"), hs.State("v", 0.0, "sin(w*t) - x - 2*zeta*v")],
    )


def two_blocks() -> hs.Model:
    """Return two blocks on the floor, coupled by a spring, with a weak damper on each."""
    return hs.Model(
        "two-blocks",
        parameters={"k": 3.0, "F": 2.0, "w": 1.1, "mu": 0.1, "N": 2.0, "c": 0.02},
        states=[
            hs.State("x", 0.0, "v"),
            hs.State("v", 0.0, "F*cos(w*t) - k*(x - y) - x - c*v - f"),
            hs.State("y", 0.2, "z"),
            hs.State("z", 0.0, "(k*(x - y) - c*z - g)/2"),
        ],
        contacts=[
            hs.Contact("f", "v", "N", "coulomb", {"mu": "mu"}),
            hs.Contact("g", "z", "N", "static-kinetic", {"mu_s": "1.5*mu", "mu_k": "mu"}),
        ],
    )


def after_many_periods(
    model: hs.Model, name: str, periods: int, multiple: int = 1
) -> tuple[float, float, float]:
    """Return amplitude and energy of a state and the stick fraction of the first contact, from a plain run.

    They are those of the last `multiple` periods.
    """
    values = model.parameter_values()
    period = 2.0 * math.pi / values["omega" if "omega" in values else "w"]
    end, period = periods * period, multiple * period
    run = hs.simulate(model, (0.0, end), integrator="exact", keep=period)
    modes = run.modes[model.contacts[0].name]
    edges = np.unique([t for intervals in run.modes.values() for i in intervals for t in (i.t0, i.t1)])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    low, high, energy, k = math.inf, -math.inf, 0.0, run.names.index(name)
    for a, b in pairwise(edges.tolist()):
        x = run(np.linspace(a, b, 20_001))[k]
        low, high = min(low, x.min()), max(high, x.max())
        at_nodes = run(0.5 * (a + b) + 0.5 * (b - a) * nodes)[k]
        energy += 0.5 * (b - a) * float(weights @ at_nodes**2)
    held = math.fsum(i.t1 - i.t0 for i in modes if i.mode == "stick")
    return 0.5 * (high - low), energy, held / period


@pytest.mark.parametrize("zeta", [0.2, 1e-4])
def test_a_linear_oscillator_has_its_closed_form(zeta: float) -> None:
    """Without damping to speak of, Newton's method takes the place of 10^5 periods."""
    ratios = [0.3, 0.8, 1.3, 2.0]
    found = hs.sweep(linear(zeta), {"w": ratios}, ["amplitude.x", "energy.v", "newton_steps", "periods"])
    assert not found.failed.any() and found.one_by_one == 0
    for k, r in enumerate(ratios):
        amplitude = 1.0 / math.hypot(1.0 - r * r, 2.0 * zeta * r)
        assert found["amplitude.x"][k] == pytest.approx(amplitude, rel=1e-10)
        assert found["energy.v"][k] == pytest.approx(math.pi * r * amplitude**2, rel=1e-10)
    if zeta < 1e-3:
        assert (found["newton_steps"] >= 1).all() and (found["periods"] == 32).all()


def test_without_stops_the_amplitude_is_den_hartogs() -> None:
    """The symmetric motion without stops: J. P. Den Hartog, Trans. ASME 53 (1931) 107, with viscous damping."""
    ratios, loads = np.linspace(0.8, 1.4, 7), [26.0, 30.0, 60.0]
    found = hs.sweep("dfcs", {"omega": (WN * ratios).tolist(), "F0": loads}, READINGS)
    assert not found.failed.any() and found.one_by_one == 0
    compared = 0
    for i, r in enumerate(ratios.tolist()):
        for j, load in enumerate(loads):
            if found["stops_per_period.f"][i, j] == 0.0:
                motion = no_stops(r, ZETA, 20.0 / load)
                assert found["amplitude.x"][i, j] == pytest.approx(motion.amplitude * load / 1e5, rel=1e-9)
                compared += 1
    assert compared >= 12


def test_stick_and_slip_are_those_of_a_long_run() -> None:
    points = {"F0": [19.0, 22.0, 30.0, 50.0], "omega": [0.12 * WN, 0.33 * WN, 0.71 * WN]}
    found = hs.sweep("dfcs", points, READINGS)
    assert not found.failed.any()
    for i, load in enumerate(points["F0"]):
        for j, omega in enumerate(points["omega"]):
            model = hs.load("dfcs").with_(F0=load, omega=omega)
            amplitude, energy, held = after_many_periods(model, "x", 400)
            assert found["amplitude.x"][i, j] == pytest.approx(amplitude, rel=1e-7, abs=1e-12)
            assert found["energy.x"][i, j] == pytest.approx(energy, rel=1e-9, abs=1e-15)
            assert found["stick_fraction.f"][i, j] == pytest.approx(held, abs=1e-8)
            assert found["kind"][i, j] == ("equilibrium" if load < 20.0 else "periodic")
            assert math.isnan(found["period"][i, j]) == (load < 20.0)


def test_newtons_method_passes_events_of_two_contacts() -> None:
    """It converges in a few steps only if the derivative through all events is right."""
    words = ["amplitude.y", "energy.y", "stick_fraction.f", "newton_steps", "periods", "multiple"]
    loads = [0.5, 2.0, 5.0, 6.0]
    found = hs.sweep(two_blocks(), {"N": loads}, words)
    assert not found.failed.any() and found.one_by_one <= 1
    quick = (found["newton_steps"] >= 1) & (found["newton_steps"] <= 4) & (found["periods"] == 32)
    assert quick.sum() >= 3 and found["stick_fraction.f"][quick].max() > 0.1
    for k, load in enumerate(loads):
        multiple = int(found["multiple"][k])
        amplitude, energy, held = after_many_periods(two_blocks().with_(N=load), "y", 3000, multiple)
        assert found["amplitude.y"][k] == pytest.approx(amplitude, rel=1e-7)
        assert found["energy.y"][k] == pytest.approx(energy, rel=1e-8)
        assert found["stick_fraction.f"][k] == pytest.approx(held, abs=1e-7)


def test_bits_do_not_depend_on_the_batch() -> None:
    """A point alone, with 299 others on one worker, and with them on two."""
    rng = np.random.default_rng(7)
    points = {"F0": rng.uniform(15, 60, 300).tolist(), "omega": rng.uniform(60, 1400, 300).tolist()}
    words = [*READINGS, "residual", "newton_steps", "periods"]
    one = hs.sweep("dfcs", points, words, mode="list", workers=1)
    two = hs.sweep("dfcs", points, words, mode="list", workers=2)
    for word in words:
        assert one[word].tolist() == two[word].tolist() or word == "period"
    assert one["period"].tobytes() == two["period"].tobytes()
    for k in range(0, 300, 60):
        alone = hs.steady_state("dfcs", params={name: values[k] for name, values in points.items()})
        assert alone.amplitude["x"] == one["amplitude.x"][k] and alone.energy["x"] == one["energy.x"][k]
        assert alone.residual == one["residual"][k] and alone.kind == one["kind"][k]


def test_readings_of_the_summary_are_those_of_the_orbit() -> None:
    """Each reading of a state is also an integral or an extremum of the dense run over the period."""
    found = hs.steady_state("dfcs")
    orbit = found._orbit
    low, high = orbit.extremes
    for name in ("x", "v"):
        values, k = orbit.of(name), orbit.column(name)
        size = float(abs(values).max())
        assert found.minimum[name] == pytest.approx(low[k], abs=1e-11 * size)
        assert found.maximum[name] == pytest.approx(high[k], abs=1e-11 * size)
        assert found.mean[name] == pytest.approx(orbit.integral(values) / orbit.duration, abs=1e-11 * size)
        assert found.energy[name] == pytest.approx(orbit.integral(values**2), rel=1e-10)
    assert found.stick_fraction["f"] == pytest.approx(found._stuck("f"), rel=1e-9)
    assert list(found.amplitude) == ["x", "v", "f"] and found.amplitude["f"] == pytest.approx(20.0)


def test_an_event_at_the_start_of_the_period_goes_the_general_way() -> None:
    """The block sticks until the force passes the limit mu N, which happens at the start of each period."""
    force = 22.0
    model = hs.load("dfcs").with_(F0=force, omega=0.33 * WN)
    states = [hs.State("x", 0.0, "v"), hs.State("v", 0.0, "(F0*sin(omega*t + ph) - c*v - k*x - f)/m")]
    late = hs.steady_state(model).solution
    release = next(e.t for e in late.events if e.kind != "near-grazing" and e.source == "stick")
    shifted = hs.Model(
        "shifted",
        parameters=model.parameter_values() | {"ph": release * model.parameter_values()["omega"]},
        states=states,
        contacts=list(model.contacts),
    )
    found = hs.sweep(shifted, {"F0": [force]}, ["amplitude.x", "kind"])
    assert found.one_by_one == 1 and found["kind"][0] == "periodic"
    assert found["amplitude.x"][0] == pytest.approx(hs.steady_state(model).amplitude["x"], rel=1e-9)
