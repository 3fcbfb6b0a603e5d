"""Fits find the parameters of data that closed forms and SciPy made, and their errors are those of regression."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybridsim as hs
from hybridsim.cli import main

LINE = hs.Model(
    "line",
    states=[hs.State("x", der="a", start=1.0)],
    parameters=[hs.Parameter("a", 0.5), hs.Parameter("b", 2.0)],
    outputs=[hs.Output("y", "b*x")],
)


def free_decay(t: np.ndarray, mu: float) -> np.ndarray:
    """x(t) of the packaged model free-decay: half cosines about +/- mu N/k, until it sticks."""
    model = hs.load("free-decay").parameter_values()
    m, k, load, x = model["m"], model["k"], model["N"], model["x0"]
    shift, omega = mu * load / k, math.sqrt(k / m)
    found = np.empty_like(t)
    begin = 0.0
    while True:
        end = begin + math.pi / omega
        side = math.copysign(1.0, x)
        if abs(x) <= shift:
            found[t >= begin] = x
            return found
        inside = (t >= begin) & (t < end)
        found[inside] = side * shift + (x - side * shift) * np.cos(omega * (t[inside] - begin))
        begin, x = end, 2.0 * side * shift - x


def test_the_friction_coefficient_of_a_closed_form_is_found() -> None:
    t = np.linspace(0.0, 1.0, 60)
    found = hs.fit("free-decay", {"t": t, "x": free_decay(t, 0.3)}, {"mu": (0.05, 0.9)})
    assert found.success
    assert found.values["mu"] == pytest.approx(0.3, abs=1e-9)
    assert found.model.parameter_values()["mu"] == found.values["mu"]
    assert found.solution().output("x", t) == pytest.approx(free_decay(t, 0.3), abs=1e-8)


def test_values_between_the_bounds_may_be_wrong_for_the_model() -> None:
    """A block that a spring pulls slides off at k V t = mu_s; the fit passes points with mu_s below mu_k.

    While it slides, the spring force is mu_k + (mu_s - mu_k) cos a + V sqrt(k) sin a, a = sqrt(k) (t - release).
    """
    k, V, mu_s, mu_k, t = 4.0, 0.5, 1.2, 0.7, np.linspace(0.0, 1.2, 40)
    a = math.sqrt(k) * np.maximum(t - mu_s / (k * V), 0.0)
    force = np.where(a > 0.0, mu_k + (mu_s - mu_k) * np.cos(a) + V * math.sqrt(k) * np.sin(a), k * V * t)
    model = hs.Model(
        "pulled",
        parameters={"mu_s": 1.0, "mu_k": 1.0},
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "4*(0.5*t - x) - f")],
        contacts=[hs.Contact("f", "v", 1, "static-kinetic", {"mu_s": "mu_s", "mu_k": "mu_k"})],
    )
    found = hs.fit(model, {"t": t, "x": V * t - force / k}, {"mu_s": (0.1, 2.0), "mu_k": (0.1, 2.0)})
    assert found.values == {"mu_s": pytest.approx(mu_s, abs=1e-7), "mu_k": pytest.approx(mu_k, abs=1e-7)}


def test_a_model_that_is_wrong_with_all_values_is_named() -> None:
    """A negative coefficient of friction at the guess and between the bounds."""
    t = np.linspace(0.0, 1.0, 60)
    with pytest.raises(hs.SimulationError, match=r"from every first guess: .*limit cannot be"):
        hs.fit("free-decay", {"t": t, "x": free_decay(t, 0.3)}, {"mu": (-0.9, -0.1)})


def test_errors_are_those_of_linear_regression() -> None:
    t = np.linspace(0.0, 2.0, 30)
    x = 0.7 + 0.3 * t + 0.05 * np.random.default_rng(4).normal(size=30)
    found = hs.fit(LINE, {"t": t, "x": x}, {"a": (-5, 5), "x(0)": (-5, 5)})
    # ordinary least squares: beta = (X'X)^-1 X'y, covariance s^2 (X'X)^-1, s^2 = rss/(m - 2)
    X = np.column_stack([t, np.ones(30)])
    beta, rss = np.linalg.lstsq(X, x, rcond=None)[:2]
    covariance = rss[0] / 28 * np.linalg.inv(X.T @ X)
    assert list(found.values.values()) == pytest.approx(beta, rel=1e-7)
    assert found.covariance == pytest.approx(covariance, rel=1e-5)
    assert found.noise["x"] == pytest.approx(math.sqrt(rss[0] / 28), rel=1e-6)
    # the 97.5 % quantile of Student's distribution with 28 degrees of freedom, from tables
    low, high = found.interval("a")
    assert (high - low) / 2 == pytest.approx(2.0484 * math.sqrt(covariance[0, 0]), rel=1e-4)


def test_a_given_noise_sets_the_errors() -> None:
    t = np.linspace(0.0, 2.0, 30)
    x = 0.7 + 0.3 * t + 0.05 * np.random.default_rng(4).normal(size=30)
    found = hs.fit(LINE, {"t": t, "x": x}, {"a": (-5, 5), "x(0)": (-5, 5)}, noise={"x": 0.2})
    X = np.column_stack([t, np.ones(30)])
    assert found.covariance == pytest.approx(0.04 * np.linalg.inv(X.T @ X), rel=1e-5)


def test_two_quantities_of_different_noise_count_by_their_noise() -> None:
    rng, t = np.random.default_rng(7), np.linspace(0.0, 1.0, 400)
    data = {"t": t, "x": 1 + 0.5 * t + 1e-3 * rng.normal(size=400), "y": 2 + t + rng.normal(size=400)}
    found = hs.fit(LINE, data, {"a": (0, 2)})
    assert found.noise["x"] == pytest.approx(1e-3, rel=0.15)
    assert found.noise["y"] == pytest.approx(1.0, rel=0.15)
    # y alone would leave an error of 1/(b sqrt(sum t^2)) = 0.04; x decides
    assert found.errors["a"] == pytest.approx(1e-3 / math.sqrt(float(t @ t)), rel=0.15)


def test_the_intervals_hold_the_truth_as_often_as_they_say() -> None:
    t = np.linspace(0.0, 2.0, 12)
    inside = 0
    for seed in range(100):
        x = 1.0 + 0.3 * t + 0.05 * np.random.default_rng(seed).normal(size=12)
        low, high = hs.fit(LINE, {"t": t, "x": x}, {"a": (-5, 5)}).interval("a")
        inside += low <= 0.3 <= high
    assert 88 <= inside <= 100  # binomial with p = 0.95: outside in less than 0.5 % of repetitions


def test_a_product_is_named_as_what_the_data_determine() -> None:
    t = np.linspace(0.0, 0.5, 60)
    found = hs.fit("free-decay", {"t": t, "x": free_decay(t, 0.3)}, {"mu": (0.05, 0.9), "N": (1, 100)})
    assert "they determine mu*N" in found.undetermined[0]
    assert found.values["mu"] * found.values["N"] == pytest.approx(
        0.3 * hs.load("free-decay").parameter_values()["N"], rel=1e-7
    )
    assert found.errors["mu"] == math.inf


def test_an_unknown_without_effect_is_named() -> None:
    t = np.linspace(0.0, 2.0, 30)
    found = hs.fit(LINE, {"t": t, "x": 1 + 0.3 * t}, {"a": (-5, 5), "b": (0, 4)})
    assert found.undetermined == ("the data do not determine b",)
    assert found.errors["a"] < 1e-8


def test_a_single_unknown_without_effect_is_named() -> None:
    t = np.linspace(0.0, 2.0, 30)
    found = hs.fit(LINE, {"t": t, "x": 1 + 0.5 * t}, {"b": (0, 4)})
    assert found.undetermined == ("the data do not determine b",)


def test_a_local_minimum_of_many_half_cycles_is_left() -> None:
    # the sum of squares over mu has several minima: the block stops in another half cycle
    t = np.linspace(0.0, 15.0, 150)
    x = free_decay(t, 0.22) + 0.01 * np.random.default_rng(2).normal(size=150)
    for guess in (0.1, 0.3, 0.7):
        found = hs.fit("free-decay", {"t": t, "x": x}, {"mu": hs.Unknown(0.02, 0.9, guess=guess)})
        assert abs(found.values["mu"] - 0.22) < 4 * found.errors["mu"] < 0.002


POLYNOMIAL = hs.Model(
    "polynomial",
    parameters={"a": 1.0, "b": 1.0, "c": 1.0},
    states=[hs.State("x", 0, 0)],
    outputs={"y": "a + b*t + c*t**2"},
)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("guess", [1e-12, 1.0, 0.0, -4.0])
def test_errors_are_those_of_regression_where_a_value_is_zero(seed: int, guess: float) -> None:
    """The true c is 0; neither its size nor that of the first guess says how well it is known."""
    t = np.linspace(0.0, 1.0, 50)
    y = 0.7 + 1.3 * t + 0.01 * np.random.default_rng(seed).normal(size=50)
    unknowns = {name: hs.Unknown(-5, 5, guess=guess) for name in "abc"}
    found = hs.fit(POLYNOMIAL, {"t": t, "y": y}, unknowns, noise={"y": 0.01})
    X = np.column_stack([t**0, t, t**2])
    assert found.undetermined == ()
    assert list(found.values.values()) == pytest.approx(np.linalg.lstsq(X, y, rcond=None)[0], abs=1e-6)
    assert found.covariance == pytest.approx(1e-4 * np.linalg.inv(X.T @ X), rel=1e-3)


@pytest.mark.parametrize("width", [1e-3, 1e-6, 1e-9])
def test_bounds_may_be_narrow(width: float) -> None:
    t = np.linspace(0.0, 2.0, 30)
    found = hs.fit(LINE, {"t": t, "x": 1 + 0.3 * t}, {"a": (0.3 - 0.6 * width, 0.3 + 0.4 * width)})
    assert found.values["a"] == pytest.approx(0.3, abs=0.02 * width)


def test_two_columns_of_one_quantity_are_refused() -> None:
    t = np.linspace(0.0, 2.0, 30)
    with pytest.raises(hs.UsageError, match="`quantities` assigns 2 columns to x"):
        hs.Record({"t": t, "left": t, "right": t}, {"left": "x", "right": "x"})


def test_missing_cells_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    path.write_text("t,x\n0,1\n1,\n2,nan\n3,1.9\n4,2.2\n")
    record = hs.Record(path)
    assert np.isnan(record.columns["x"]).tolist() == [False, True, True, False, False]
    path.write_text("t,x\n0,1\n,2\n")
    with pytest.raises(hs.ModelError, match="column 0 is empty"):
        hs.Record(path)


def test_a_constant_simulation_is_said() -> None:
    t = np.linspace(0.0, 1.0, 30)
    model = hs.Model("still", parameters={"g": 1.0}, states=[hs.State("x", 1, 0)])
    found = hs.fit(model, {"t": t, "x": 1 + t}, {"g": (0, 5)})
    assert any("simulated values of x are constant" in text for text in found.warnings)


def test_a_wrong_unit_is_said() -> None:
    t = np.linspace(0.0, 2.0, 30)
    found = hs.fit(LINE, {"t": t, "x": 1000 * (1 + 0.3 * t)}, {"a": (0.1, 0.9)})
    assert any("compare the units" in text for text in found.warnings)


def test_the_time_has_a_name_of_its_own(tmp_path: Path) -> None:
    t = np.linspace(0.0, 2.0, 30)
    data = {"time_s": t, "place": 1 + 0.3 * t, "note": ["a"] * 30}
    names = {"time_s": "t", "place": "x"}
    assert hs.fit(LINE, hs.Record(data, names), {"a": (0, 1)}).values["a"] == pytest.approx(0.3, abs=1e-8)
    path = tmp_path / "record.csv"
    path.write_text(
        "note,place,time_s\n" + "".join(f"a,{1 + 0.3 * each!r},{each!r}\n" for each in t.tolist())
    )
    assert hs.fit(LINE, hs.Record(path, names), {"a": (0, 1)}).values["a"] == pytest.approx(0.3, abs=1e-8)
    with pytest.raises(hs.UsageError, match="no column 't'; the columns are: note, place, time_s"):
        hs.Record(path)
    with pytest.raises(hs.UsageError, match="`quantities` contains 'plaice'") as caught:
        hs.Record(path, {"plaice": "x", "time_s": "t"})
    assert "place" in str(caught.value.remedy)


def test_columns_that_are_dropped_are_named(tmp_path: Path) -> None:
    t = np.linspace(0.0, 2.0, 30)
    data = {"t": t, "place": 1 + 0.3 * t, "force": t, "note": ["a"] * 30}
    record = hs.Record(data, {"place": "x"})
    assert record.dropped == ("force", "note")
    assert repr(record) == "<Record: 30 times, t = 0 to 2; x; dropped: force, note>"
    assert "columns not used: force, note" in repr(hs.fit(LINE, record, {"a": (0, 1)}))
    whole = hs.Record({"t": t, "x": 1 + 0.3 * t})
    assert whole.dropped == () and "not used" not in repr(hs.fit(LINE, whole, {"a": (0, 1)}))
    path = tmp_path / "record.csv"
    path.write_text("time,place,force\n0,1,2\n1,2,3\n", encoding="utf-8")
    with pytest.raises(
        hs.UsageError, match="selects no measured quantity, and drops the columns place, force"
    ) as caught:
        hs.Record(path, {"time": "t"})
    assert "quantities={'place': QUANTITY}" in (caught.value.remedy or "")
    with pytest.raises(hs.UsageError, match="no column 't'; the columns are: x, time"):
        hs.Record({"time": t, "place": t}, {"place": "x"})


def test_times_in_milliseconds(tmp_path: Path) -> None:
    """A block with v = 1 - a*t: of times in ms the unknown deceleration would be 1e-3 as large."""
    path = tmp_path / "record.csv"
    path.write_text(
        "t,x\n" + "".join(f"{k},{1 + 0.3 * k / 1000!r}\n" for k in range(0, 2001, 50)), encoding="utf-8"
    )
    record = hs.Record(path, time_unit="ms")
    assert record.t.tolist() == [k / 1000 for k in range(0, 2001, 50)]  # the doubles next to the decimals
    assert hs.fit(LINE, record, {"a": (0, 1)}).values["a"] == pytest.approx(0.3, abs=1e-8)
    hours = hs.Record({"t": [0, 0.5], "x": [1, 2]}, time_unit="h")
    assert hours.t.tolist() == [0.0, 1800.0]
    for unit in ("mm", "second", "", 3):
        with pytest.raises(hs.UsageError, match="`time_unit` cannot be"):
            hs.Record(path, time_unit=unit)  # type: ignore[arg-type]
    slow = hs.Model(
        "slow", states=[hs.State("x", 1, "a", unit="m")], parameters=[hs.Parameter("a", 0.3, unit="m/h")]
    )
    with pytest.raises(hs.UsageError, match="the time of model slow is in h"):
        hs.fit(slow, record, {"a": (0, 1)})


BLOCK = """
schema = 1
name = "sliding-block"

