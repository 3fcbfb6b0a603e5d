"""Fits with slow runs report themselves, and try few further first guesses."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.fit.derivative_costs import DerivativeCosts
from hybridsim.analysis.fit.residuals import Residuals

LINE = hs.Model("line", states=[hs.State("x", der="a", start=1.0)], parameters={"a": 0.5})
T = np.linspace(0.1, 2.0, 20)
WAVE = {"t": T, "x": np.sin(9.0 * T)}  # no line describes it


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A clock of the fit on which each run takes `each` seconds; derivatives are differences."""

    class Clock:
        each = seconds = 0.0

    solution = Residuals.solution

    def timed(self: Residuals, *arguments: Any) -> hs.Solution:
        Clock.seconds += Clock.each
        return solution(self, *arguments)

    add = DerivativeCosts.add_run
    monkeypatch.setattr(DerivativeCosts, "add_run", lambda self, _: add(self, 1e-6))
    monkeypatch.setattr(Residuals, "solution", timed)
    monkeypatch.setattr(import_module("hybridsim.analysis.fit.effort"), "Stopwatch", Clock)
    return Clock


def notices(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines on stderr, without those about compiling."""
    return [line for line in capsys.readouterr().err.splitlines() if "compiling" not in line]


def fit(**options: Any) -> hs.Fit:
    return hs.fit(LINE, hs.Record(WAVE, t0=0.0), {"a": (-1.0, 1.0)}, **options)


def test_further_first_guesses_take_few_slow_runs(clock: Any) -> None:
    clock.each = 1e-3
    every = fit()
    assert every.runs > 60
    assert not any("further first guesses" in text for text in every.warnings)
    clock.each = 100.0
    first, limited = fit(starts=1, progress=False), fit(progress=False)
    assert limited.runs <= 4 * first.runs  # twice as many, and the search from the last guess
    (text,) = [text for text in limited.warnings if "further first guesses" in text]
    assert f"{first.runs} of 60" in text
    assert limited.cost <= first.cost * (1 + 1e-9)


def test_a_long_fit_prints_one_line(clock: Any, capsys: pytest.CaptureFixture[str]) -> None:
    clock.each = 9.0
    fit(starts=2)
    (line,) = notices(capsys)
    assert line == "hybridsim: fitting: 3 runs so far, 9 s each (progress=True shows a bar)"


@pytest.mark.parametrize("progress", [False, lambda *_: None])
def test_a_long_fit_with_progress_prints_nothing(clock: Any, capsys: Any, progress: Any) -> None:
    clock.each = 9.0
    fit(starts=2, progress=progress)
    assert notices(capsys) == []
