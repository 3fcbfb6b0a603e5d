"""This package runs CVODE of SUNDIALS, which is restarted after every event."""
