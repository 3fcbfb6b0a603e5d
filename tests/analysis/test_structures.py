"""Steady states of mechanical systems: against closed forms, the ordinary model and a time stepper."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numba import njit
from scipy import sparse

import hybridsim as hs
from hybridsim.analysis.extrapolation.growth import grows
from hybridsim.analysis.extrapolation.settling import Settling
from hybridsim.analysis.structures.period_map import PeriodMap
from hybridsim.errors import SimulationError, UsageError

_FORCE, _PHASE, _DAMPING = 2.0, 0.3, 0.1


def limits(n: int) -> np.ndarray:
    """The friction limit of each block."""
    return 0.4 * (1.0 + 0.3 * np.sin(np.arange(n)))


def chain(n: int, omega: float) -> hs.MechanicalSystem:
    """A chain of n blocks on the ground, each forced and with friction."""
    beside = np.full(n - 1, -1.0)
    contacts = [
        hs.MechanicalContact(f"f{i + 1}", {i: 1.0}, 1.0, "coulomb", {"mu": mu})
        for i, mu in enumerate(limits(n).tolist())
    ]
    return hs.MechanicalSystem(
        np.ones(n),
        np.full(n, _DAMPING),
        sparse.diags_array([np.full(n, 3.0), beside, beside], offsets=[0, 1, -1]),
        {i: hs.Harmonic(omega, sin=_FORCE * math.cos(_PHASE * i)) for i in range(n)},
        contacts,
    )


@njit
def stepped(n: int, omega: float, limit: Any, steps: int, periods: int) -> Any:
    """Half the range of each block over the last period, by leapfrog steps with the friction of each step."""
    q, v = np.zeros(n), np.zeros(n)
    low, high = np.full(n, np.inf), np.full(n, -np.inf)
    h = 2.0 * math.pi / omega / steps
    for k in range(steps * periods):
        drive = math.sin(omega * h * (k % steps))
        for i in range(n):
            left = q[i - 1] if i > 0 else 0.0
            right = q[i + 1] if i < n - 1 else 0.0
            force = _FORCE * math.cos(_PHASE * i) * drive - 3.0 * q[i] + left + right
            free = (v[i] * (1.0 - 0.5 * h * _DAMPING) + h * force) / (1.0 + 0.5 * h * _DAMPING)
            slowed = max(abs(free) - h * limit[i] / (1.0 + 0.5 * h * _DAMPING), 0.0)
            v[i] = slowed if free > 0.0 else -slowed
        for i in range(n):
            q[i] += h * v[i]
            if k >= steps * (periods - 1):
                low[i], high[i] = min(low[i], q[i]), max(high[i], q[i])
    return 0.5 * (high - low)


@pytest.mark.parametrize("omega", [0.6, 1.0, 1.5, 2.0, 2.6])
def test_a_chain_of_fifty_agrees_with_a_time_stepper(omega: float) -> None:
    """The amplitudes are those that refined steps from rest end with."""
    steady = hs.steady_state(chain(50, omega), max_periods=1500)
    assert steady.kind == "periodic"
    found = np.array([steady.amplitude[f"q{i + 1}"] for i in range(50)])
    expected = stepped(50, omega, limits(50), 32000, 150)
    assert np.abs(found - expected).max() <= 1e-4 * expected.max()


def test_a_contact_that_slips_less_in_each_period_is_followed_to_its_limit() -> None:
    """Plain periods approach the limit like 1/k, so that it follows from the states after some k periods."""
    system = chain(50, 0.5 + 187 * 2.2 / 199)
    steady = hs.steady_state(system, max_periods=1200)
    assert steady.kind == "periodic"
    plain = PeriodMap(system, 2.0 * math.pi / system.forcing[0][0].omega, np.zeros(100), 1e-12)
    counts = [200, 400, 800, 1600]
    states = []
    for k in range(1, counts[-1] + 1):
        plain.advance()
        if k in counts:
            states.append(plain.x)
    powers = 1.0 / np.array(counts)[:, None] ** np.arange(4)
    limit = np.linalg.solve(powers, np.array(states))[0]
    found = np.array(list(steady.start.values()))
    size = max(steady.amplitude[f"q{i + 1}"] for i in range(50))
    assert np.abs(states[-1] - limit).max() > 1e-5 * size
    assert np.abs(found - limit).max() <= 1e-6 * size


def test_three_blocks_agree_with_the_ordinary_model() -> None:
    """All readings are those of `to_model`, whose events and orbits are found by other code."""
    system = chain(3, 1.2).with_(forcing=[hs.Harmonic(1.2, sin=1.0), (0.1, hs.Harmonic(2.4, cos=0.3)), 0.0])
    one, other = hs.steady_state(system), hs.steady_state(system.to_model())
    assert one.period == pytest.approx(other.period, rel=1e-12)
    for name in ("q1", "q2", "q3", "v1", "v3"):
        assert one.amplitude[name] == pytest.approx(other.amplitude[name], rel=1e-9)
        assert one.peak[name] == pytest.approx(other.peak[name], rel=1e-9)
        assert one.energy[name] == pytest.approx(other.energy[name], rel=1e-9)
        assert one.mean[name] == pytest.approx(other.mean[name], rel=1e-9, abs=1e-9)
        assert abs(one.harmonic(name, 3) - other.harmonic(name, 3)) <= 1e-9
    sticks = 0.0
    for contact in ("f1", "f2", "f3"):
        assert one.stick_fraction[contact] == pytest.approx(other.stick_fraction[contact], abs=1e-8)
        assert one.dissipated[contact] == pytest.approx(other.dissipated[contact], rel=1e-8, abs=1e-12)
        assert one.stops_per_period[contact] == other.stops_per_period[contact]
        assert one.solution.dissipated[contact] == pytest.approx(one.dissipated[contact], rel=1e-8, abs=1e-12)
        sticks += one.stick_fraction[contact]
    assert 0.0 < sticks < 3.0


def test_the_response_of_one_block_is_that_of_den_hartog() -> None:
    """Without stops, the amplitude has the closed form of J. P. Den Hartog, Trans. ASME 53 (1931) 107."""
    for r in (0.7, 0.8, 1.3):
        mu = 0.2
        contact = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": mu})
        system = hs.MechanicalSystem([1.0], None, [1.0], [hs.Harmonic(r, sin=1.0)], [contact])
        steady = hs.steady_state(system)
        v = 1.0 / (1.0 - r * r)
        u = math.sin(math.pi / r) / (r * (1.0 + math.cos(math.pi / r)))
        assert steady.stops_per_period["f"] == 0.0
        assert steady.amplitude["q1"] == pytest.approx(math.sqrt(v * v - (mu * u) ** 2), rel=1e-9)


@pytest.mark.parametrize("mu", [0.1, 0.2])
def test_one_block_at_half_its_frequency_approaches_a_motion_without_stops(mu: float) -> None:
    """The block stops for a shorter time in each period; in Den Hartog's limit the amplitude is 1 / (1 - r^2)."""
    contact = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": mu})
    system = hs.MechanicalSystem([1.0], None, [1.0], [hs.Harmonic(0.5, sin=1.0)], [contact])
    steady = hs.steady_state(system)
    assert steady.kind == "periodic"
    assert steady.amplitude["q1"] == pytest.approx(4.0 / 3.0, rel=1e-8)
    assert steady.stick_fraction["f"] <= 1e-3
    ordinary = hs.steady_state(system.to_model())
    assert ordinary.kind == "periodic"
    assert ordinary.amplitude["q1"] == pytest.approx(4.0 / 3.0, rel=1e-8)


