"""What a synchronisation test listens with: a board with sensors, or a sound card."""
