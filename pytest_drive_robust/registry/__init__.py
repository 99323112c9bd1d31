"""Names of agents, perturbations, simulators and metrics, and where each is loaded from."""
