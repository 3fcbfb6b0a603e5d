"""This package contains the integrator `taylor`: Taylor series whose order depends on the tolerance."""