def marginal(seed: int) -> hs.MechanicalSystem:
    """One to three blocks with random Coulomb contacts. Some of these hardly slip, or hold for ever after a while."""
    r = np.random.default_rng(seed)
    n = int(r.integers(1, 4))
    M, k = r.uniform(0.5, 2, n), r.uniform(0.5, 3, n + 1)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    C, omega = 10 ** r.uniform(-3, -0.5) * K, r.uniform(0.3, 2.5)
    unit = 10.0 ** r.integers(-9, 10) if r.random() < 0.3 else 1.0
    forces: list[Any] = []
    for i in range(n):
        if i == 0 or r.random() < 0.4:
            forces.append(hs.Harmonic(omega, sin=unit * r.uniform(0.3, 2)))
        else:
            forces.append(unit * r.uniform(-0.3, 0.3) if r.random() < 0.3 else 0.0)
    contacts = []
    for i in range(n):
        if r.random() < 0.8:
            direction = {i: 1.0} if i == 0 or r.random() < 0.5 else {i - 1: -1.0, i: 1.0}
            mu = {"mu": float(r.uniform(0.02, 0.8))}
            base = unit * 0.2 if r.random() < 0.2 else 0.0
            contacts.append(hs.MechanicalContact(f"f{i}", direction, unit, "coulomb", mu, base=base))
    return hs.MechanicalSystem(M, C, K, forces, contacts)


