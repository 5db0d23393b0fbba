"""How any simulated eye tracker errs and is calibrated."""
