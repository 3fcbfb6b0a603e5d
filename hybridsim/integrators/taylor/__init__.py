"""The integrator `taylor` follows the flow by Taylor series, of an order that the tolerance asks for."""
