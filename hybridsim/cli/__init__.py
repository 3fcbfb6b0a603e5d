"""The command line: `hybridsim run | compare | check | models | integrators | cache`."""
