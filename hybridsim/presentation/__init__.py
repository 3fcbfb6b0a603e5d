"""This folder gives results their form: tables, readable text, colours, and HTML for notebooks."""
