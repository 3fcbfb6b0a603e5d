"""This package computes the study of He et al. (2026) again, and judges each claim of the paper."""

from __future__ import annotations

from hybridsim.studies.he2026.measured.he2026 import Study, he2026
from hybridsim.studies.he2026.measured.page import page

__all__ = ["Study", "he2026", "page"]
