"""Lab Streaming Layer: gaze and bodies that come in, and what a session sends out."""
