"""This package contains the integrator `taylor`: Taylor series with an order that depends on the tolerance."""
