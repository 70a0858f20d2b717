"""One voxel's mind: rate coding, spiking network, perceptron, and the cell made of them."""
