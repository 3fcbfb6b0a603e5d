"""This package reproduces published studies: the published method, the exact result, and a verdict on each claim."""

from __future__ import annotations

from hybridsim.studies.he2026.measured.he2026 import Study, he2026
from hybridsim.studies.he2026.measured.page import page

__all__ = ["Study", "he2026", "page"]
