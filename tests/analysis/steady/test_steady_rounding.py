"""What moves by rounding rests, and the sizes of states are those of the motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs

DRILL = """schema = 1
name = "drill"
[parameters]
rpm = 150
Om = "rpm*pi/30"
J = 374
Jt = 2122
k = 473
c = 50
ct = 425
T_s = 6000
T_k = 4000
[states]
twist = {{ start = 0{nominal}, der = "w_top - w_bit" }}
w_top = {{ start = "Om"{nominal}, der = "(ct*(Om - w_top) - k*twist - c*(w_top - w_bit))/Jt" }}
w_bit = {{ start = "Om"{nominal}, der = "(k*twist + c*(w_top - w_bit) - torque)/J" }}
[contacts.torque]
velocity = "w_bit"
normal = "T_k"
law = {{ name = "stribeck", mu_s = "T_s/T_k", mu_k = 1, v_s = 1 }}
"""
BELT = """schema = 1
name = "belt"
[parameters]
belt = 1
[states]
x = { start = 0, der = "v" }
v = { start = 0.5, der = "-x - 0.3*v - f" }
[contacts.f]
velocity = "v - belt"
normal = "1"
law = { name = "stribeck", mu_s = 0.4, mu_k = 0.2, v_s = 0.5 }
"""
SAMPLED = """schema = 1
name = "sampled"
[states]
x = {{ start = {start}, der = "u + sin(2*pi*t)" }}
[discrete]
u = {{ start = 0 }}
[clocks.c]
period = 1
offset = {offset}
set.u = "-{gain}*x"
"""


@pytest.mark.parametrize("nominal", ["", ", nominal = 10"])
@pytest.mark.parametrize("rpm", [60, 100, 150, 200])
def test_a_turning_string_that_does_not_vibrate_is_at_rest(rpm: int, nominal: str) -> None:
    """The twist carries friction and what the drive lets the top fall behind: c_t (Om - w) = k twist = T(w)."""
    found = hs.steady_state(hs.Model.from_toml(DRILL.format(nominal=nominal)).with_(rpm=rpm))
    assert found.kind == "equilibrium"
    omega = rpm * math.pi / 30.0
    if 425.0 * omega < 6000.0:  # the drive cannot tear the bit loose
        assert found.stick_fraction["torque"] == 1.0
        return
    w = omega
    for _ in range(100):
        w = omega - (4000.0 + 2000.0 * math.exp(-(w**2))) / 425.0
    assert found.mean["w_bit"] == pytest.approx(w, rel=1e-9)
    assert found.mean["twist"] == pytest.approx(425.0 * (omega - w) / 473.0, rel=1e-9)


def test_rest_is_rest_in_sweeps() -> None:
    model = hs.Model.from_toml(DRILL.format(nominal=""))
    found = hs.sweep(model, {"rpm": [150, 175, 200]}, measure="kind")
    assert np.ravel(found.values["kind"]).tolist() == ["equilibrium"] * 3


@pytest.mark.parametrize("integrator", ["auto", "dop853", "taylor"])
def test_a_belt_without_units_dies_out_in_sliding(integrator: str) -> None:
    """x = mu(belt) N/k, and v = 0 exactly: nothing else tells how large v is."""
    for belt in (0.9, 1.3):
        found = hs.steady_state(hs.Model.from_toml(BELT).with_(belt=belt), integrator=integrator)
        assert found.kind == "equilibrium"
        assert found.mean["x"] == pytest.approx(0.2 + 0.2 * math.exp(-((belt / 0.5) ** 2)), rel=1e-10)


def test_held_at_rest_under_forcing_is_rest() -> None:
    found = hs.steady_state(hs.load("dfcs").with_(F0=19))
    assert found.kind == "equilibrium" and found.stick_fraction["f"] == 1.0


@pytest.mark.parametrize("offset", [0.0, 0.25])
@pytest.mark.parametrize(("start", "gain"), [(1.0, 1.5), (0.0, 1.5), (1.0, 0.5), (1.0, 1.9)])
def test_sampled_control_of_an_integrator_has_the_period_of_its_clock(
    offset: float, start: float, gain: float
) -> None:
    """From tick to tick x goes to (1 - gain) x and u is forgotten; at the ticks x is zero, and so is u."""
    found = hs.steady_state(hs.Model.from_toml(SAMPLED.format(offset=offset, start=start, gain=gain)))
    assert (found.kind, found.multiple) == ("periodic", 1)
    assert found.period == pytest.approx(1.0, rel=1e-14)
    assert found.multipliers == pytest.approx([1.0 - gain, 0.0], abs=1e-9)
    # x = (cos(2 pi offset) - cos(2 pi t))/(2 pi)
    assert found.amplitude["x"] == pytest.approx(0.5 / math.pi, rel=1e-9)
    assert found.mean["x"] == pytest.approx(math.cos(2.0 * math.pi * offset) / (2.0 * math.pi), abs=1e-10)


def test_a_state_that_dies_out_beside_a_forced_one_is_no_transient() -> None:
    states = [hs.State("x", 1.0, "-0.01*x"), hs.State("y", 0.0, "-y + sin(t)")]
    found = hs.steady_state(hs.Model("pair", states=states))
    assert (found.kind, found.multiple) == ("periodic", 1)
    assert found.amplitude["y"] == pytest.approx(math.sqrt(0.5), rel=1e-9)
    assert found.multipliers == pytest.approx([math.exp(-0.02 * math.pi), math.exp(-2.0 * math.pi)], rel=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_small_motion_about_a_large_offset_is_a_motion(size: float) -> None:
    """A vibration of a millionth of its offset, in any unit, is no rounding."""
    pull = f"-4*(x - {size!r}) - 0.2*v + {1e-6 * size!r}*cos(t)"
    found = hs.steady_state(hs.Model("shaken", states=[hs.State("x", size, "v"), hs.State("v", 0.0, pull)]))
    assert found.kind == "periodic"
    exact = 1e-6 * size / math.hypot(3.0, 0.2)
    assert found.amplitude["x"] == pytest.approx(exact, rel=1e-6)


def beside_a_block_at_rest(load: float, start: float, damping: float, coupling: str = "x1") -> hs.Model:
    """A block that its contact holds, and a mass on a spring to it that comes to rest at load/4."""
    return hs.Model(
        "beside-a-block-at-rest",
        states=[
            hs.State("x1", 0, "v1"),
            hs.State("v1", 0, "0.2*sin(t) - 2*x1 - f"),
            hs.State("x2", start, "v2"),
            hs.State("v2", 0, f"{load} + {coupling} - 4*x2 - {damping}*v2"),
        ],
        contacts=[hs.Contact("f", "v1", 1, law="coulomb", arguments={"mu": 0.5})],
    )


@pytest.mark.parametrize("damping", [0.08, 2.0])
@pytest.mark.parametrize(("load", "start"), [(0.3, 0.0), (0.3, 1.0), (0.0, 1.0), (0.0, 1e-3)])
def test_a_mass_beside_a_held_block_comes_to_rest(load: float, start: float, damping: float) -> None:
    """The force 0.2 sin(t) never exceeds the limit 0.5, so that the block stays at 0 and the mass ends at load/4."""
    found = hs.steady_state(beside_a_block_at_rest(load, start, damping))
    assert found.kind == "equilibrium"
    assert found.solution.y[:, -1] == pytest.approx([0.0, 0.0, load / 4, 0.0], abs=1e-12)


def test_a_motion_that_is_small_relative_to_its_start_stays_a_motion() -> None:
    """A force of 1e-14 sin(2 t) at resonance with the damping 0.5 gives x2 the amplitude 1e-14 / (2 * 0.5)."""
    found = hs.steady_state(beside_a_block_at_rest(0.0, 1.0, 0.5, "1e-14*sin(2*t)"))
    assert found.kind == "periodic"
    assert found.amplitude["x2"] == pytest.approx(1e-14, rel=1e-6)
