"""The parts of each agent's training: inputs, augmentation, targets and losses."""
