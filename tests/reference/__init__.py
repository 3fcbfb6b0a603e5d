"""Reference solutions that share no code with the package under test."""
