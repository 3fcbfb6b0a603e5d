"""The derivatives that a fit uses: those of the runs where they cost less, against closed forms."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from known_slopes import slope

import hybridsim as hs
from hybridsim.analysis.fit.derivative_costs import DerivativeCosts
from hybridsim.analysis.fit.record import records_of
from hybridsim.analysis.fit.residuals import Residuals
from hybridsim.analysis.fit.unknown import unknowns_of

T = np.linspace(0.5, 2.0, 7)
VALUES = {"k": 0.7, "b": 0.3, "x0": 1.6}
UNKNOWNS = {"k": hs.Unknown(0.1, 2.0, log=True), "x(0)": (0.0, 3.0), "b": (0.0, 1.0)}


def decaying(rest: str = "") -> hs.Model:
    """x' = b - k x."""
    return hs.Model(
        "decaying",
        parameters={"k": 0.7, "b": 0.3},
        states=[hs.State("x", 1.6, "b - k*x" + rest, nominal=1)],
        outputs=[hs.Output("y", "k*x")],
    )


def x(k: mp.mpf, b: mp.mpf, x0: mp.mpf, t: float) -> mp.mpf:
    return b / k + (x0 - b / k) * mp.exp(-k * mp.mpf(t))


@pytest.fixture
def slow_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the measured time of a run, so that exact derivatives cost less."""
    add = DerivativeCosts.add_run
    monkeypatch.setattr(DerivativeCosts, "add_run", lambda self, _: add(self, 100.0))


@pytest.fixture
def fast_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the measured time of a run, so that differences cost less."""
    add = DerivativeCosts.add_run
    monkeypatch.setattr(DerivativeCosts, "add_run", lambda self, _: add(self, 1e-6))


@pytest.mark.usefixtures("slow_runs")
def test_slopes_of_samples_are_those_of_the_closed_form() -> None:
    """One sample is missing, one unknown varies as a logarithm, and one is a start."""
    model = decaying()
    column = np.where(np.arange(7) == 3, np.nan, 1.0)
    records = records_of([hs.Record({"t": T, "x": column, "y": np.ones(7)}, t0=0.0)])
    residuals = Residuals(model, records, unknowns_of(model, UNKNOWNS), {"integrator": "exact"})
    point = np.array([np.log(0.7), 1.6, 0.3])
    found = residuals.slopes(point)
    assert residuals.derivatives == "exact"
    assert residuals.runs == 1
    expected = []
    for times, factor in ((np.delete(T, 3), lambda k: 1), (T, lambda k: k)):
        for t in times.tolist():

            def form(t: float = t, factor: object = factor, **v: mp.mpf) -> mp.mpf:
                return factor(v["k"]) * x(t=t, **v)

            by_k, by_b, by_x0 = (slope(form, VALUES, name) for name in VALUES)
            expected.append([0.7 * by_k, by_x0, by_b])
    assert found == pytest.approx(np.array(expected), rel=1e-10)


@pytest.mark.usefixtures("slow_runs")
def test_a_fit_with_exact_derivatives_finds_the_values() -> None:
    data = {"t": T, "x": [float(x(t=t, **{k: mp.mpf(v) for k, v in VALUES.items()})) for t in T]}
    found = hs.fit(decaying(), hs.Record(data, t0=0.0), UNKNOWNS | {"x(0)": hs.Unknown(0.0, 3.0, guess=1.0)})
    assert found.derivatives == "exact"
    assert list(found.values.values()) == pytest.approx([0.7, 1.6, 0.3], rel=1e-7)


@pytest.mark.usefixtures("slow_runs")
def test_a_run_without_derivative_gets_differences() -> None:
    """Python functions have no derivatives, and the fit says so."""
    model = hs.Model("m", states={"x": 1.6}, parameters={"k": 0.7, "b": 0.3}, flow=rate)
    data = {"t": T, "x": [float(x(t=t, **{k: mp.mpf(v) for k, v in VALUES.items()})) for t in T]}
    found = hs.fit(model, hs.Record(data, t0=0.0), {"k": (0.1, 2.0), "b": (0.0, 1.0), "x(0)": (1.0, 3.0)})
    assert "central differences" in found.derivatives
    assert "Python functions" in found.derivatives
    assert list(found.values.values()) == pytest.approx([0.7, 0.3, 1.6], rel=1e-5)


def rate(t: float, x: np.ndarray, p: object) -> tuple[float]:
    return (p.b - p.k * x[0],)


@pytest.mark.usefixtures("fast_runs")
def test_differences_of_a_run_with_many_events_take_less_time() -> None:
    t = np.linspace(0.0, 0.05, 40)
    data = {"t": t, "x": hs.simulate("dfcs", (0, 0.05)).output("x", t)}
    found = hs.fit("dfcs", data, {"mu": (0.3, 0.7)})
    assert found.derivatives == "central differences, because they take less time"
