"""This package represents a part of a run by polynomials between its events: first the result, then its intervals."""
