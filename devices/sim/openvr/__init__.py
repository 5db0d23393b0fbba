"""An OpenVR runtime without SteamVR."""
