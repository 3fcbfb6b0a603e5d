"""Bad model files: exit code 3, a message with place, value and remedy, no traceback, and no code is run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import hybridsim as hs

GOOD = """\
schema = 1
name = "swing"

[parameters]
m = 1.0
k = "4*m"
mu = 0.3
N = 2.0

[states]
x = { start = 1, der = "v" }
v = { start = 0, der = "(-k*x - f)/m" }

[contacts.f]
velocity = "v"
normal = "N"
law = { name = "coulomb", mu = "mu" }
"""

THERMOSTAT = """\
schema = 1
name = "room"

[states]
T = { start = 20, der = "u - T/10" }

[modes.on]
initial = true
set = { u = "3" }
guards.hot = { expr = "22 - T", then = [{ to = "off" }] }

[modes.off]
set = { u = "0" }
guards.cold = { expr = "T - 18", then = [{ to = "on" }] }
"""


def swapped(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new)


# name -> (the file, what the message must hold beside file and line, the line it must name or None)
BAD = {
    "unknown name": (swapped(GOOD, "(-k*x - f)/m", "(-k*x - f)/mm"), ["mm", "did you mean"], 12),
    "unknown function": (swapped(GOOD, '"v" }', '"sine(v)" }'), ["sine", "sin"], 11),
    "unknown key": (swapped(GOOD, "start = 1", "strat = 1"), ["strat", "start"], 11),
    "unknown table": (GOOD + "\n[contatcs.g]\nvelocity = 'v'\n", ["contatcs", "contacts"], 19),
    "wrong type": (swapped(GOOD, "m = 1.0", "m = [1, 2]"), ["[1, 2]"], 5),
    "date for a number": (swapped(GOOD, "m = 1.0", "m = 2026-01-01"), ["2026"], 5),
    "missing der": (swapped(GOOD, "x = { start = 1, ", "y = { start = 1 }\nx = { start = 1, "), ["y"], 11),
    "missing mode": (swapped(THERMOSTAT, 'to = "off"', 'to = "of"'), ["of", "off"], 10),
    "guard of a mode that does not exist": (
        THERMOSTAT + '\n[modes.offf]\nguards.cold = { expr = "T - 18", then = [{ to = "on" }] }\n',
        ["offf", "u"],
        None,
    ),
    "two initial modes": (
        swapped(THERMOSTAT, "[modes.off]", "[modes.off]\ninitial = true"),
        ["on", "off"],
        None,
    ),
    "no initial mode": (swapped(THERMOSTAT, "initial = true\n", ""), ["initial"], None),
    "circle among parameters": (swapped(GOOD, "m = 1.0", 'm = "k/4"'), ["m", "k"], None),
    "attribute access": (swapped(GOOD, '"v" }', '"v.__class__.__base__" }'), ["v.__class__"], 11),
    "call injection": (
        swapped(GOOD, '"v" }', """"__import__('pathlib').Path('canary').touch()" }"""),
        ["__import__"],
        11,
    ),
    "lambda": (swapped(GOOD, '"v" }', """"(lambda: open('canary', 'w'))()" }"""), ["lambda"], 11),
    "comprehension": (swapped(GOOD, '"v" }', """"[open('canary', 'w') for i in (1,)]" }"""), ["open"], 11),
    "walrus": (swapped(GOOD, '"v" }', '"(q := v)" }'), ["q := v"], 11),
    "power bomb": (swapped(GOOD, '"v" }', '"v + 9**9**9**9" }'), ["9**9"], 11),
    "power bomb in a parameter": (swapped(GOOD, "m = 1.0", 'm = "2**10**10"'), ["2**10**10"], 5),
    "nested nine hundred deep": (
        swapped(GOOD, '"v" }', '"' + "(" * 900 + "v" + ")" * 900 + '" }'),
        ["nested"],
        11,
    ),
    "a hundred kilobytes of expression": (
        swapped(GOOD, '"v" }', '"v' + "+1" * 50_000 + '" }'),
        ["characters"],
        11,
    ),
    "a number of a hundred thousand digits": (
        swapped(GOOD, '"v" }', '"v + ' + "9" * 100_000 + '" }'),
        ["characters"],
        11,
    ),
    "not an expression": (swapped(GOOD, '"v" }', '"v +* 2" }'), ["v +* 2"], 11),
    "caret for power": (swapped(GOOD, '"v" }', '"v^2" }'), ["**"], 11),
    "NaN parameter": (swapped(GOOD, "m = 1.0", "m = nan"), ["m", "nan"], 5),
    "infinite start": (swapped(GOOD, "start = 1", "start = inf"), ["inf"], 11),
    "division by zero in a parameter": (swapped(GOOD, '"4*m"', '"4/(m - 1)"'), ["4/(m - 1)"], 6),
    "root of a negative parameter": (swapped(GOOD, '"4*m"', '"sqrt(-m)"'), ["sqrt(-m)"], 6),
    "negative normal load": (swapped(GOOD, "N = 2.0", "N = -2.0"), ["N", "-2"], None),
    "unknown friction law": (swapped(GOOD, '"coulomb"', '"coulom"'), ["coulom", "coulomb"], 17),
    "unknown argument of a law": (swapped(GOOD, 'mu = "mu" }', 'mu = "mu", nu = "mu" }'), ["nu"], 17),
    "two things of one name": (swapped(GOOD, "mu = 0.3", "mu = 0.3\nx = 2"), ["x"], None),
    "reserved name": (swapped(GOOD, "mu = 0.3", "mu = 0.3\npi = 3"), ["pi"], 8),
    "newer schema": (swapped(GOOD, "schema = 1", "schema = 99"), ["99"], 1),
    "no states": ('schema = 1\nname = "none"\n', ["state"], None),
    "empty file": ("", ["empty"], None),
    "invalid TOML": ("states = { x = ", ["TOML"], 1),
    "twice the same key": (swapped(GOOD, "mu = 0.3", "mu = 0.3\nmu = 0.4"), ["mu"], 8),
}


def said(text: str) -> str:
    """A message without its line breaks."""
    return " ".join(text.split())


@pytest.mark.parametrize("case", BAD)
def test_bad_model(case: str, hybridsim: Callable, tmp_path: Path) -> None:
    text, fragments, line = BAD[case]
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    code, out, err = hybridsim("check", path)
    assert code == 3
    assert out == ""
    assert "Traceback" not in err and "internal error" not in err
    assert "bad.toml" in err
    if line is not None:
        assert f"bad.toml:{line}" in err
    assert all(fragment in said(err) for fragment in fragments), err
    assert len(err) < 5000
    assert not (tmp_path / "canary").exists()

    with pytest.raises(hs.ModelError) as caught:
        hs.load(str(path))
    for error in caught.value.errors:
        assert error.remedy, f"no remedy: {error}"
        assert error.place is not None and error.place.file is not None, f"no place: {error}"


@pytest.mark.parametrize("command", ["run", "compare"])
def test_other_commands_refuse_alike(command: str, hybridsim: Callable, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(BAD["unknown name"][0], encoding="utf-8")
    code, out, err = hybridsim(command, path, "--t-end", "1")
    assert code == 3
    assert out == ""
    assert "bad.toml:12" in err and "mm" in err


def test_all_faults_are_reported_together(hybridsim: Callable, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    text = swapped(swapped(GOOD, "(-k*x - f)/m", "(-k*x - f)/mm"), "start = 1", "start = 'nn'")
    path.write_text(text, encoding="utf-8")
    code, _, err = hybridsim("check", path)
    assert code == 3
    assert "bad.toml:12" in err and "bad.toml:11" in err


def test_binary_file(hybridsim: Callable, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(bytes(range(256)) * 4)
    code, _, err = hybridsim("check", path)
    assert code == 3
    assert "bad.toml" in err and "UTF-8" in err


def test_program_in_place_of_a_model(hybridsim: Callable, tmp_path: Path) -> None:
    path = tmp_path / "scene.py"
    path.write_text("open('canary', 'w').close()\n", encoding="utf-8")
    code, _, err = hybridsim("run", path)
    assert code in (2, 3)
    assert "scene.py" in err
    assert not (tmp_path / "canary").exists()


def test_huge_file_is_refused_before_it_is_read(hybridsim: Callable, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    with path.open("wb") as file:
        file.truncate(3 << 30)  # sparse: takes no room on disk
    code, _, err = hybridsim("check", path)
    assert code == 3
    assert "bad.toml" in err and str(3 << 30) in err


@pytest.mark.parametrize("name", ["GOOD", "THERMOSTAT"])
def test_the_models_that_the_bad_ones_are_made_from_are_good(
    name: str, hybridsim: Callable, tmp_path: Path
) -> None:
    path = tmp_path / "good.toml"
    path.write_text({"GOOD": GOOD, "THERMOSTAT": THERMOSTAT}[name], encoding="utf-8")
    code, out, err = hybridsim("check", path)
    assert code == 0, err
    assert "mode" in out
