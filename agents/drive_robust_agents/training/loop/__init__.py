"""The training loop: batches, learning rate, average, states on disk, weights out."""
