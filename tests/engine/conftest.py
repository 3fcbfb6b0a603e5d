"""A first call may compile a kernel: single examples have no deadline, unless a profile is asked for."""

from hypothesis import settings

settings.register_profile("engine", deadline=None)
if settings.get_current_profile_name() == "default":
    settings.load_profile("engine")
