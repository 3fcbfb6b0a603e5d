"""What a model's file holds does not steer the terminal that shows it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import hybridsim as hs

# clears the screen, renames the window, turns the text round; C1 controls, too
MODEL = """
name = "calm"
title = "a\\u001b[2Jb\\u001b]0;taken\\u0007c\\u202ed\\u009b31m"
source = "\\u001b[31mred"
look = "\\u001b[1mbold"
duration = 1
[parameters]
k = { value = 1, unit = "\\u001b[5mN" }
[states]
x = { start = 1, der = "-k*x", unit = "\\u001b[5mm\\rm" }
[monitors]
m = "x - 0.5"
"""
STEERING = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


@pytest.mark.parametrize(
    "words",
    [
        ["run", "calm.toml", "--explain", "0"],
        ["run", "calm.toml", "-p", "k\x1b[2J=3"],
        ["run", "calm\x1b[2J.toml"],
        ["check", "calm.toml"],
        ["check", "calm.toml", "--strict\x1b[2J"],
        ["sweep", "calm.toml", "k=1,2", "--measure", "final", "--t-end", "1", "--out", "s"],
        ["compare", "calm.toml", "--integrators", "dop853,taylor", "--out", "c"],
        ["steady", "calm.toml"],
    ],
)
def test_the_command_line(words: list[str], hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "calm.toml").write_text(MODEL)
    _, out, err = hybridsim(*words)
    assert out or err
    assert not STEERING.findall(out) and not STEERING.findall(err.replace("\r", ""))


def test_python(tmp_path: Path) -> None:
    (tmp_path / "calm.toml").write_text(MODEL)
    model = hs.load(tmp_path / "calm.toml")
    sol = hs.simulate(model, (0, 1), integrator="dop853")
    swept = hs.sweep(model, {"k": [1, 2]}, "final", t_span=(0, 1))
    for text in (repr(sol), str(sol), repr(model), repr(swept), swept.table(), str(sol.explain(0))):
        assert not STEERING.findall(text)


def test_letters_stay_as_they_are() -> None:
    from hybridsim.errors import printable

    assert printable("Größe µ·m\nЖ 木 é") == "Größe µ·m\nЖ 木 é"
    assert printable("a\tb\xa0c\rd") == "a b c d"
