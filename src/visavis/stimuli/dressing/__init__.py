"""From a study's scene to a picture: characters, rooms and activities."""
