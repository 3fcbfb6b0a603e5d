"""The integrator `exact` follows linear modes in closed form."""
