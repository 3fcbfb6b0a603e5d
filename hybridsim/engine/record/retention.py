"""The part of a run that is stored after the run has ended."""

from __future__ import annotations

import math
from typing import NamedTuple


class Retention(NamedTuple):
    """Which part of a run is stored: a time before its end, for segments and for events; None: nothing."""

    segments: float | None = math.inf
    events: float | None = math.inf


ALL = Retention()
EVENTS = Retention(segments=None)
NOTHING = Retention(None, None)
