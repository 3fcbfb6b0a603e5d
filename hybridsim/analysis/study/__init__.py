"""This package reproduces published studies: the published method, the exact result, and a verdict on each claim."""

from __future__ import annotations

from hybridsim.analysis.study.he2026 import Study, he2026
from hybridsim.analysis.study.page import page

__all__ = ["Study", "he2026", "page"]
