"""One profile of hypothesis for all tests: the same examples every time, and no deadline."""

from hypothesis import settings

settings.register_profile('steady', deadline=None, derandomize=True, database=None)
settings.load_profile('steady')
