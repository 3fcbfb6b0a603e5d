"""Lyapunov exponents of motions with events: the rates at which neighbouring motions move apart."""

from hybridsim.analysis.lyapunov.exponents import LyapunovExponents, lyapunov_exponents

__all__ = ["LyapunovExponents", "lyapunov_exponents"]
