"""What the drivers of both headset runtimes share."""
