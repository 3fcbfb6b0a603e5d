"""This folder reproduces published studies, each in its own subfolder."""
