"""This folder runs CVODE of SUNDIALS, restarted after every event."""