[parameters]
mu_s = 0.5
mu_k = 0.3
v_s = 0.4
g = 9.81
speed = 3.0

[states]
x = { start = 0, der = "v" }
v = { start = "speed", der = "-f" }

[laws.falling]
parameters = ["mu_s", "mu_k", "v_s"]
slip = "N*(mu_k + (mu_s - mu_k)*exp(-(v/v_s)**2))"
stick = "N*mu_s"

[contacts.f]
velocity = "v"
normal = "g"
law = { name = "falling", mu_s = "mu_s", mu_k = "mu_k", v_s = "v_s" }

[outputs]
force = { expr = "f" }
"""


@pytest.fixture
def block(tmp_path: Path) -> hs.Model:
    path = tmp_path / "sliding-block.toml"
    path.write_text(BLOCK)
    return hs.load(path)


def slides(t: np.ndarray, speed: float, mu_s: float, mu_k: float, v_s: float) -> np.ndarray:
    """x, v and friction force of a block that slides and then rests, by SciPy."""

    def force(v: float) -> float:
        return 9.81 * (mu_k + (mu_s - mu_k) * math.exp(-((v / v_s) ** 2)))

    def stops(_: float, y: np.ndarray) -> float:
        return float(y[1])

    stops.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        lambda _, y: [y[1], -force(y[1])], (0, 10), [0.0, speed], "DOP853", events=stops, rtol=1e-12, atol=1e-13,
        dense_output=True,
    )  # fmt: skip
    end = run.t[-1]
    x, v = np.where(t < end, run.sol(np.minimum(t, end)), run.y[:, -1:] * [[1.0], [0.0]])
    return np.array([x, v, np.where(t < end, [force(each) for each in v], 0.0)])


def test_a_stribeck_law_is_found_from_two_records_of_scipy(block: hs.Model) -> None:
    t = np.linspace(0.0, 1.5, 80)
    records = [
        hs.Record(
            {"t": t, "place": slides(t, speed, 0.55, 0.25, 0.6)[0]}, {"place": "x"}, params={"speed": speed}
        )
        for speed in (2.0, 4.0)
    ]
    found = hs.fit(
        block, records, {"mu_s": (0.3, 1), "mu_k": (0.1, 0.3), "v_s": hs.Unknown(0.1, 2, log=True)}
    )
    assert list(found.values.values()) == pytest.approx([0.55, 0.25, 0.6], rel=1e-6)
    assert len(found.residuals) == 2
    assert found.warnings == ()


def test_an_unknown_start_and_missing_samples(block: hs.Model) -> None:
    t = np.linspace(0.0, 1.0, 50)
    x = slides(t, 2.7, 0.5, 0.3, 0.4)[0] + 0.2
    x[10:20] = math.nan
    found = hs.fit(block, {"t": t, "x": x}, {"v(0)": (1, 4), "x(0)": (-1, 1)})
    assert found.values == pytest.approx({"v(0)": 2.7, "x(0)": 0.2}, rel=1e-7)
    assert found.samples == 40
    assert np.isnan(found.residuals[0]["x"][10:20]).all()


def test_a_force_that_jumps_between_samples_does_not_lead_astray(block: hs.Model) -> None:
    t = np.linspace(0.0, 1.5, 200)
    force = slides(t, 3.0, 0.5, 0.35, 0.4)[2] + 0.05 * np.random.default_rng(3).normal(size=200)
    found = hs.fit(block, {"t": t, "force": force}, {"mu_k": (0.1, 0.5)})
    assert abs(found.values["mu_k"] - 0.35) < 4 * found.errors["mu_k"] < 0.01


def test_a_wrong_first_guess_is_left_by_more_starts() -> None:
    t = np.linspace(0.0, 20.0, 200)
    model = hs.Model(
        "oscillator",
        states=[hs.State("x", der="v", start=1.0), hs.State("v", der="-omega**2*x", start=0.0)],
        parameters=[hs.Parameter("omega", 1.0)],
    )
    data = {"t": t, "x": np.cos(3.7 * t)}
    one = hs.fit(model, data, {"omega": (0.5, 8)}, starts=1)
    assert abs(one.values["omega"] - 3.7) > 0.1
    assert any("does not describe" in text for text in one.warnings)
    for starts in (None, 20):
        many = hs.fit(model, data, {"omega": (0.5, 8)}, starts=starts)
        assert many.values["omega"] == pytest.approx(3.7, rel=1e-7)
        assert many.warnings == ()


def test_doubtful_results_are_said() -> None:
    t = np.linspace(0.0, 2.0, 80)
    bent = hs.fit(LINE, {"t": t, "x": 1 + 0.3 * t + 0.2 * np.sin(3 * t)}, {"a": (-5, 5)})
    assert any("neighbouring residuals" in text for text in bent.warnings)
    noise = np.random.default_rng(0).normal(size=80)
    nonsense = hs.fit(LINE, {"t": t, "x": noise}, {"a": (-5, 5), "x(0)": (-5, 5)})
    assert any("does not describe" in text for text in nonsense.warnings)
    loud = hs.fit(LINE, {"t": t, "x": 1 + 0.3 * t + 0.1 * noise}, {"a": (-5, 5)}, noise={"x": 0.01})
    assert any("given noise" in text for text in loud.warnings)
    bound = hs.fit(LINE, {"t": t, "x": 1 + 0.3 * t}, {"a": (0.4, 5)})
    assert any("at a bound" in text for text in bound.warnings)
    assert math.isnan(bound.errors["a"])
    bound = hs.fit(LINE, {"t": t, "x": 1 + 0.3 * t}, {"a": hs.Unknown(0.4, 5, log=True)})
    assert any("at a bound" in text for text in bound.warnings)


def test_a_robust_loss_bounds_the_effect_of_outliers() -> None:
    t = np.linspace(0.0, 2.0, 81)
    x = 1 + 0.3 * t + 0.01 * np.random.default_rng(0).normal(size=81)
    x[::10] += 3.0
    noise = {"x": 0.01}
    plain = hs.fit(LINE, {"t": t, "x": x}, {"a": (-5, 5)}, noise=noise)
    robust = hs.fit(LINE, {"t": t, "x": x}, {"a": (-5, 5)}, noise=noise, loss="cauchy")
    assert abs(plain.values["a"] - 0.3) > 0.05
    assert abs(robust.values["a"] - 0.3) < 0.005


def test_a_run_that_stops_early_is_an_error_or_a_step_that_is_not_taken() -> None:
    # x' = a x^2 from 1 is infinite at t = 1/a
    model = hs.Model(
        "burst", states=[hs.State("x", der="a*x**2", start=1.0)], parameters=[hs.Parameter("a", 0.5)]
    )
    t = np.linspace(0.0, 1.0, 30)
    with pytest.raises(hs.SimulationError, match="stop early from every first guess"):
        hs.fit(model, {"t": t, "x": 1 / (1 - 0.8 * t)}, {"a": hs.Unknown(0, 5, guess=2.0)}, starts=1)
    found = hs.fit(model, {"t": t, "x": 1 / (1 - 0.8 * t)}, {"a": (0, 5)}, starts=5)
    assert found.values["a"] == pytest.approx(0.8, rel=1e-7)


DATA = {"t": [0.0, 1.0, 2.0], "x": [1.0, 1.5, 2.0]}


@pytest.mark.parametrize(
    ("records", "unknowns", "options", "words"),
    [
        (DATA, {"c": (0, 1)}, {}, "`unknowns` contains 'c'"),
        (DATA, {"a": 3}, {}, r"use \(low, high\)"),
        (DATA, {"a": (1, 0)}, {}, "lower bound below the upper bound"),
        (DATA, {}, {}, "a dict of names and bounds"),
        (DATA, {"a": hs.Unknown(-math.inf, 0.1)}, {}, "guess="),
        (DATA, {"a": (-math.inf, 1)}, {"starts": 3}, "no finite bounds"),
        (DATA, {"a": (0, 1)}, {"noise": {"v": 1}}, "no record contains 'v'"),
        (DATA, {"a": (0, 1)}, {"noise": {"x": -1}}, "positive number"),
        (DATA, {"a": (0, 1)}, {"loss": "square"}, "soft_l1"),
        (DATA, {"a": (0, 1)}, {"colour": 1}, "'colour' is not an option"),
        (DATA, {"a": (0, 1)}, {"t_eval": [0]}, "hs.Record"),
        (DATA, {"a": (0, 1), "b": (0, 1), "x(0)": (0, 2)}, {}, "3 samples for 3 unknowns"),
        ({"t": [0, 1, 2], "q": [1, 2, 3]}, {"a": (0, 1)}, {}, "no quantity 'q'"),
        ({"t": [0, 1, 1], "x": [1, 2, 3]}, {"a": (0, 1)}, {}, "do not increase"),
        ({"t": [0, 1], "x": [1, 2, 3]}, {"a": (0, 1)}, {}, "3 values, but there are 2 times"),
        ({"t": [0, 1], "x": [1, math.inf]}, {"a": (0, 1)}, {}, "infinite"),
        ({"t": [0, 1], "x": [1, "two"]}, {"a": (0, 1)}, {}, "not a number"),
        ({"time": [0, 1], "x": [1, 2]}, {"a": (0, 1)}, {}, "no column 't'; the columns are: time, x"),
        ({"t": [0, 1]}, {"a": (0, 1)}, {}, "no measured quantity"),
        (hs.Record(DATA, params={"a": 1}), {"a": (0, 1)}, {}, "a record sets a"),
        (hs.Record(DATA, x0={"x": 1}), {"x(0)": (0, 1)}, {}, r"a record sets x\(0\)"),
        ([], {"a": (0, 1)}, {}, "at least one record"),
        (3.0, {"a": (0, 1)}, {}, "a dict of columns"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(records: Any, unknowns: Any, options: Any, words: str) -> None:
    with pytest.raises(hs.UsageError, match=words):
        hs.fit(LINE, records, unknowns, **options)


def test_the_command_reads_csv_files_and_prints_json(
    tmp_path: Path, block: hs.Model, capsys: pytest.CaptureFixture[str]
) -> None:
    t = np.linspace(0.0, 1.0, 50)
    rows = np.column_stack([t, slides(t, 3.0, 0.5, 0.27, 0.4)[0]])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,place", comments="", fmt="%.17g")
    model, picture = tmp_path / "sliding-block.toml", tmp_path / "fit.svg"
    line = ["fit", str(model), str(tmp_path / "run.csv"), "--unknown", "mu_k=0.1:0.45", "--column", "place=x"]
    assert main([*line, "--json", "--plot", str(picture)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["unknowns"]["mu_k"]["value"] == pytest.approx(0.27, rel=1e-6)
    assert picture.stat().st_size > 10_000
    assert main([*line[:3], "--unknown", "mu_k=0.1"]) == 2
    assert "LOW:HIGH" in capsys.readouterr().err
