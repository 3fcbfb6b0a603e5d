"""This module defines which part of a run is stored after the run has ended."""

from __future__ import annotations

import math
from typing import NamedTuple


class Retention(NamedTuple):
    """The length of time before the end of a run for which segments and events are stored."""

    segments: float | None = math.inf
    events: float | None = math.inf


ALL = Retention()
EVENTS = Retention(segments=None)
NOTHING = Retention(None, None)
