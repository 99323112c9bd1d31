"""The parts of `classical`, each an object with a memory: vision, lane, corridor, junctions, overtaking."""
