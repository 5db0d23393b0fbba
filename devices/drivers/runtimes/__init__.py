"""The common part of the drivers of both headset runtimes."""
