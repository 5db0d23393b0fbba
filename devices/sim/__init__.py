"""Wire-level simulators: the other end of a driver's transport, fed by a simulated body."""
