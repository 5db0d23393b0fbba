"""Sensors that notify over Bluetooth LE: chest straps, and any whose packets are described."""
