"""How much of a run is kept after it ends."""

from __future__ import annotations

import math
from typing import NamedTuple


class Retention(NamedTuple):
    """The time before the end of a run, in the unit of t, for which segments and events are kept; None: not at all."""

    segments: float | None = math.inf
    events: float | None = math.inf


ALL = Retention()
EVENTS = Retention(segments=None)
NOTHING = Retention(None, None)
