"""Our own armband: it acknowledges every command and falls silent by itself."""
