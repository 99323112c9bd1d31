"""What each agent's training is made of: inputs, augmentation, targets and losses."""