@pytest.mark.parametrize("seed", [25, 135, 179, 245, 307, 323])
def test_contacts_that_hardly_slip_settle_in_the_ordinary_model_too(seed: int) -> None:
    """The kind, the number of periods and the amplitudes are those of the structure, whose runs are other code."""
    system = marginal(seed)
    one, other = hs.steady_state(system), hs.steady_state(system.to_model())
    assert (one.kind, one.multiple) == (other.kind, other.multiple)
    size = max(other.peak[name] for name in system.names)
    for name in system.names:
        assert abs(one.amplitude[name] - other.amplitude[name]) <= 1e-8 * size


@pytest.mark.parametrize(("seed", "stuck"), [(245, "f1"), (307, "f2")])
def test_a_slip_that_is_one_step_long_is_not_slight(seed: int, stuck: str) -> None:
    """The velocity of such a slip is zero at both ends of the step. All contacts but one really slip."""
    system = marginal(seed)
    for model in (system, system.to_model()):
        found = hs.steady_state(model)
        assert found.kind == "periodic" and "slips by less" not in found.message
        assert [name for name, part in found.stick_fraction.items() if part == 1.0] == [stuck]
        assert found.amplitude["q1"] > 1e-3


@pytest.mark.parametrize("tol", [1e-8, 1e-10, 1e-12])
def test_a_contact_of_a_structure_whose_slips_vanish_sticks(tol: float) -> None:
    """The force of contact g reaches its limit once in a period. A plain run ends with stick."""
    law = {"mu_s": 0.8146, "mu_k": 0.4888, "v_s": 0.2}
    system = hs.MechanicalSystem(
        [1.0, 0.3742],
        [0.1319, 0.1319],
        [[3.021, -2.021], [-2.021, 2.321]],
        [hs.Harmonic(0.2625, sin=0.8041), 0.0],
        [
            hs.MechanicalContact("f", {0: 1.0}, 0.7988, "stribeck", law),
            hs.MechanicalContact("g", {1: 1.0}, 0.6414, "stribeck", law),
        ],
        q0=[-1.725, 0.0],
    )
    period = 2.0 * math.pi / 0.2625
    plain = hs.simulate(system.to_model(), (0, 100 * period), integrator="dop853", rtol=1e-11)
    assert abs(plain(100 * period)[2] - plain(40 * period)[2]) < 1e-12
    found = hs.steady_state(system, tol=tol)
    assert found.kind == "periodic" and "slips by less" not in found.message
    assert found.stick_fraction["g"] == 1.0


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
@pytest.mark.parametrize(
    ("direction", "constant"), [({0: -1.0, 1: 1.0}, 0.2), ({0: -1.0, 1: 1.0}, 0.0), ({1: 1.0}, 0.2)]
)
def test_a_structure_that_only_creeps_by_rounding_rests(
    direction: dict[int, float], constant: float, unit: float
) -> None:
    """Both contacts hold 20 times the largest force, so that nothing moves."""
    system = hs.MechanicalSystem(
        [1.0, 2.0],
        [[0.1, -0.02], [-0.02, 0.08]],
        [[3.0, -1.0], [-1.0, 2.0]],
        [hs.Harmonic(1.3, sin=2.0 * unit, cos=0.3 * unit), constant * unit],
        [
            hs.MechanicalContact("f1", {0: 1.0}, 100.0 * unit, "coulomb", {"mu": 0.4}),
            hs.MechanicalContact("f2", direction, 100.0 * unit, "coulomb", {"mu": 0.4}),
        ],
    )
    steady = hs.steady_state(system, max_periods=200)
    assert (steady.kind, steady.stick_fraction["f1"], steady.stick_fraction["f2"]) == (
        "equilibrium",
        1.0,
        1.0,
    )
    assert steady.amplitude["q2"] <= 1e-12 * unit


