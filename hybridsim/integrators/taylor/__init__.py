"""This folder contains the integrator `taylor`: Taylor series with an order that depends on the tolerance."""
