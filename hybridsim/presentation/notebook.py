"""This module shows a run in notebooks as HTML: outcome, a strip of modes for each component, events."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from html import escape
from typing import Any

from hybridsim.model.parts.component import Component
from hybridsim.presentation.colours import INK, mode_colours
from hybridsim.presentation.mode_strip import Interval

# Limits of the size of the HTML: rectangles in all strips, strips, first and last rows of the table, warnings.
_RECTANGLES, _MAX_BARS, _FIRST, _LAST, _WARNINGS = 1000, 20, 20, 5, 10
_WIDTH, _HEIGHT = 1000, 24  # size of a strip in its own units; the page stretches its width
_NARROWEST = 1.5  # width of a rectangle, so that a short mode is visible
_OVERLAP = 0.3  # added width of a rectangle, so that no gap is visible between neighbours
_GOOD, _BAD = "#009E73", "#D55E00"  # readable on black and on white
_CELL = "padding:0 .8em 0 0;text-align:left;border:none"


def run_html(
    components: Collection[Component],
    head: Mapping[str, str],
    success: bool,
    span: tuple[float, float] | None,
    modes: Mapping[str, Sequence[Interval]],
    events: Sequence[Any],
    warnings: Sequence[str],
) -> str:
    """Return the HTML summary of a run, of limited size and without scripts or style sheets.

    Parameters
    ----------
    head : lines of text about the run by label; the first line is next to the mark of success.
    success : whether the run reached its end.
    span : first and last time, or None if nothing was computed.
    modes : intervals of each component.
    events : objects with the attributes t, component, source, target and kind.
    """
    mark, colour = ("✔", _GOOD) if success else ("✘", _BAD)
    (first, text), *rest = head.items()
    parts = [
        f'<div style="margin-bottom:.4em"><span style="color:{colour}">{mark}</span> '
        f"<b>{escape(first)}</b> {escape(text)}</div>"
    ]
    parts += [f"<div>{_dimmed(escape(name))} {escape(value)}</div>" for name, value in rest]
    if span is not None and modes and span[0] != span[1]:
        parts += _mode_bars(mode_colours(components), modes, *sorted(span))
    if events:
        parts += _event_table(events)
    parts += [f'<div style="color:{_BAD}">⚠ {escape(text)}</div>' for text in warnings[:_WARNINGS]]
    if len(warnings) > _WARNINGS:
        parts.append(f"<div>… {len(warnings) - _WARNINGS} more warnings</div>")
    return '<div style="max-width:72em;line-height:1.5">' + "\n".join(parts) + "</div>"


def _dimmed(text: str) -> str:
    return f'<span style="opacity:.65">{text}</span>'


# -- strips -----------------------------------------------------------------------------------------------------


def _mode_bars(
    colours: Mapping[str, str], modes: Mapping[str, Sequence[Interval]], t0: float, t1: float
) -> Iterator[str]:
    """Yield one strip of modes per component, and the times at both ends with a legend."""
    shown = dict(list(modes.items())[:_MAX_BARS])
    most = _RECTANGLES // len(shown)
    yield '<table style="width:100%;border-collapse:collapse;background:none;margin:.5em 0 0 0">'
    for component, intervals in shown.items():
        yield (
            f'<tr style="background:none"><td style="{_CELL};white-space:nowrap;width:1%">{escape(component)}</td>'
            f'<td style="padding:.1em 0;border:none">'
            f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="100%" height="{_HEIGHT}" preserveAspectRatio="none" '
            f'role="img" style="display:block" aria-label="modes of {escape(component)}">'
        )
        yield from _rectangles(intervals, colours, t0, t1, most)
        yield "</svg></td></tr>"
    crowded = any(len(intervals) > most for intervals in shown.values())
    note = _dimmed("each column shows the fraction of time in each mode") if crowded else ""
    yield (
        f'<tr style="background:none"><td style="border:none"></td><td style="padding:0;border:none">'
        f'<div style="display:flex;justify-content:space-between">'
        f"{_dimmed(f'{t0:.6g}')}{note}{_dimmed(f'{t1:.6g}')}</div>"
        f"</td></tr></table>"
    )
    occurring = {interval.mode for intervals in shown.values() for interval in intervals}
    squares = [
        f'<span style="display:inline-block;width:.8em;height:.8em;background:{_fill(colour)};margin:0 .4em 0 1em">'
        f"</span>{escape(mode)}"
        for mode, colour in colours.items()
        if mode in occurring
    ]
    more = f" {_dimmed(f'and {len(modes) - _MAX_BARS} more components')}" if len(modes) > _MAX_BARS else ""
    yield f'<div style="margin-bottom:.4em">{"".join(squares[:_MAX_BARS])}{more}</div>'


def _fill(colour: str) -> str:
    """Return the fill colour; black becomes the text colour of the page, visible on dark pages."""
    return "currentColor" if colour == INK else colour


def _rectangles(
    intervals: Sequence[Interval], colours: Mapping[str, str], t0: float, t1: float, most: int
) -> Iterator[str]:
    """Yield a rectangle for each interval, or columns with the fraction of each mode if there are many."""
    scale = _WIDTH / (t1 - t0)
    if len(intervals) <= most:
        ends = [sorted((interval.t0, interval.t1)) for interval in intervals]
        is_narrow = [(end - start) * scale < 3 * _NARROWEST for start, end in ends]
        # narrow ones are last, and so above their neighbours
        for k in sorted(range(len(intervals)), key=is_narrow.__getitem__):
            (start, end), mode = ends[k], intervals[k].mode
            width = max((end - start) * scale, _NARROWEST)
            middle = (0.5 * (start + end) - t0) * scale
            title = f"{mode}: {start:.9g} to {end:.9g}"
            yield _rectangle(middle - width / 2, 0, width, _HEIGHT, colours[mode], title)
        return
    names = [mode for mode in colours if any(interval.mode == mode for interval in intervals)]
    columns = max(most // len(names), 1)
    for k, shares in enumerate(_shares(intervals, names, t0, t1, columns)):
        shares_text = ", ".join(
            f"{mode} {100 * share:.3g} %" for mode, share in zip(names, shares, strict=True) if share
        )
        title = (
            f"{t0 + k * (t1 - t0) / columns:.9g} to {t0 + (k + 1) * (t1 - t0) / columns:.9g}: {shares_text}"
        )
        top = 0.0
        for mode, share in zip(names, shares, strict=True):
            if share:
                width = _WIDTH / columns
                yield _rectangle(k * width, top, width, share * _HEIGHT, colours[mode], title)
            top += share * _HEIGHT


def _shares(
    intervals: Sequence[Interval], names: Sequence[str], t0: float, t1: float, columns: int
) -> list[list[float]]:
    """Return the fraction of time in each mode, for columns of equal duration."""
    number = {mode: i for i, mode in enumerate(names)}
    shares = [[0.0] * len(names) for _ in range(columns)]
    for interval in intervals:
        start, end = ((t - t0) / (t1 - t0) * columns for t in sorted((interval.t0, interval.t1)))
        for k in range(int(start), min(int(end), columns - 1) + 1):
            shares[k][number[interval.mode]] += max(min(end, k + 1) - max(start, k), 0.0)
    return shares


def _rectangle(x: float, y: float, width: float, height: float, colour: str, title: str) -> str:
    return (
        f'<rect x="{x:.2f}" y="{y:.2f}" width="{width + _OVERLAP:.2f}" height="{height:.2f}" fill="{_fill(colour)}">'
        f"<title>{escape(title)}</title></rect>"
    )


# -- events -----------------------------------------------------------------------------------------------------


def _event_table(events: Sequence[Any]) -> Iterator[str]:
    """Yield a collapsible table of the events, shortened to the first and last rows if it is long."""
    many = len(events) > _FIRST + _LAST
    yield f"<details><summary>{len(events)} event{'s' if len(events) > 1 else ''}</summary>"
    yield '<table style="border-collapse:collapse;background:none;margin:0"><tr style="background:none">'
    yield "".join(f'<th style="{_CELL}">{title}</th>' for title in ("t", "component", "from", "to", "kind"))
    yield "</tr>"
    yield from map(_event_row, events[:_FIRST] if many else events)
    if many:
        hidden = len(events) - _FIRST - _LAST
        yield f'<tr style="background:none"><td colspan="5" style="{_CELL}">{_dimmed(f"… {hidden} more …")}</td></tr>'
        yield from map(_event_row, events[-_LAST:])
    yield "</table></details>"


def _event_row(event: Any) -> str:
    cells = (f"{event.t:.9g}", event.component, event.source, event.target, event.kind)
    return (
        '<tr style="background:none">'
        + "".join(f'<td style="{_CELL}">{escape(cell)}</td>' for cell in cells)
        + "</tr>"
    )
