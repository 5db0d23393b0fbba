"""Sound through the computer's sound card: what is mixed, and when it comes out."""
