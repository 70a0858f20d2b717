"""Offline evolution: strategy, episodes, checkpoints and the script that trains controllers."""
