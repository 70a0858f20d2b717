"""Pages that play a walk, recorded or live."""
