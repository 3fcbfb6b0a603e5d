"""Readings of the last of so many periods: runs that go together are what each is by itself, and what theory says."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.system.system_cache import system_of
from hybridsim.ensemble.group import Ensemble, can_run_together
from hybridsim.ensemble.runs import last_periods
from hybridsim.errors import UsageError
from hybridsim.reference.closed_forms.den_hartog import no_stops

WN = math.sqrt(1e5 / 0.2)
READINGS = (
    "amplitude.x", "energy.x", "mean.v", "maximum.v", "minimum.x", "peak.x", "stick_fraction.f", "stops_per_period.f",
    "residual", "period",
)  # fmt: skip


def two_blocks() -> hs.Model:
    """Two blocks on a moving floor, coupled by a spring: two contacts, one cluster."""
    return hs.Model(
        "two-blocks",
        parameters={"k": 3.0, "F": 2.0, "w": 1.1, "mu": 0.3, "N": 2.0, "u": 0.0},
        states=[
            hs.State("x", 0.0, "v"),
            hs.State("v", 0.0, "F*cos(w*t) - k*(x - y) - x - f"),
            hs.State("y", 0.2, "z"),
            hs.State("z", 0.0, "(k*(x - y) - g)/2"),
        ],
        contacts=[
            hs.Contact("f", "v - u", "N", "coulomb", {"mu": "mu"}),
            hs.Contact("g", "z - u", "N", "static-kinetic", {"mu_s": "1.5*mu", "mu_k": "mu"}),
        ],
    )


def highest(x: np.ndarray) -> float:
    """The largest of equally spaced samples, or the top of the parabola through it and its neighbours."""
    k = int(np.argmax(x))
    if not 0 < k < len(x) - 1:
        return float(x[k])
    left, middle, right = x[k - 1 : k + 2].tolist()
    bend = left - 2.0 * middle + right
    return middle - (right - left) ** 2 / (8.0 * bend) if bend < 0.0 else middle


def by_itself(model: hs.Model, after: int, word: str) -> float:
    """A reading from an ordinary run of `exact`, by its dense output where it is of a state."""
    omega = model.parameter_values()["omega" if "omega" in model.parameter_values() else "w"]
    period = 2.0 * math.pi / omega
    run = hs.simulate(model, (0.0, after * period), integrator="exact", keep=period)
    assert run.success, run.message
    head, _, name = word.partition(".")
    if head == "period":
        return period
    if head == "residual":
        y = run(np.linspace(run.t_start, run.t_end, 100_001))
        size = np.maximum(np.ptp(y, axis=1) / 2, 1e-3 * np.abs(y).max(axis=1))
        moved = np.abs(run.y[:, -1] - run.y[:, 0])
        return float(np.divide(moved, size, out=np.zeros(len(size)), where=size > 0.0).max())
    if head in ("stick_fraction", "stops_per_period"):
        held = [i for i in run.modes[name] if i.mode == "stick" and i.t1 > i.t0]
        if head == "stick_fraction":
            return math.fsum(i.t1 - i.t0 for i in held) / period
        ends = run.modes[name][0].mode == "stick" == run.modes[name][-1].mode
        return float(len(held) - ends)
    edges = np.unique([t for i in run.modes.values() for j in i for t in (j.t0, j.t1)])
    nodes, weights = np.polynomial.legendre.leggauss(60)
    total = squares = 0.0
    low, high = math.inf, -math.inf
    k = run.names.index(name)
    for a, b in pairwise(edges.tolist()):
        x = run(0.5 * (a + b) + 0.5 * (b - a) * nodes)[k]
        total += 0.5 * (b - a) * float(weights @ x)
        squares += 0.5 * (b - a) * float(weights @ x**2)
        dense = run(np.linspace(a, b, 4000))[k]
        low, high = min(low, -highest(-dense)), max(high, highest(dense))
    return {
        "amplitude": 0.5 * (high - low), "energy": squares, "mean": total / period, "maximum": high, "minimum": low,
        "peak": max(-low, high),
    }[head]  # fmt: skip


def test_the_map_of_the_reference_model() -> None:
    """Sticking, slipping, at rest, and exactly at the limit of it, where each touch is a question of rounding."""
    loads = [18.0, 20.0, np.nextafter(20.0, 21.0), 20.5, 24.0, 41.0, 57.0]
    speeds = (WN * np.array([0.09, 0.33, 0.71, 1.0, 1.6])).tolist()
    assert can_run_together(system_of(hs.load("dfcs").validate()))
    found = hs.sweep("dfcs", {"F0": loads, "omega": speeds}, READINGS, after=40)
    assert not found.failed.any(), list(found.problems())
    for i, load in enumerate(loads):
        for j, omega in enumerate(speeds):
            model = hs.load("dfcs").with_(F0=load, omega=omega)
            size = max(by_itself(model, 40, "peak.x"), 1e-12)
            sizes = {"x": size, "v": omega * size}
            for word in READINGS:
                truth, reading = by_itself(model, 40, word), found[word][i, j]
                unit = sizes.get(word.rpartition(".")[2], 1.0)
                unit *= unit * 2 * math.pi / omega if word == "energy.x" else 1.0
                loose = 1e-6 if word == "residual" else 1e-9
                assert reading == pytest.approx(truth, rel=loose, abs=loose * unit), (load, omega, word)


def test_without_stops_the_amplitude_is_den_hartogs() -> None:
    """After 400 periods of a vibration that decays by exp(-2 pi zeta/r) in each."""
    ratios = np.array([0.85, 1.1, 1.3])
    found = hs.sweep("dfcs", {"omega": (WN * ratios).tolist()}, ["amplitude.x", "residual"], after=400)
    zeta = 5.65 / (2.0 * math.sqrt(1e5 * 0.2))
    for r, amplitude in zip(ratios, found["amplitude.x"], strict=True):
        motion = no_stops(r, zeta, 20.0 / 30.0)
        assert amplitude == pytest.approx(motion.amplitude * 30.0 / 1e5, rel=1e-10)
    assert found["residual"].max() < 1e-10


def test_two_contacts_and_values_that_others_follow_from() -> None:
    """The load of both contacts, a start on and off the surfaces, and a floor that moves."""
    model = two_blocks()
    assert can_run_together(system_of(model.validate()))
    points = {"N": [0.0, 1.0, 3.0, 9.0], "u": [0.0, 0.4], "v": [0.0, 0.4, -1.0]}
    words = ["amplitude.x", "energy.y", "stick_fraction.f", "stick_fraction.g", "stops_per_period.g"]
    found = hs.sweep(model, points, words, after=12)
    assert not found.failed.any(), list(found.problems())
    for i, load in enumerate(points["N"]):
        for j, u in enumerate(points["u"]):
            for k, v in enumerate(points["v"]):
                one = model.with_(N=load, u=u).with_start(v=v)
                for word in words:
                    truth = by_itself(one, 12, word)
                    assert found[word][i, j, k] == pytest.approx(truth, rel=1e-7, abs=1e-9), (
                        load,
                        u,
                        v,
                        word,
                    )


def test_bits_do_not_depend_on_who_works() -> None:
    values = {"F0": np.linspace(15, 60, 23).tolist(), "omega": np.linspace(60, 1400, 31).tolist()}
    one = hs.sweep("dfcs", values, ["amplitude.x", "energy.x"], after=30, workers=1)
    two = hs.sweep("dfcs", values, ["amplitude.x", "energy.x"], after=30, workers=3)
    with ThreadPoolExecutor(2) as threads:
        three = hs.sweep("dfcs", values, ["amplitude.x", "energy.x"], after=30, executor=threads)
    for word in ("amplitude.x", "energy.x"):
        assert one[word].tobytes() == two[word].tobytes() == three[word].tobytes()


def test_other_readings_and_methods_run_one_by_one() -> None:
    """Harmonics, outputs and other integrators: what a run by itself gives."""
    found = hs.sweep(
        "dfcs", {"F0": [24.0, 45.0]}, ["harmonic.x.1", "amplitude.f", "word", "energy.x"], after=30
    )
    by_taylor = hs.sweep(
        "dfcs", {"F0": [24.0, 45.0]}, ["energy.x"], after=30, integrator="taylor", rtol=1e-12
    )
    together = hs.sweep("dfcs", {"F0": [24.0, 45.0]}, ["energy.x"], after=30)
    assert found["energy.x"] == pytest.approx(together["energy.x"], rel=1e-12)
    assert by_taylor["energy.x"] == pytest.approx(together["energy.x"], rel=1e-8)
    assert found["amplitude.f"] == pytest.approx([20.0, 20.0], rel=1e-12)  # mu N, both ways
    assert np.abs(found["harmonic.x.1"]).min() > 0.0 and "stick" in found["word"][0]


def test_points_that_fail_leave_a_status_and_all_the_others() -> None:
    values = {
        "F0": [30.0] * 6,
        "N": [40.0, -1.0, 40.0, 40.0, 0.0, 40.0],
        "omega": [400.0, 400.0, 0.0, 400.0, 400.0, "sqrt(-F0)"],
    }
    found = hs.sweep("dfcs", values, ["amplitude.x"], mode="list", after=20)
    assert found.failed.tolist() == [False, True, True, False, False, True]
    assert found["amplitude.x"][0] == found["amplitude.x"][3] > 0.0
    assert "normal load cannot be -1" in found.status[1]
    wrong = hs.sweep(hs.load("dfcs").with_(omega=400.0), {"m": [0.2, -0.2, 0.0]}, ["amplitude.x"], after=3)
    assert wrong.failed.tolist() == [False, True, True]
    assert "acts along the relative velocity" in wrong.status[1]


def test_what_has_no_last_period_is_refused() -> None:
    with pytest.raises(UsageError, match="no periodic forcing"):
        hs.sweep("belt", {"v_belt": [0.1]}, ["amplitude.x"], after=10)
    with pytest.raises(UsageError, match="`after` cannot be 0"):
        hs.sweep("dfcs", {"F0": [30.0]}, ["amplitude.x"], after=0)
    with pytest.raises(UsageError, match="`keep` and `after` cannot be combined"):
        hs.sweep("dfcs", {"F0": [30.0]}, ["amplitude.x"], after=3, keep="all")
    with pytest.raises(UsageError, match="kind belongs to a steady state"):
        hs.sweep("dfcs", {"F0": [30.0]}, ["kind"], after=3)


@pytest.mark.parametrize("surface", ["v - z", "v - 0.5*cos(w*t)", "v + 0.3*x"])
@pytest.mark.parametrize("load", [3.0, 100.0])
def test_what_is_held_at_a_surface_that_moves_is_read_there(surface: str, load: float) -> None:
    """A state that follows another, or time, while it is held: its own coordinate says nothing of it."""
    model = hs.Model(
        "pair",
        parameters={"w": 1.0, "N": load},
        states=[
            hs.State("x", 0.0, "v"),
            hs.State("v", 0.3, "-0.5*x - 0.2*v + cos(w*t) - f"),
            hs.State("y", 0.0, "z"),
            hs.State("z", 0.0, "-0.3*z + f"),
        ],
        contacts=[hs.Contact("f", surface, "N", "coulomb", {"mu": 0.3})],
    )
    words = ("mean.v", "energy.v", "maximum.v", "minimum.v", "residual")
    found = hs.sweep(model, {"N": [load]}, words, after=10)
    for word in words:
        loose = 1e-6 if word == "residual" else 1e-9
        assert found[word][0] == pytest.approx(by_itself(model, 10, word), rel=loose, abs=loose), word


def test_the_higher_one_of_two_tops_next_to_each_other_is_read() -> None:
    """x = cos s - a cos 2s + d sin s has two tops about a dip at s = 0 where a is above 1/4, and d makes one higher."""
    text = "-w*sin(w*t + ph) + 2*a*w*sin(2*(w*t + ph)) + d*w*cos(w*t + ph)"
    model = hs.Model(
        "flat",
        parameters={"w": 1.0, "a": 0.25, "d": 0.0, "ph": 0.0, "N": 0.3},
        states=[
            hs.State("x", "cos(ph) - a*cos(2*ph) + d*sin(ph)", text),
            hs.State("v", 0.0, "-f + cos(w*t)"),
        ],
        contacts=[hs.Contact("f", "v", "N", "coulomb", {"mu": 1.0})],
    )
    assert can_run_together(system_of(model.validate()))
    s = np.linspace(-0.5, 0.5, 100_001)
    for a, d in ((0.2505, 1e-6), (0.252, 1e-5), (0.2535, 3e-4)):
        truth = highest(np.cos(s) - a * np.cos(2.0 * s) + d * np.sin(s))
        found = hs.sweep(
            model.with_(a=a, d=d), {"ph": np.linspace(0.0, 6.28, 300).tolist()}, ["maximum.x"], after=2
        )
        assert found["maximum.x"] == pytest.approx(np.full(300, truth), abs=1e-12)


def test_the_bits_do_not_depend_on_what_was_run_before() -> None:
    """Of two models that differ in names alone one meets a point first, the other after points that meet more modes."""

    def three_blocks(*names: str) -> hs.Model:
        pulls = ["F*cos(w*t) - k*x1", "k*(x1 - x2)", "0.5*cos(w*t) - x3"]
        states = [hs.State(f"x{i + 1}", 0.0, f"v{i + 1}") for i in range(3)]
        states += [
            hs.State(f"v{i + 1}", 0.2 * i, f"{pulls[i]} - 0.1*v{i + 1} - {name}")
            for i, name in enumerate(names)
        ]
        contacts = [
            hs.Contact(name, f"v{i + 1} - 0.1", "N", "coulomb", {"mu": 0.3}) for i, name in enumerate(names)
        ]
        return hs.Model(
            "three", parameters={"F": 2.0, "w": 1.1, "k": 3.0, "N": 3.0}, states=states, contacts=contacts
        )

    words = ["amplitude.x1", "energy.v2", "mean.x3", "maximum.v3", "word"]
    first, second = three_blocks("a", "b", "c"), three_blocks("p", "q", "r")
    for load in (0.5, 1.0, 0.0):
        hs.sweep(second, {"N": [load]}, words, after=3)
    alone, later = (hs.sweep(model, {"N": [3.0]}, words, after=3) for model in (first, second))
    assert [alone[word][0] for word in words] == [later[word][0] for word in words]


@pytest.mark.parametrize(
    ("given", "said"),
    [({"t_span": (0, 1)}, "`t_span` and `after` cannot be combined"), ({"warm_start": True}, "warm_start")],
)
def test_what_does_not_go_with_the_last_period(given: dict, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        hs.sweep("dfcs", {"F0": [30]}, ["amplitude.x"], after=3, **given)


def test_a_long_run_ends_where_the_sweep_is_to_end() -> None:
    system = system_of(hs.load("dfcs").validate())
    values = np.array([[*system.values.values()]])
    start = np.zeros((1, 2))
    done = {
        answer: [
            last.numbers.tolist()
            for last in last_periods(Ensemble(system, lambda a=answer: a), values, start, 10_000)
        ]
        for answer in (False, True)
    }
    assert done == {False: [[]], True: [[0]]}