@pytest.mark.parametrize(("damping", "rests"), [(0.12, False), (0.134, False), (0.15, True)])
def test_a_block_on_a_belt_rests_only_if_its_damping_exceeds_the_slope_of_friction(
    damping: float, rests: bool
) -> None:
    """At rest the force falls with the speed of the belt, by 0.138 per unit; the other block always sticks."""
    mu_s, mu_k, v_s, speed = 0.4, 0.2, 0.3, 0.5
    law = {"mu_s": mu_s, "mu_k": mu_k, "v_s": v_s}
    system = hs.MechanicalSystem(
        [1.0, 1.0],
        [0.0, damping],
        [1.0, 1.0],
        [hs.Harmonic(1.0, sin=0.3), 0.0],
        [
            hs.MechanicalContact("f1", {0: 1.0}, 1.0, "coulomb", {"mu": 0.5}),
            hs.MechanicalContact("f2", {1: 1.0}, 1.0, "stribeck", law, base=speed),
        ],
    )
    bell = math.exp(-((speed / v_s) ** 2))
    assert (damping > 2.0 * (mu_s - mu_k) * bell * speed / v_s**2) is rests
    steady = hs.steady_state(system, x0={"q2": mu_k + (mu_s - mu_k) * bell + 1e-3}, max_periods=300)
    assert (steady.kind == "equilibrium") is rests


def test_a_structure_without_contacts_has_the_linear_response() -> None:
    """The amplitude is that of the complex stiffness; the period is common to both forces."""
    M, C, K = np.diag([1.0, 2.0]), np.array([[0.2, -0.1], [-0.1, 0.3]]), np.array([[3.0, -1.0], [-1.0, 2.0]])
    forces = [hs.Harmonic(1.0, sin=1.0), hs.Harmonic(1.5, cos=0.5)]
    steady = hs.steady_state(hs.MechanicalSystem(M, C, K, forces))
    assert steady.period == pytest.approx(4.0 * math.pi, rel=1e-15)
    for k, w, force in ((2, 1.0, [1.0, 0.0]), (3, 1.5, [0.0, 0.5])):
        expected = np.abs(np.linalg.solve(K - w * w * M + 1j * w * C, force))
        for i in range(2):
            assert abs(steady.harmonic(f"q{i + 1}", k)) == pytest.approx(expected[i], rel=1e-9)


def test_a_force_below_the_friction_limit_moves_nothing() -> None:
    """The motion is an equilibrium, and the contact sticks all the time."""
    contact = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": 0.5})
    system = hs.MechanicalSystem([1.0], None, [1.0], [hs.Harmonic(1.0, sin=0.4)], [contact])
    steady = hs.steady_state(system)
    assert (steady.kind, steady.stick_fraction["f"], steady.amplitude["q1"]) == ("equilibrium", 1.0, 0.0)
    assert "multipliers" in steady.to_dict()["no_multipliers"]
    with pytest.raises(UsageError, match="sensitivities"):
        steady.sensitivities()


def test_a_frequency_response_is_the_steady_states_over_omega() -> None:
    """Frequency, load and base are set by name; other frequencies keep their ratio to the lowest one."""
    system = chain(2, 1.0).with_(forcing=[hs.Harmonic(1.0, sin=2.0), hs.Harmonic(2.0, sin=1.0)])
    found = hs.frequency_response(system, [0.8, 1.7], {"normal": [1.0, 1.5]}, quantity="q2")
    assert found.dimensions == ("normal", "omega") and not found.failed.any()
    for i, load in enumerate((1.0, 1.5)):
        for j, omega in enumerate((0.8, 1.7)):
            own = system.with_(
                forcing=[hs.Harmonic(omega, sin=2.0), hs.Harmonic(2.0 * omega, sin=1.0)],
                contacts=[
                    hs.MechanicalContact(f"f{k + 1}", {k: 1.0}, load, "coulomb", {"mu": mu})
                    for k, mu in enumerate(limits(2).tolist())
                ],
            )
            alone = hs.steady_state(own)
            assert found["amplitude.q2"][i, j] == pytest.approx(alone.amplitude["q2"], rel=1e-9)
            assert found["stick_fraction.f1"][i, j] == pytest.approx(alone.stick_fraction["f1"], abs=1e-9)


