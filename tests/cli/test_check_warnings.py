"""`check` warns on stderr and in JSON, and still succeeds."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

ODD = """schema = 1
name = "odd"
[states]
x = { start = 0, der = "1" }
[modes.a]
initial = true
guards.g = { expr = "(x - 1)**2", then = "b" }
[modes.b]
"""


def test_a_warning_names_file_line_and_remedy(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "odd.toml").write_text(ODD)
    code, out, err = hybridsim("check", "odd.toml")
    assert code == 0
    assert "mode a" in out
    assert err.startswith("hybridsim: warning: odd.toml:7: guard g of mode a")
    assert "never fires" in err and "write an expression" in err


def test_warnings_as_json(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "odd.toml").write_text(ODD)
    code, out, _ = hybridsim("check", "odd.toml", "--json")
    (warning,) = json.loads(out)["warnings"]
    assert code == 0
    assert (warning["file"], warning["line"]) == ("odd.toml", 7)
    assert "never fires" in warning["message"] and warning["remedy"]


UNITS = """schema = 1
name = "units"
[parameters]
k = { value = 40, unit = "N/mm" }
m = { value = 1, unit = "kg" }
[states]
x = { start = 1e-3, unit = "m", der = "v" }
v = { start = 0, unit = "m/s", der = "-k*x/m" }
"""


def test_a_run_warns_of_units_that_disagree(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "units.toml").write_text(UNITS)
    code, _, err = hybridsim("run", "units.toml", "--t-end", "1")
    warned = [line for line in err.splitlines() if "warning: " in line]
    assert code == 0
    assert len(warned) == 1 and "units.toml:8" in warned[0]


def test_a_sound_model_leaves_stderr_empty(hybridsim: Callable) -> None:
    code, out, err = hybridsim("check", "dfcs", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["warnings"] == []


CORNERED = """schema = 1
name = "cornered"
[states]
x = { start = 1, der = "v" }
v = { start = 0, der = "-abs(x) - sign(v) - (2 if x == 0.5 else 1)" }
"""


def test_corners_and_jumps_are_accounted_for(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "cornered.toml").write_text(CORNERED)
    code, out, _ = hybridsim("check", "cornered.toml")
    assert code == 0
    assert "abs(x) in state v: two modes, continuous at the change of mode" in out
    assert "sign(v) in state v: a jump at the switching surface sign(v)" in out
    assert "2 if x == 0.5 else 1 in state v: not replaced by modes, it jumps" in out
    primitives = json.loads(hybridsim("check", "cornered.toml", "--json")[1])["primitives"]
    assert [(one["text"], one["became"], one["line"]) for one in primitives] == [
        ("abs(x)", "component", 5),
        ("sign(v)", "surface", 5),
        ("2 if x == 0.5 else 1", "kept", 5),
    ]


def test_a_run_warns_of_a_jump_before_it_begins_and_once(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(
        'schema = 1\nname = "c"\n[states]\nx = { start = 1, der = "v" }\n'
        'v = { start = 0, der = "-x if x != 0.5 else -2*x" }\n'
    )
    _, _, err = hybridsim("run", "c.toml", "--t-end", "1e6", "--limit", "steps=300")
    assert err.index("is not treated as a switching surface") < err.index("300 steps")
    assert err.count("is not treated as a switching surface") == 1


NOTED = """schema = 1
name = "noted"
[parameters]
a = 0.1
b = 0.2
k = 1000
[states]
x = { start = "a + b", der = "w" }
y = { start = -1, der = "-y" }
u = { start = 1, der = "-f" }
w = { start = 0, der = "q - g" }
[contacts.f]
velocity = "u - 1"
normal = "k*max(-y, 0)"
law = { name = "coulomb", mu = 0.3 }
[contacts.g]
velocity = "w + 1"
normal = "y"
opens = true
law = { name = "coulomb", mu = 0.3 }
[impacts.q]
gap = "x - a - b"
restitution = 0
[modes.one]
initial = true
guards.even = { expr = "x - (a + b)", then = "two" }
guards.bent = { expr = "abs(x) - 0.2", then = "two" }
[modes.two]
"""


def test_starts_on_a_guard_and_loads_that_can_vanish_are_noted(hybridsim: Callable, tmp_path: Path) -> None:
    """In doubles 0.1 + 0.2 less 0.1 less 0.2 is not zero, but within the rounding of the start."""
    (tmp_path / "noted.toml").write_text(NOTED)
    code, out, _ = hybridsim("check", "noted.toml", "--json")
    assert code == 0
    assert json.loads(out)["notes"] == [
        "the relative velocity of contact f (u - 1) is zero at the start: the forces decide whether the contact sticks",
        "the gap of impact q (x - a - b) is zero at the start: its time derivatives decide whether the gap is closed",
        "guard even of mode one, component mode (x - (a + b)) is zero at the start: "
        "its first nonzero time derivative decides whether the guard fires immediately",
        "the normal load of contact f (k*max(-y, 0)) can reach zero: friction is then zero until the load is positive "
        "again",
        "the normal load of contact g (y) can become negative: the contact opens when the load reaches zero",
    ]
    text = hybridsim("check", "noted.toml")[1]
    assert "\nnotes\n  the relative velocity of contact f (u - 1) is zero at the start" in text
    assert "abs(x) in guard bent of mode one of mode: two modes, continuous at the change of mode" in text


def test_a_start_off_its_guards_has_no_notes(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "off.toml").write_text(ODD)
    assert json.loads(hybridsim("check", "off.toml", "--json")[1])["notes"] == []
