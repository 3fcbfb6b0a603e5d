"""The ball on the vibrating table in 80 digits: parabolas, blows on a sine, rest, and the next throw."""

from __future__ import annotations

from typing import Any

import mpmath

MP = mpmath.mp.clone()
MP.dps = 80  # a flight of 1e-25 s is 1e-50 m high
G, A, OMEGA, E = MP.mpf("9.81"), MP.mpf("0.01"), MP.mpf(40), MP.mpf("0.2")
SHORT = MP.mpf(10) ** -25  # a flight that is none


def table(t: Any) -> tuple[Any, Any]:
    """Height and speed of the table."""
    return A * MP.sin(OMEGA * t), A * OMEGA * MP.cos(OMEGA * t)


def flight(t0: Any, h: Any, w: Any, t: Any) -> tuple[Any, Any]:
    """Height and speed of a ball that flies from (h, w) at t0."""
    s = t - t0
    return h + w * s - G * s * s / 2, w - G * s


def landing(t0: Any, h: Any, w: Any, w_relative: Any) -> Any:
    """The next time at which the ball is on the table; w_relative is its speed off the table at t0, if it is on it."""

    def gap(t: Any) -> Any:
        return flight(t0, h, w, t)[0] - table(t)[0]

    step = MP.mpf("1e-4") if w_relative is None else min(MP.mpf("1e-4"), w_relative / (50 * G))
    a = t0 + step
    while gap(a + step) > 0:
        a += step
    b = a + step
    while b - a > MP.mpf(10) ** -60:
        middle = (a + b) / 2
        a, b = (middle, b) if gap(middle) > 0 else (a, middle)
    return b


def states(end: float, times: list[float]) -> tuple[list[float], list[list[float]]]:
    """The first landing after each throw, and (t, height, speed) at the times that are well away from a blow."""
    t, h, w, off = MP.mpf(0), MP.mpf("0.01"), MP.mpf(0), None
    pieces: list[tuple[Any, Any, Any]] = [(t, h, w)]  # flights; at rest h is None
    blows, firsts, is_first = [], [], True
    while t < end:
        t = landing(t, h, w, off)
        blows.append(t)
        firsts += [float(t)] if is_first else []
        is_first = False
        speed = table(t)[1]
        approach = flight(*pieces[-1], t)[1] - speed
        assert approach < 0
        h, off = table(t)[0], -E * approach
        w = speed + off
        if off < SHORT:
            phase = MP.fmod(OMEGA * t, 2 * MP.pi)
            thrown = MP.asin(G / (A * OMEGA**2))
            assert MP.sin(phase) < MP.sin(thrown)  # the table does not fall away: it rests
            pieces.append((t, None, None))
            t += MP.fmod(thrown - phase + 2 * MP.pi, 2 * MP.pi) / OMEGA
            (h, w), off, is_first = table(t), None, True
        pieces.append((t, h, w))
    found = []
    for time in times:
        if min(abs(time - blow) for blow in blows) > 1e-3:
            start, height, speed = next(piece for piece in reversed(pieces) if piece[0] <= time)
            here = table(MP.mpf(time)) if height is None else flight(start, height, speed, MP.mpf(time))
            found.append([time, float(here[0]), float(here[1])])
    return [first for first in firsts if first < end], found