def test_a_sweep_reads_coordinates_contacts_and_starts() -> None:
    """Warm starts and named readings work as for a model, and a failed point names its reason."""
    system = chain(2, 1.3)
    names = ["amplitude.q1", "dissipated.f2", "peak.v_rel(f1)", "kind"]
    one = hs.sweep(system, {"f1.mu": [0.3, 0.4]}, names, warm_start=True)
    other = hs.sweep(system, {"f1.mu": [0.3, 0.4], "q1": [0.5, 0.5]}, names, mode="list")
    for name in names[:-1]:
        assert one[name] == pytest.approx(other[name], rel=1e-8)
    assert one.to_dict()["provenance"]["parameters"]["f2.mu"] == limits(2)[1]
    spent = hs.sweep(
        system, {"f1.mu": [0.3]}, [f"mode_fraction.f1.{mode}" for mode in ("stick", "slip+", "slip-")]
    )
    assert sum(float(part[0]) for part in spent.values.values()) == pytest.approx(1.0, abs=1e-12)
    last = hs.sweep(system, {"q1": [0.5]}, "final", t_span=(0, 1))["final.v2"]
    assert last[0] == hs.simulate(system, (0, 1), x0={"q1": 0.5}).x_end[3]
    with pytest.raises(UsageError, match="maximum"):
        hs.sweep(system, {"q1": [0.5]}, "maximum.q1", t_span=(0, 1))
    failed = hs.sweep(system, {"f1.normal": [-1.0, 1.0]}, "amplitude.q1")
    assert "f1" in failed.status[0] and failed.status[1] == "ok"


@pytest.mark.parametrize(
    ("system", "options", "part"),
    [
        (chain(2, 1.0).with_(forcing=None), {}, "no harmonic force"),
        (chain(2, 1.0).with_(forcing=[hs.Harmonic(1.0, 1.0), hs.Harmonic(math.sqrt(2), 1.0)]), {}, "common"),
        (chain(2, 1.0), {"integrator": "moreau"}, "moreau"),
        (chain(2, 1.0), {"z0": {"f1": "stick"}}, "z0"),
        (chain(2, 1.0), {"period": 1.0}, "period"),
        (chain(2, 1.0), {"params": {"f3.mu": 1.0}}, "f3.mu"),
        (hs.chain_on_belt(2, gap=2.0), {}, "impacts"),
    ],
)
def test_what_has_no_steady_state_is_refused(
    system: hs.MechanicalSystem, options: dict[str, Any], part: str
) -> None:
    """The message names the argument or the cause."""
    with pytest.raises(UsageError, match=part):
        hs.steady_state(system, **options)


def test_a_motion_that_drifts_is_not_settled() -> None:
    """A block without a spring, under a force with a mean above friction, never returns."""
    contact = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": 0.1})
    system = hs.MechanicalSystem([1.0], [0.5], None, [(0.3, hs.Harmonic(1.0, sin=1.0))], [contact])
    steady = hs.steady_state(system, max_periods=200)
    assert steady.kind == "not settled" and "q1 drifts" in steady.message
    with pytest.raises(UsageError, match="not settled"):
        steady.amplitude["q1"]


def test_a_motion_that_only_settles_slowly_does_not_drift() -> None:
    """With hardly any damping the states still change after a few periods, but return to where they were."""
    system = hs.MechanicalSystem([1.0], [1e-5], [1.0], [hs.Harmonic(0.5, sin=1.0)])
    steady = hs.steady_state(system, max_periods=32, x0=[1.0, 0.0])
    assert steady.kind == "not settled" and "drifts" not in steady.message


class _Logistic:
    """A map x -> r x (1 - x) in the place of a `PeriodMap`, beside a decaying velocity."""

    def __init__(self, r: float, x: float = 0.3) -> None:
        self.r, self.periods, self.period = r, 0, 1.0
        self.x, self.modes, self.changes = np.array([x, 1.0]), np.zeros(0, dtype=np.int64), b"same"
        self.slips = dict[tuple[int, int], int]()

    def snapshot(self) -> tuple[np.ndarray, ...]:
        return (self.x.copy(),)

    def restore(self, snapshot: tuple[np.ndarray, ...]) -> None:
        self.x = snapshot[0].copy()

    def put(self, x: np.ndarray) -> None:
        self.x = x.copy()

    def advance(self) -> np.ndarray:
        self.x = np.array([self.r * self.x[0] * (1.0 - self.x[0]), 0.9 * self.x[1]])
        self.periods += 1
        return self.x

    def measure(self) -> tuple[np.ndarray, bool]:
        self.advance()
        return np.array([0.5, 0.5]), False


@pytest.mark.parametrize(("r", "multiple"), [(2.9, 1), (2.999, 1), (3.01, 2), (3.2, 2), (3.5, 4)])
def test_extrapolation_does_not_end_on_a_motion_that_repels(r: float, multiple: int) -> None:
    """The fixed point 1 - 1/r of the logistic map repels for r > 3, where a cycle of 2, then 4 periods attracts.

    Its multiplier is 2 - r.
    """
    for x in (0.3, 1.0 - 1.0 / r + 1e-4):
        settled = Settling(_Logistic(r, x), 1e-10, 8, 4096).run(None)
        assert settled.multiple == multiple


