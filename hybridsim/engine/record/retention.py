"""How much of a run is kept once it is over."""

from __future__ import annotations

import math
from typing import NamedTuple


class Keep(NamedTuple):
    """How far back from the end of a run, in the unit of t, its segments and its events are kept; None: not at all."""

    segments: float | None = math.inf
    events: float | None = math.inf


ALL = Keep()
EVENTS = Keep(segments=None)
NOTHING = Keep(None, None)
