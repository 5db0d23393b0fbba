"""A voice key: a press when somebody begins to speak into a microphone."""
