"""Examples have no deadline and may be slow to make, unless a profile is asked for: a first call may compile a kernel,
and the machine may have other work."""

from hypothesis import HealthCheck, settings

settings.register_profile("noisy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
if settings.get_current_profile_name() == "default":
    settings.load_profile("noisy")
