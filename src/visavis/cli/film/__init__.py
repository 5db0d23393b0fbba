"""Films of recorded trials: drawn again from the recording, by cameras that know the place."""
