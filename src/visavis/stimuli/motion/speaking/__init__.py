"""A speaker's whole body from a gesture script: arms by lexeme, posture from a corpus."""
