"""The sub-commands of `snca`, one file each: its options, their checks, what it prints."""
