"""CVODE of SUNDIALS runs here with its own root finding, and starts anew after every event."""
