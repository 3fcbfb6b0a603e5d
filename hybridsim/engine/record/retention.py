"""How much of a run is kept after it ends."""

from __future__ import annotations

import math
from typing import NamedTuple


class Keep(NamedTuple):
    """The time before the end of a run, in the unit of t, for which segments and events are kept; None: not at all."""

    segments: float | None = math.inf
    events: float | None = math.inf


ALL = Keep()
EVENTS = Keep(segments=None)
NOTHING = Keep(None, None)
