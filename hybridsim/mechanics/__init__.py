"""This package simulates mechanical systems with many dry contacts, given as matrices and friction laws."""
