"""This package holds styles, scales, symbols, strips of modes and sample points that several charts use."""
