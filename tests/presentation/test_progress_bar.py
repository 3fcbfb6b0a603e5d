"""The bar of `progress=True`: what it shows, when it is silent, and that its line ends."""

from __future__ import annotations

import io
import sys

import pytest

import hybridsim as hs
from hybridsim.presentation import progress_bar
from hybridsim.presentation.progress_bar import ProgressBar, callback


class Terminal(io.StringIO):
    """A stderr that is a terminal."""

    def isatty(self) -> bool:
        return True


class Clock:
    """A clock that stands at a time that the test sets."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(progress_bar, "time", made)
    return made


def test_the_bar_and_the_time_left(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar = ProgressBar()
    bar(0.1)  # too early
    assert terminal.getvalue() == ""
    clock.now = 10.0
    bar(1, 4, "F0=3")  # a quarter in 10 s: three quarters take 30 s
    assert terminal.getvalue() == "\r 25.0 % |" + 6 * "#" + 18 * " " + "| 0:30 left  F0=3"
    clock.now = 10.01
    bar(0.3)  # too soon after the one before
    assert "30.0" not in terminal.getvalue()
    bar(1.0)
    *_, last, end = terminal.getvalue().replace("\r", "\n").split("\n")
    assert last.rstrip() == "100.0 % |" + 24 * "#" + "|" and end == ""


def test_hours_are_shown_as_hours(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar, clock.now = ProgressBar(), 3661.0
    bar(0.5)
    assert "1:01:01 left" in terminal.getvalue()


def test_the_line_ends_where_a_call_stops_early(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar, clock.now = ProgressBar(), 1.0
    bar(0.5)
    del bar
    assert terminal.getvalue().endswith("left\n")


def test_a_file_shows_nothing_and_a_notebook_the_bar(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.StringIO()
    monkeypatch.setattr(sys, "stderr", written)
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    bar, clock.now = ProgressBar(), 1.0
    bar(0.5)
    assert written.getvalue() == ""
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    bar(0.5)
    assert "50.0 %" in written.getvalue()


def test_what_progress_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    assert callback(None) is None and callback(False) is None
    assert isinstance(callback(True), ProgressBar) and callback(print) is print
    with pytest.raises(hs.UsageError, match="`progress` cannot be 'yes'") as caught:
        hs.simulate("dfcs", (0, 0.01), progress="yes")
    assert "True for a bar" in str(caught.value)


def test_calls_show_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sweep of three points, without a wait before the first display."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(progress_bar, "_WAIT", 0.0)
    monkeypatch.setattr(progress_bar, "_PAUSE", 0.0)
    hs.sweep("dfcs", {"F0": [1, 2, 3]}, lambda model: model.parameter_values()["F0"], progress=True)
    assert "100.0 % |" in terminal.getvalue() and terminal.getvalue().endswith("\n")
    terminal.truncate(0)
    run = hs.simulate("dfcs", (0, 0.05), integrator="scipy-dop853", progress=True)
    assert run.success and " % |" in terminal.getvalue()
