"""The part of a run that is stored after the run has ended."""

from __future__ import annotations

import math
from typing import NamedTuple


class Retention(NamedTuple):
    """How long before its end a run stores segments and events, in the unit of t; None: nothing."""

    segments: float | None = math.inf
    events: float | None = math.inf


ALL = Retention()
EVENTS = Retention(segments=None)
NOTHING = Retention(None, None)
