"""This package reproduces published studies; each study has its own subfolder."""
