"""A strip of modes shows every interval, however short it is and however narrow the strip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg

import hybridsim as hs
from hybridsim.plot import time_history
from hybridsim.presentation.mode_strip import bars_of

MODES = ("stick", "slip+", "slip-", "open")
FINE, HIGH = 8, 12  # points per column, and over the height (divisible by 1, 2, 3 and 4)


@dataclass(frozen=True)
class Interval:
    mode: str
    t0: float
    t1: float


def painted(intervals: list[Interval], t0: float, t1: float, columns: int) -> np.ndarray:
    """The mode (its number) that is on top at each point of a strip, (height, width); -1 where there is none."""
    picture = np.full((HIGH, columns * FINE), -1)
    x = t0 + (np.arange(columns * FINE) + 0.5) / FINE * (t1 - t0) / columns
    y = (np.arange(HIGH) + 0.5) / HIGH
    for bar in bars_of(intervals, t0, t1, columns)[0]:
        across, up = (bar.start <= x) & (x < bar.end), (bar.low <= y) & (y < bar.high)
        picture[np.ix_(up, across)] = MODES.index(bar.mode)
    return picture


@settings(max_examples=150, deadline=None)
@given(
    lengths=st.lists(st.floats(-8, 2).map(lambda power: 10.0**power), min_size=1, max_size=60),
    modes=st.lists(st.sampled_from(range(len(MODES))), min_size=60, max_size=60),
    columns=st.integers(5, 400),
    is_backward=st.booleans(),
)
def test_no_interval_is_lost_at_any_width(
    lengths: list[float], modes: list[int], columns: int, is_backward: bool
) -> None:
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    intervals = [
        Interval(MODES[m], *((b, a) if is_backward else (a, b))) for m, a, b in zip(modes, ends, ends[1:])
    ]
    total = float(ends[-1])
    picture, column = painted(intervals, 0.0, total, columns), total / columns
    assert (picture >= 0).all()
    for interval in intervals:
        start, end = sorted((interval.t0, interval.t1))
        near = slice(
            max(0, int((start / column - 1) * FINE)), min(columns * FINE, int((end / column + 1) * FINE) + 1)
        )
        seen = (picture[:, near] == MODES.index(interval.mode)).sum(axis=0)
        # about a column wide, and at least a part of the height that all modes of the column have
        assert (seen >= HIGH // len(MODES)).sum() >= FINE - 1, interval


def test_intervals_that_can_be_told_apart_are_as_they_are() -> None:
    intervals = [Interval("stick", 0.0, 1.0), Interval("slip+", 1.0, 3.0), Interval("stick", 3.0, 9.0)]
    bars, is_shared = bars_of(intervals, 0.5, 8.0, 100)
    assert [(b.start, b.end, b.low, b.high, b.mode) for b in bars] == [
        (0.5, 1.0, 0.0, 1.0, "stick"), (1.0, 3.0, 0.0, 1.0, "slip+"), (3.0, 8.0, 0.0, 1.0, "stick"),
    ]  # fmt: skip
    assert not is_shared


def test_short_modes_in_one_column_share_its_height() -> None:
    intervals = [
        Interval("stick", 0.0, 5.0),
        Interval("slip+", 5.0, 5.001),
        Interval("stick", 5.001, 5.002),
        Interval("slip-", 5.002, 5.003),
        Interval("stick", 5.003, 10.0),
    ]
    bars, is_shared = bars_of(intervals, 0.0, 10.0, 100)
    column = [bar for bar in bars if bar.high < 1.0 or bar.low > 0.0]
    assert is_shared and [bar.mode for bar in column] == ["slip+", "stick", "slip-"]
    assert all(bar.end - bar.start == pytest.approx(0.1) for bar in column)


def test_the_strip_of_the_valve_shows_all_of_its_slips() -> None:
    """The slips last milliseconds in a run of two minutes: each is a line in the picture as it is written."""
    sol = hs.simulate("valve-stiction", (0, 120), rtol=1e-8)
    slips = [interval for interval in sol.modes["f"] if interval.mode != "stick"]
    assert len(slips) > 60
    history = time_history(sol, ["x"])
    figure = history.modes.get_figure()  # type: ignore[union-attr]  # the model has a contact
    FigureCanvasAgg(figure)
    for dpi in (72, 150):
        figure.set_dpi(dpi)
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
        row = pixels.shape[0] - round(history.modes.transData.transform((0, 0))[1])
        left, right = (round(history.modes.transData.transform((t, 0))[0]) for t in (0, 120))
        line = pixels[row, left + 1 : right]
        is_colour = np.ptp(line, axis=1) > 60  # blue or orange, not black
        assert (np.diff(is_colour.astype(int)) == 1).sum() + is_colour[0] >= len(slips)
