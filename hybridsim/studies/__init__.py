"""Published studies are done again here, each in one folder."""
