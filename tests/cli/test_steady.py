"""`hybridsim steady` where not everything can be read."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest


def test_what_varies_too_fast_is_named_beside_the_others(tmp_path: Path, hybridsim: Callable) -> None:
    """The oscillator x'' + 0.1 x' + x = cos(2 t) has an amplitude of 1/|-3 + 0.2 i|."""
    (tmp_path / "oscillator.toml").write_text(
        'schema = 1\nname = "oscillator"\n'
        '[states]\nx = {start = 0, der = "v"}\nv = {start = 0, der = "-x - 0.1*v + cos(2*t)"}\n'
        '[outputs]\nfast = "sin(1e9*x)"\nsquare = "x**2"\n'
    )
    code, out, err = hybridsim("steady", tmp_path / "oscillator.toml")
    assert code == 0, err
    assert "fast: varies too fast to be measured" in out
    square = next(line.split() for line in out.splitlines() if line.split()[:1] == ["square"])
    assert float(square[3]) == pytest.approx(1.0 / 9.04, rel=1e-5)  # its maximum, in six digits


TWINS = """schema = 1
name = "twins"
[states]
x = { start = 0, der = "1 - x" }
y = { start = 0, der = "1 - y" }
[components.a]
initial = "on"
modes.on.guards.full = { expr = "0.5 - x", then = [{ to = "on", reset = { x = "0" } }] }
[components.b]
initial = "on"
modes.on.guards.full = { expr = "0.5 - y", then = [{ to = "on", reset = { y = "0" } }] }
"""


def test_a_motion_without_multipliers_is_printed_all_the_same(tmp_path: Path, hybridsim: Callable) -> None:
    """Two events at one instant that part when the start is changed: period log 2, and no derivative."""
    (tmp_path / "twins.toml").write_text(TWINS)
    code, out, err = hybridsim("steady", tmp_path / "twins.toml")
    assert code == 0, err
    period = next(line.split()[1] for line in out.splitlines() if line.split()[:1] == ["period"])
    assert float(period) == pytest.approx(math.log(2.0), rel=1e-9)
    assert "unknown: several events" in out
    code, out, err = hybridsim("steady", tmp_path / "twins.toml", "--json")
    record = json.loads(out)
    assert code == 0 and record["multipliers"] is None and record["stable"] is None
    assert "separate after a small change" in record["no_multipliers"]


PAD = """schema = 1
name = "pad"
[states]
x = { start = 0, der = "v", unit = "m", nominal = 1e-3 }
v = { start = 0, der = "-1e5*x - 50*v - f", unit = "m/s", nominal = 1 }
[contacts.f]
velocity = "v - 2"
normal = 2000
law = { name = "measured" }
[laws.measured]
slip = "mu*N"
stick = "mu*N"
tables.mu = { at = [0, 1, 3, 5], values = [0.5, 0.4, 0.3, 0.28] }
"""


def test_an_equilibrium_has_a_sentence_instead_of_a_picture(tmp_path: Path, hybridsim: Callable) -> None:
    """The ball at rest stays where it is put: no disturbance decays."""
    code, out, err = hybridsim("steady", "bouncing-ball", "--plot", tmp_path / "ball.png")
    assert (
        code == 0 and "an equilibrium does not vary over time" in err and not (tmp_path / "ball.png").exists()
    )
    assert "stable       neutrally: some disturbances neither grow nor decay" in out


def test_units_are_printed_and_variables_of_tables_are_not(tmp_path: Path, hybridsim: Callable) -> None:
    (tmp_path / "pad.toml").write_text(PAD)
    code, out, err = hybridsim("steady", tmp_path / "pad.toml")
    assert code == 0, err
    rows = [line.split() for line in out.splitlines() if line]
    assert {tuple(row[:2]) for row in rows} >= {("x", "[m]"), ("v", "[m/s]")}
    assert next(row for row in rows if row[0] == "period")[2] == "s"
    assert next(row for row in rows if row[:2] == ["x", "[m]"])[-1] == "m^2*s"
    assert next(row for row in rows if row[:2] == ["v", "[m/s]"])[-1] == "(m/s)^2*s"
    assert not {"f_v", "f_mu"} & {row[0] for row in rows}
    assert "f_mu" not in out
    assert next(row for row in rows if "work" in row)[-2] == "work"  # the unit of this force is unknown
    code, out, err = hybridsim("steady", "dfcs")
    assert code == 0, err
    assert next(row for row in map(str.split, out.splitlines()) if "work" in row)[-1] == "J"
