"""This package draws sweeps: lines over one parameter, and maps over two."""
