"""Devices of an OpenVR runtime (SteamVR)."""
