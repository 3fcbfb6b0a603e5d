"""The parts of a report that reduce the data: ranges in bins, modes in columns; and how to repeat a run."""

from __future__ import annotations

import ast
import json
import math
import shlex
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.cli import main
from hybridsim.report.curves import ranges_in
from hybridsim.report.embedded import indices
from hybridsim.report.events import _COLUMNS, in_columns
from hybridsim.report.repeat import Settings
from hybridsim.report.sampling import Sampler


def test_ranges_contain_every_turning_point() -> None:
    """Of sin(t): each bin of time has the least and the largest value of the sine in it."""
    sol = hs.simulate(hs.Model("wave", states=[hs.State("x", 0, "cos(t)")]), (0, 50))
    (low,), (high,) = ranges_in(Sampler(sol, ["x"]), 77)
    edges = np.linspace(0, 50, 78)
    turns = [math.pi * (k + 0.5) for k in range(16)]
    for k in range(77):
        inside = [edges[k], edges[k + 1], *(t for t in turns if edges[k] <= t <= edges[k + 1])]
        assert low[k] == pytest.approx(min(map(math.sin, inside)), abs=2e-3)
        assert high[k] == pytest.approx(max(map(math.sin, inside)), abs=2e-3)


def test_ranges_reach_both_sides_of_a_jump() -> None:
    sol = hs.simulate("bouncing-ball", (0, 1))
    (low,), (high,) = ranges_in(Sampler(sol, ["w"]), 50)
    hit = sol.events[0]
    k = int(hit.t / 0.02)
    assert low[k] == pytest.approx(hit.x_minus[1]) and high[k] == pytest.approx(hit.x_plus[1])


def test_every_mode_of_a_column_is_there() -> None:
    rng = np.random.default_rng(3)
    t = np.concatenate([[0.0], np.sort(rng.uniform(0, 7, 30_000)), [7.0]])
    ends, numbers = np.column_stack([t[:-1], t[1:]]), rng.integers(0, 3, 30_001)
    starts, modes = in_columns(ends, numbers)
    assert (np.diff(starts) > 0).all()
    column = np.floor(starts / 7 * _COLUMNS + 1e-6).astype(int)
    for k in (0, 17, 2048, _COLUMNS - 1):
        a, b = 7 * k / _COLUMNS, 7 * (k + 1) / _COLUMNS
        expected = set(numbers[(ends[:, 0] < b) & (ends[:, 1] > a)].tolist())
        assert set(modes[column == k].tolist()) == expected


def test_a_column_shows_the_share_of_each_mode() -> None:
    """Each of 100 000 cycles has stick for a tenth and slip for the rest, and so has each column within a cycle."""
    begin = np.arange(100_000)
    starts = np.column_stack([begin, begin + 0.1]).ravel()
    ends = np.column_stack([starts, np.append(starts[1:], 100_000)])
    t, modes = in_columns(ends, np.tile([0, 1], 100_000))
    shares = np.diff(np.append(t, 100_000)) * _COLUMNS / 100_000
    assert (modes == np.tile([0, 1], _COLUMNS)).all()
    assert np.allclose(shares[::2], 0.1, atol=0.9 * _COLUMNS / 100_000)


def test_indices_take_the_smallest_type() -> None:
    assert [indices([most])["kind"] for most in (255, 256, 65_536)] == ["u1", "u2", "u4"]


def called(text: str) -> hs.Solution:
    """Carry out the call of `simulate` in a text, whose arguments are plain values."""
    call = next(node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call))
    assert ast.unparse(call.func) == "hs.simulate"
    keywords = {str(one.arg): ast.literal_eval(one.value) for one in call.keywords}
    return hs.simulate(ast.literal_eval(call.args[0]), **keywords)


RUNS = {
    "plain": lambda: hs.simulate("dfcs", (0, 0.05)),
    "changed": lambda: hs.simulate(
        "dfcs", (0, 0.05), params={"F0": 22, "omega": "0.64*sqrt(k/m)"}, x0={"v": 0.01}, integrator="dop853",
        rtol=1e-7, atol=1e-12, max_step=0.002,
    ),
    "own": lambda: hs.simulate(
        hs.Model("own", states=[hs.State("x", 1, "-a*x")], parameters={"a": 3}), (0, 1), params={"a": 2},
        x0={"x": 0.3}, limits={"steps": 1000},
    ),
    "fixed": lambda: hs.simulate("dfcs", (0, 0.05), integrator="rk4-dichotomy", steps_per_period=600),
}  # fmt: skip


@pytest.mark.parametrize("name", RUNS)
def test_a_run_can_be_repeated(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The lines of Python and the command line give the same end to the last bit."""
    monkeypatch.chdir(tmp_path)
    sol = RUNS[name]()
    settings = Settings(sol)
    assert settings.is_packaged == (name != "own")
    if settings.text is not None and not settings.is_packaged:
        Path("own.toml").write_text(settings.text, encoding="utf-8")
    again = called(settings.python("1"))
    assert again.x_end.tolist() == sol.x_end.tolist() and again.integrator == sol.integrator
    command = settings.command()
    assert command is not None
    capsys.readouterr()
    assert main([*shlex.split(command)[1:], "--json"]) == 0
    final = json.loads(capsys.readouterr().out)["final"]
    assert [final[state] for state in sol.names] == sol.x_end.tolist()


def test_what_the_command_line_cannot_repeat_has_python_only() -> None:
    late = hs.simulate("dfcs", (0.01, 0.05), z0={"f": "slip+"}, keep="events")
    settings = Settings(late)
    assert settings.command() is None
    again = called(settings.python("1"))
    assert again.x_end.tolist() == late.x_end.tolist()
    functions = Settings(hs.simulate(hs.Model("f", states={"x": 1.0}, flow=lambda t, x, p: -x), (0, 1)))
    assert functions.text is None and functions.command() is None and "    model," in functions.python("1")
