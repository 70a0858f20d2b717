"""Pictures and films of walks."""
