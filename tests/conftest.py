"""What all tests share: Hypothesis draws the same examples every time and has no clock, since a first call compiles."""

from hypothesis import settings

settings.register_profile("brdfdb", derandomize=True, deadline=None, database=None)
settings.load_profile("brdfdb")
