"""Requirements on an agent: their sentences, their objects, and the verdicts on them."""
