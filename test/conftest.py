"""One profile of hypothesis for all tests: the same examples every time, and no deadline."""

import pytest
from hypothesis import settings

pytest.register_assert_rewrite('support')
settings.register_profile('steady', deadline=None, derandomize=True, database=None)
settings.load_profile('steady')
