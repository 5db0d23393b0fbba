"""Settings for all tests."""

import os

from hypothesis import settings

# A landing must not depend on the luck of a draw; a developer's own run goes on exploring.
settings.register_profile("ci", derandomize=True, deadline=None)
if os.environ.get("CI"):
    settings.load_profile("ci")
