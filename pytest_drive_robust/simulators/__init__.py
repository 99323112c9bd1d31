"""The worlds that an agent can be driven in: one module or folder per backend behind `base.Simulator`."""