@pytest.mark.parametrize(
    ("growth", "expected"), [(1.003, True), (-1.001, True), (1.0, False), (0.999, False)]
)
def test_growth_near_one_is_told_from_a_neutral_direction(growth: float, expected: bool) -> None:
    """The states are multiplied by `growth` and by 0.9, which hides slow growth in the first periods."""

    class Linear(_Logistic):
        def advance(self) -> np.ndarray:
            self.x = np.array([growth, 0.9]) * self.x
            return self.x

    linear: Any = Linear(0.0)
    linear.x = np.zeros(2)
    assert grows(linear, np.ones(2), 1, np.array([0.3, 1.0])) is expected
    assert (linear.x == 0.0).all() is not expected


class _Bounded(_Logistic):
    """A map x -> 0.95 x - 0.05 above 0.1, which seems to lead to -1, and x -> x/2 below; it ends below -1/2."""

    def advance(self) -> np.ndarray:
        x = float(self.x[0])
        if x < -0.5:
            raise SimulationError("the run ended early")
        self.x = np.array([0.95 * x - 0.05 if x > 0.1 else 0.5 * x, 0.9 * self.x[1]])
        self.periods += 1
        return self.x


def test_an_extrapolation_from_which_no_motion_is_possible_is_taken_back() -> None:
    """The plain map goes to 0."""
    settled = Settling(_Bounded(0.0, 1.0), 1e-10, 8, 4096).run(None)
    assert settled.multiple == 1
    assert settled.passings.values[-1] == pytest.approx([0.0, 0.0], abs=1e-9)


class _TwoLimits(_Logistic):
    """A map x -> 0.95 x - 0.05 above 0.1, which seems to lead to -1. Plain runs end at 0; -1 is stable too."""

    def advance(self) -> np.ndarray:
        x = float(self.x[0])
        nearer = 0.95 * x - 0.05 if x > 0.1 else 0.5 * x if x > -0.5 else 0.5 * x - 0.5
        self.x = np.array([nearer, 0.9 * self.x[1]])
        self.periods += 1
        return self.x


@pytest.mark.parametrize("settle", [1, 8, 32])
def test_a_stable_motion_that_plain_periods_do_not_approach_is_not_returned(settle: int) -> None:
    """An extrapolation from the first periods is exactly on the other stable fixed point."""
    settled = Settling(_TwoLimits(0.0, 1.0), 1e-10, settle, 4096).run(None)
    assert settled.multiple == 1
    assert settled.passings.values[-1] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_an_error_without_an_extrapolation_is_raised() -> None:
    with pytest.raises(SimulationError, match="ended early"):
        Settling(_Bounded(0.0, -1.0), 1e-10, 8, 4096).run(None)


def test_an_irregular_motion_on_a_belt_is_followed_to_the_end() -> None:
    """Extrapolations of this motion lead to a speed beyond that of the belt, where its law of slip has no value.

    No return of a plain run of the ordinary model after 1 to 12 periods is closer than a hundredth of its range.
    """
    omega, law = 0.46837251464233887, {"mu_s": 0.4633155482553021, "mu_k": 0.1458705950675895}
    stiffness, mass = 3.365139835572482, 1.0 / 0.822008215171591
    contact = hs.MechanicalContact(
        "f", {0: 1.0}, 1.0, "stribeck", law | {"v_s": 0.14944210120311124}, base=0.2
    )
    system = hs.MechanicalSystem(
        [mass],
        [[0.05687695191018334 * mass]],
        [[stiffness * mass]],
        {0: hs.Harmonic(omega, sin=1.629451451467802 * mass)},
        [contact],
    )
    found = hs.steady_state(system, max_periods=1300)
    period, model = 2.0 * math.pi / omega, system.to_model()
    plain = hs.simulate(model, (0.0, 300.0 * period), integrator="dop853", rtol=1e-10)
    places = plain(period * np.arange(200, 300))[0]
    returns = [np.abs(places[m:] - places[:-m]).max() for m in range(1, 13)]
    assert min(returns) > 0.01 * np.ptp(places) > 0.0
    assert found.kind == "not settled"
