"""What a participant meets, as pure functions of time: scenes, who sits where, where they look."""
