"""This package carries derivatives through the segments and ordinary events of a run in compiled code."""
