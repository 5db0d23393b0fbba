"""From what a study says to what is drawn: who plays whom, in which room, doing what."""
