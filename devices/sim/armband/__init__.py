"""Our armband, its motors and its firmware."""
