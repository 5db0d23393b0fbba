"""Settings for all tests."""

import os

from hypothesis import settings

# A landing must not depend on the luck of a draw; a developer's own run goes on exploring. Nor may
# any test depend on how busy the machine is.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("exploring", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "exploring")
