"""This folder computes with vectors of several numbers at once. The module `vectors` defines the vectors."""
