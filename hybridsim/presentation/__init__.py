"""This package presents results: tables, readable text, colours, and HTML for notebooks."""
