"""What must hold for an agent: the sentences, the objects behind them, and the verdicts."""
