"""The cell of a voxel: its architecture, rate coding, spiking network or perceptron."""
