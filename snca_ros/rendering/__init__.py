"""Renders walks as films and as strips of pictures."""
