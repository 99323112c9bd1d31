"""Reference agents for pytest-drive-robust: one agent, one file. They get no private access."""
