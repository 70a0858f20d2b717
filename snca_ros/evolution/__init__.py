"""Offline evolution of controllers: strategies, tasks, episodes, workers and checkpoints."""
