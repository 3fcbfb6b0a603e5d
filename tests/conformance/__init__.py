"""Scenes with known answers, and the judge that holds every integrator against them."""
