"""The page that shows a walk: what it is made of, and the commands that make it."""
