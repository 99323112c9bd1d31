"""The parts of `classical`: vision, lane, corridor, junctions, overtaking. Each is an object with a memory."""
