"""This package writes a run as one HTML page that needs no other file and no connection."""

from hybridsim.report.page import write_report

__all__ = ["write_report"]
