"""Random whole models that combine forms, and a judge of their motion that shares no code with hybridsim."""
