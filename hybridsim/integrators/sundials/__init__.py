"""This package runs CVODE of SUNDIALS, restarted after every event."""
