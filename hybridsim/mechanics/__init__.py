"""This package runs mechanical systems with many dry contacts, given as matrices, contact directions and laws."""
