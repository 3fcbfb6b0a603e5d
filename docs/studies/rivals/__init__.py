"""The speed study's scenes, the methods that run them, and what they are held against."""
