"""The simulated participant of the crowd study: chooses a way, walks it, feels and learns."""
