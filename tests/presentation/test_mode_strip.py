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
FINE, HIGH = 8, 12  # points per column, and over the height


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
    for bar in bars_of(intervals, t0, t1, columns, HIGH)[0]:
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
        # about a column wide, and at least one pixel high
        assert (seen >= 1).sum() >= FINE - 1, interval


def test_intervals_that_can_be_told_apart_are_as_they_are() -> None:
    intervals = [Interval("stick", 0.0, 1.0), Interval("slip+", 1.0, 3.0), Interval("stick", 3.0, 9.0)]
    bars, is_shared = bars_of(intervals, 0.5, 8.0, 100, HIGH)
    assert [(b.start, b.end, b.low, b.high, b.mode) for b in bars] == [
        (0.5, 1.0, 0.0, 1.0, "stick"), (1.0, 3.0, 0.0, 1.0, "slip+"), (3.0, 8.0, 0.0, 1.0, "stick"),
    ]  # fmt: skip
    assert not is_shared


def test_a_divided_column_shows_the_share_of_each_mode() -> None:
    """A column of 0.1 has stick for 0.06 and slip- for 0.04 less 0.001 of slip+, which has one pixel of twenty."""
    intervals = [
        Interval("stick", 0.0, 5.04),
        Interval("slip+", 5.04, 5.041),
        Interval("slip-", 5.041, 5.08),
        Interval("stick", 5.08, 10.0),
    ]
    bars, is_divided = bars_of(intervals, 0.0, 10.0, 100, 20)
    column = [bar for bar in bars if bar.high < 1.0 or bar.low > 0.0]
    assert is_divided and [bar.mode for bar in column] == ["stick", "slip+", "slip-"]
    heights = [bar.high - bar.low for bar in column]
    assert heights == pytest.approx([0.95 * 60 / 99, 0.05, 0.95 * 39 / 99])
    assert column[0].low == 0.0 and column[-1].high == pytest.approx(1.0)
    assert all(bar.end - bar.start == pytest.approx(0.1) for bar in column)


@pytest.mark.parametrize("cycles", [150, 223.7, 400, 1111.1])
def test_a_squealing_brake_sticks_for_a_tenth_of_the_strip(cycles: float) -> None:
    """Each cycle sticks first and then slips, and the strip of 400 columns has stick below slip everywhere."""
    starts = np.arange(int(cycles) + 1)
    intervals = [
        interval
        for n in starts.tolist()
        for interval in (Interval("stick", n, n + 0.1), Interval("slip+", n + 0.1, n + 1))
    ]
    picture = painted(intervals, 0.0, float(starts[-1] + 1), 400)
    assert np.mean(picture == 0) == pytest.approx(0.1, abs=0.03)
    assert (np.diff(picture, axis=0) >= 0).all()  # from below: stick (0), then slip (1)


def test_the_strip_of_the_valve_shows_all_of_its_slips() -> None:
    """The slips last milliseconds in a run of two minutes: each is in the picture as it is written."""
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
        top, bottom = (
            pixels.shape[0] - round(history.modes.transData.transform((0, y))[1]) for y in (-0.38, 0.38)
        )
        left, right = (round(history.modes.transData.transform((t, 0))[0]) for t in (0, 120))
        strip = pixels[top:bottom, left + 1 : right]
        is_colour = (np.ptp(strip, axis=2) > 60).any(axis=0)  # blue or orange, not black
        assert (np.diff(is_colour.astype(int)) == 1).sum() + is_colour[0] >= len(slips)
