"""Published studies, done again: what the published method gives, what is true, and a verdict on every claim."""

from __future__ import annotations

from hybridsim.analysis.study.he2026 import Study, he2026
from hybridsim.analysis.study.page import page

__all__ = ["Study", "he2026", "page"]
